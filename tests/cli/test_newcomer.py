"""What goes wrong for a newcomer where only processes show it: each trial ends with a line that says what to do.

The trials run at once in a few threads, since most of their time is that of starting Python.
"""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest

from tests.program import PATIENT, ROOT, Program, free_port
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.installation import install_line
from weberlink.protocol.keys import generate
from weberlink.telemetry.recording.reader import read_recording

pytest.importorskip("mcap")
pytestmark = pytest.mark.realtime

AT_ONCE = 4
"""Trials that run at the same time."""
LONGEST = ("wrong key", "full disk in a session", "device not plugged")
"""Trials that wait rather than work; they start first."""
LOOPBACK = CONFIGS / "loopback.yaml"
LAN = CONFIGS / "lan.yaml"
TRACE = CONFIGS / "traces" / "operator.npz"
BLOCKED = "import sys; sys.modules[{!r}] = None; from weberlink.cli import main; main()"
"""A program in which an optional package is missing."""


class Ended(NamedTuple):
    """How a process ended."""

    status: int
    output: str
    errors: str


Trials = dict[str, Future[Ended]]


class Trial(NamedTuple):
    """A newcomer's mistake, or a mishap.

    Args:
        run: does it in a folder of its own.
        status: exit status that is due.
        line: part of the line on standard error, or of the first line of the report.
    """

    run: Callable[[Path], Ended]
    status: int
    line: str


def said(*arguments: object, program: str | None = None, **environment: str) -> Callable[[Path], Ended]:
    """Run a command; "{}" in an argument is the folder of the trial."""

    def run(folder: Path) -> Ended:
        filled = [str(argument).replace("{}", str(folder)) for argument in arguments]
        start = ["-m", "weberlink"] if program is None else ["-c", program]
        ended = subprocess.run(
            [sys.executable, *start, *filled],
            cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=120, check=False,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        return Ended(ended.returncode, ended.stdout, ended.stderr)

    return run


def two_sides(
    folder: Path, keys: tuple[str, str] = ("a", "a"), further: tuple[str, ...] = (), seconds: float = 3.0
) -> Ended:
    """A slave, and a master with another key or another file; how the master ended."""
    for key in set(keys):
        generate(folder / key)
    port = free_port()

    def arguments(key: str) -> list[str]:
        link = (f"link.listen=127.0.0.1:{port}", f"link.slave=127.0.0.1:{port}", f"link.key_file={folder / key}")
        return [part for override in link for part in ("--set", override)]

    with Program("slave", LAN, *arguments(keys[0]), "--duration", 60) as slave:
        slave.telemetry("slave")
        master = Program("master", LAN, *arguments(keys[1]), *further, "--duration", seconds)
        with master:
            return Ended(*master.finish())


def on_taken_port(folder: Path) -> Ended:
    generate(folder / "key")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        return said("slave", LAN, "--set", "link.key_file={}/key", "--set", f"link.listen={address}")(folder)


def stopped(*arguments: object, at: str) -> Callable[[Path], Ended]:
    """Ctrl-C in a loopback: before its daemons, in the session, or after it was asked to end."""

    def run(folder: Path) -> Ended:
        filled = [str(argument).replace("{}", str(folder)) for argument in arguments]
        with Program("loopback", *PATIENT, *filled) as program:
            if at == "start":
                until(program.daemons, "a daemon")
            else:
                program.engaged("slave")
            program.send(signal.SIGINT)
            if at == "end":
                program.send(signal.SIGINT)
            ended = Ended(*program.finish())
            assert program.rings() == []
            assert at == "end" or not ended.errors
            return ended

    return run


def killed(side: str) -> Callable[[Path], Ended]:
    def run(_: Path) -> Ended:
        with Program("loopback") as program:
            telemetry = program.engaged(side)
            os.kill(telemetry.pid, signal.SIGKILL)
            return Ended(*program.finish())

    return run


def interrupted(name: str, *arguments: object, after: Callable[[Path], bool]) -> Callable[[Path], Ended]:
    """Ctrl-C in work in virtual time, as soon as a condition holds."""

    def run(folder: Path) -> Ended:
        filled = [str(argument).replace("{}", str(folder)) for argument in arguments]
        with Program(name, *filled) as program:
            until(lambda: after(folder), f"{name} to be at work")
            program.send(signal.SIGINT)
            return Ended(*program.finish())

    return run


def on_full_disk(folder: Path) -> Ended:
    """A live recording on a small file system of its own; the session goes on when that is full."""
    disk = folder / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("mounting a small file system is not permitted here")
    try:
        with Program("loopback", *PATIENT, "--record", disk / "a.mcap", "--duration", 300) as program:
            telemetry = program.engaged("slave")
            line = ""
            while "recording stopped" not in line:
                line = program.next_error()
                assert line, "the command ended without the line"
            assert telemetry.last["at"] > 0.0
            assert len(program.daemons()) >= 2, "the session goes on"
            program.send(signal.SIGINT)
            status, output, errors = program.finish()
        recording = read_recording(disk / "a.mcap")
        assert not recording.complete
        assert len(recording.records["master"]) > 100, "readable as far as it went"
        return Ended(status, output, line + errors)
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True, timeout=60)


def begins(folder: Path) -> bool:
    """Whether a recording in a folder has its first records."""
    path = folder / "a.mcap"
    return path.exists() and path.stat().st_size > 50_000


def without_mcap(folder: Path) -> Ended:
    return said("loopback", "--record", "{}/a.mcap", program=BLOCKED.format("mcap"))(folder)


def unwritable_runtime(folder: Path) -> Ended:
    """Where the directory for telemetry would be, there is a file."""
    with TemporaryDirectory(dir="/dev/shm") as login:
        (Path(login) / "weberlink").touch()
        return said("loopback", "--duration", 0, XDG_RUNTIME_DIR=login)(folder)


def without_session(_: Path) -> Ended:
    """The page of the monitor for a session that is not there: other trials have sessions of their own."""
    pytest.importorskip("aiohttp")
    with Program("monitor", "--port", 0, "--session", 2**22 + 1) as program:
        line = program.next_error() + program.next_error()
        program.send(signal.SIGINT)
        status, output, errors = program.finish()
    return Ended(status, output, line + errors)


def two_at_once(_: Path) -> Ended:
    """Two sessions on one host, each with a port of its own."""
    with Program("loopback", *PATIENT, "--json", "-") as first:
        first.engaged("slave")
        with Program("loopback", *PATIENT, "--duration", 1) as second:
            ended = Ended(*second.finish())
        assert first.daemons(), "the first one goes on"
    return ended


TRIALS = {
    # Devices and extras.
    "device not plugged": Trial(
        said(
            "loopback",
            CONFIGS / "phantom-arm.yaml",
            "--set",
            "master.device.port=/dev/ttyACM77",
            "--set",
            "slave.robot={driver: point, workspace_m: 0.3, home_m: [0.19, 0.0, 0.15]}",
        ),
        1,
        "/dev/ttyACM77: there is no such port",
    ),
    "missing extra": Trial(without_mcap, 2, install_line("recording")),
    "missing recording without the extra": Trial(
        said("record", "info", "{}/none.mcap", program=BLOCKED.format("mcap")),
        2,
        "none.mcap: cannot be read: No such file",
    ),
    "missing recording to export": Trial(
        said("record", "export", "{}/none.mcap", "--to", "csv", program=BLOCKED.format("mcap")),
        2,
        "cannot be read: No such file",
    ),
    "missing recording to evaluate": Trial(
        said("study", "evaluate", "{}/none.mcap", program=BLOCKED.format("mcap")),
        2,
        "none.mcap: cannot be read: No such file",
    ),
    "missing ledgers without the extra": Trial(
        said("study", "ratings", "{}/none", program=BLOCKED.format("scipy")), 2, "no such folder"
    ),
    # Where nothing can be written.
    "full disk in a session": Trial(on_full_disk, 1, "recording stopped: No space left on device; the session goes on"),
    "unwritable runtime directory": Trial(unwritable_runtime, 1, "is a file, not a directory; remove it"),
    # Keys and addresses.
    "port in use": Trial(on_taken_port, 1, "in use"),
    "wrong key": Trial(
        lambda folder: two_sides(folder, keys=("a", "b"), seconds=6.0), 1, "are the keys the same on both hosts?"
    ),
    "other configuration there": Trial(
        lambda folder: two_sides(folder, further=("--set", "codec.force.weber=0.2")), 1, "codec.force.weber"
    ),
    # Other sessions, and ends before the end.
    "two sessions at once": Trial(two_at_once, 0, ""),
    "no session to watch": Trial(without_session, 0, "start weberlink loopback"),
    "Ctrl-C at the start": Trial(stopped(at="start"), 0, ""),
    "Ctrl-C in the session": Trial(stopped("--record", "{}/a.mcap", at="middle"), 0, ""),
    "Ctrl-C twice": Trial(stopped("--json", "-", at="end"), 0, ""),
    "Ctrl-C in a simulation": Trial(
        interrupted(
            "simulate", LOOPBACK, "--duration", 3600, "--record", "{}/a.mcap", "--json", "{}/out.json", after=begins
        ),
        130,
        "s of simulated time are done, and in the report",
    ),
    "kill -9 of the master": Trial(killed("master"), 1, "master killed by signal 9"),
    "kill -9 of the slave": Trial(killed("slave"), 1, "slave killed by signal 9"),
}


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trials]:
    """All trials, under way."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        folders = {name: tmp_path_factory.mktemp(name.replace(" ", "_")) for name in TRIALS}
        first = sorted(TRIALS, key=lambda name: name not in LONGEST)
        yield {name: pool.submit(TRIALS[name].run, folders[name]) for name in first}


@pytest.mark.parametrize("name", TRIALS)
def test_trial_ends_with_advice(name: str, trials: Trials) -> None:
    ended, trial = trials[name].result(), TRIALS[name]
    assert ended.status == trial.status, (ended.errors, ended.output[-2000:])
    assert "Traceback" not in ended.errors
    assert "pydantic" not in ended.errors
    told = [line for line in ended.errors.splitlines() if line.startswith("weberlink") and ": note: " not in line]
    if trial.status == 2:
        assert len(ended.errors.splitlines()) == 1, ended.errors
        assert ended.output == ""
    if trial.line:
        report = " ".join(ended.output.split())
        assert trial.line in " ".join(told) or trial.line in report, ended


def test_interrupted_simulation_keeps_its_report(
    trials: dict[str, Future[Ended]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    trials["Ctrl-C in a simulation"].result()
    (folder,) = tmp_path_factory.getbasetemp().glob("Ctrl-C_in_a_simulation0")
    document = json.loads((folder / "out.json").read_text())
    assert (document["interrupted"], document["outcome"]) == (True, "interrupted")
    recording = read_recording(folder / "a.mcap")
    assert recording.complete
    assert len(recording.records["master"]) == round(1e3 * document["duration_s"])


def test_interrupted_session_keeps_its_recording(
    trials: dict[str, Future[Ended]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    trials["Ctrl-C in the session"].result()
    (folder,) = tmp_path_factory.getbasetemp().glob("Ctrl-C_in_the_session0")
    assert read_recording(folder / "a.mcap").complete
