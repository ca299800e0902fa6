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
from typer.testing import CliRunner

from tests.apps.device_test.people import Clock, complaint, sitting
from tests.system.processes import PATIENCE
from tests.system.systems import CONFIGS
from weberlink.apps.device_test import DeviceTestRequest, Dialog, run
from weberlink.apps.device_test.dialog import SampleRate, uninterrupted
from weberlink.cli import app

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


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (DeviceTestRequest("phantom"), "phantom: there is no such driver; there are "),
        (DeviceTestRequest("operator", None, ["foce_n=1"]), "operator.foce_n: unknown key; did you mean force_n?"),
        (DeviceTestRequest("operator", None, ["force_n=0"]), "greater than or equal to 0.01"),
        (DeviceTestRequest("replay", FILE), "is operator, not replay"),
        (DeviceTestRequest("operator", CONFIGS / "none.yaml"), "no such file"),
        (DeviceTestRequest("replay"), "replay.trace: is missing"),
    ],
)
def test_wrong_names_and_options_are_one_line(request_: DeviceTestRequest, words: str) -> None:
    assert words in complaint(request_)


def test_overrides_take_precedence_over_the_file() -> None:
    screen = io.StringIO()
    request = DeviceTestRequest("operator", FILE, ["force_n=2.5", "master.device.workspace_m=0.05"])
    run(request, sitting(Clock(), screen, "", "no")[0])
    assert "operator: axes xyz, workspace 100 x 100 x 100 mm, at most 2.5 N" in screen.getvalue()


def test_stopping_says_that_the_force_is_off() -> None:
    assert complaint(DeviceTestRequest("operator"), "") == "operator: stopped before the end; the force is off"
    assert complaint(DeviceTestRequest("point"), "") == "point: stopped before the end"


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


class CountingView:
    """Presses Enter after 150 readings."""

    def __init__(self, descriptor: int) -> None:
        self.looks = 0
        self._descriptor = descriptor

    def look(self, now: float) -> None:
        self.looks += 1
        if self.looks == 150:
            os.write(self._descriptor, b"\n")

    def lines(self) -> list[str]:
        return [f"look {self.looks}", "below"]


def test_terminal_shows_live_readings_until_enter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        view = CountingView(ours)
        os.write(ours, b"typed too early\n")
        Dialog(stream, stream).watch(view, "Enter to go on: ")
        shown = b""
        while select.select([ours], [], [], 0.3)[0]:
            shown += os.read(ours, 65536)
    os.close(ours)
    text = shown.decode()
    assert view.looks >= 150, "what was typed before does not count"
    assert text.count("Enter to go on: ") >= 2, "drawn anew"
    assert text.rstrip().endswith("below")
    assert "look 1\r\nbelow" in text


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


@pytest.mark.parametrize("arguments", [["nobody"], ["operator", "--set", "force_n=-1"], ["operator", "--config", "no"]])
def test_wrong_arguments_are_one_line_and_status_2(arguments: list[str]) -> None:
    result = CliRunner().invoke(app, ["device", "test", *arguments])
    assert (result.exit_code, result.stdout) == (2, "")
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("weberlink: ")
