"""Ctrl-C and SIGTERM at any time before a command works: one line or none, and never a traceback."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.packages import install
from tests.system.systems import CONFIGS

ENTRY_POINTS = """
[weberlink.devices]
slow = slow_import:Slow
[weberlink.commands]
slowly = slow_command:slowly
"""
IMPORTS = """
import os


class Now:
    # Python 3.11 makes a RuntimeError of what is raised here.
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), int(os.environ["SIGNAL"]))
        for _ in range(1000):
            pass


class Slow:
    now = Now()
"""
COMMAND = """
import os


def end():
    os.kill(os.getpid(), int(os.environ["SIGNAL"]))
    return int


def slowly(many: "end()" = 1):
    pass
"""
"""Its annotation is read when the program puts its commands together."""


def run(folder: Path, number: signal.Signals, modules: dict[str, str], *arguments: object) -> tuple[int, str]:
    """Exit status as a shell gives it, and standard error; nothing is printed elsewhere."""
    install(folder, "slow", modules, ENTRY_POINTS)
    paths = filter(None, (str(folder), *os.environ.get("PYTHONPATH", "").split(os.pathsep)))
    ended = subprocess.run(
        [sys.executable, "-m", "weberlink", *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "SIGNAL": str(int(number))},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ended.stdout == ""
    return ended.returncode if ended.returncode >= 0 else 128 - ended.returncode, ended.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("command", ["check", "simulate", "loopback", "master"])
def test_signal_while_a_driver_is_imported(command: str, number: signal.Signals, tmp_path: Path) -> None:
    driver = ("--set", "master.device.driver=slow", "--set", "link.security=session")
    status, errors = run(
        tmp_path, number, {"slow_import": IMPORTS, "slow_command": ""}, command, CONFIGS / "loopback.yaml", *driver
    )
    assert (status, errors) == (130, "weberlink: interrupted; nothing was kept\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_before_a_command_begins(number: signal.Signals, tmp_path: Path) -> None:
    status, errors = run(tmp_path, number, {"slow_import": "", "slow_command": COMMAND}, "--version")
    assert (status, errors) == (128 + number, "")
