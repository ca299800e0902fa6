"""The dialog on a terminal, sample rates, and the command `device test`."""

import io
import os
import pty
import select
import signal
import subprocess
import sys
import threading

import pytest

from tests.apps.device_test.people import Clock, complaint, sitting
from tests.system.systems import CONFIGS
from tests.wait import PATIENCE
from weberlink.apps.device_test import Dialog, run
from weberlink.apps.device_test.dialog import SampleRate, View, uninterrupted
from weberlink.master.devices.contract import DeviceReading

FILE = CONFIGS / "loopback.yaml"


def test_ctrl_c_waits_while_a_device_is_made_safe() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        os.kill(os.getpid(), signal.SIGINT)
        done.append("main")

    def safely() -> None:
        with uninterrupted():  # which signals never reach
            done.append("other thread")

    thread = threading.Thread(target=safely)
    thread.start()
    thread.join()
    assert done == ["main", "other thread"]


def test_overrides_take_precedence_over_the_file() -> None:
    screen = io.StringIO()
    run("operator", sitting(Clock(), screen, "", "no")[0], FILE, ["force_n=2.5", "master.device.workspace_m=0.05"])
    assert "operator: axes xyz, workspace 100 x 100 x 100 mm, at most 2.5 N" in screen.getvalue()


@pytest.mark.parametrize(
    ("name", "lines", "end"),
    [
        ("operator", ["", "yes", "", "y", "", "y", "", "y"], "The force is right.\n"),
        ("point", ["", "yes"], "The motion is right.\n"),
    ],
)
def test_simulated_part_passes_and_needs_no_sign_check(name: str, lines: list[str], end: str) -> None:
    screen = io.StringIO()
    run(name, sitting(Clock(), screen, *lines)[0])
    assert screen.getvalue().endswith(end)
    assert "Check of signs" not in screen.getvalue()
    assert complaint(name, "") == f"{name}: stopped before the end" + ("; the force is off" if "force" in end else "")


def test_sample_rate_counts_new_samples_of_the_last_second() -> None:
    rate, interpolated = SampleRate(), SampleRate()
    assert rate.in_words() == "0/s, age 0.0 ms"
    for tick in range(3000):
        now, sampled_at = tick * 0.001, (tick // 4) * 0.004
        rate.note(now, sampled_at - (0.05 if tick < 500 else 0.0))
        interpolated.note(now, now - 0.006, sampled_at=sampled_at)
    assert rate.rate_hz == interpolated.rate_hz == pytest.approx(250.0, rel=0.01)
    assert rate.oldest_s == pytest.approx(0.003)
    assert interpolated.oldest_s == pytest.approx(0.006)
    assert rate.in_words(0.0004) == "250/s, age 3.0 ms, trip 0.40 ms"


def test_terminal_shows_live_readings_until_enter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        reads: list[float] = []

        def latest(now: float) -> DeviceReading:
            reads.append(now)
            if len(reads) == 150:
                os.write(ours, b"\n")
            return DeviceReading(now, (0.001 * len(reads), 0.0, 0.0))

        os.write(ours, b"typed too early\n")
        Dialog(stream, stream).watch(View(latest, lambda _: ["below"]), "Enter to go on: ")
        shown = b""
        while select.select([ours], [], [], 0.3)[0]:
            shown += os.read(ours, 65536)
    os.close(ours)
    text = shown.decode()
    assert len(reads) >= 150, "what was typed before does not count"
    assert text.count("Enter to go on: ") >= 2, "drawn anew"
    assert f"x {len(reads):+7.1f} " in text[text.rindex("x ") :], "the last reading stays"
    assert text.rstrip().endswith("below")


def test_ctrl_c_in_a_process_is_one_line_and_status_1() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "weberlink", "device", "test", "operator"], cwd=CONFIGS.parent, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        while not process.stdout.readline().startswith("x "):
            pass
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert errors == "weberlink: operator: stopped before the end; the force is off\n"
    assert process.returncode == 1
