"""`weberlink device emulate`: a process with a port, fault commands in, answers out."""

import io
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.wait import PATIENCE, until
from weberlink.apps.emulate import names, run
from weberlink.apps.emulate.fault_commands import FaultCommands
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.master import emulators as devices
from weberlink.master.devices.polhem.serial_protocol import SerialStatus, SerialStatusReader, encode_currents
from weberlink.slave import emulators as robots
from weberlink.system.configuration import ConfigurationError

TABLES: dict[str, Any] = dict.fromkeys(devices.EMULATORS, devices) | dict.fromkeys(robots.EMULATORS, robots)


class Emulation:
    """The command in a process; what it says is on standard error where it runs a command."""

    def __init__(self, process: "subprocess.Popen[str]", has_command: bool) -> None:
        self.process = process
        self._out = process.stderr if has_command else process.stdout

    def line(self) -> str:
        assert self._out is not None
        return self._out.readline().rstrip("\n")

    def command_line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def type(self, *lines: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("".join(f"{line}\n" for line in lines))
        self.process.stdin.flush()

    def status(self) -> dict[str, Any]:
        self.type("status")
        status: dict[str, Any] = json.loads(self.line())
        return status

    def end(self) -> int:
        return self.process.wait(PATIENCE)


@contextmanager
def emulate(folder: Path, *arguments: object) -> Iterator[Emulation]:
    pipe, has_command = subprocess.PIPE, "--" in arguments
    process = subprocess.Popen(
        [sys.executable, "-m", "weberlink", "device", "emulate", *map(str, arguments)],
        cwd=folder, stdin=pipe, stdout=pipe, stderr=pipe if has_command else None, text=True,
    )  # fmt: skip
    try:
        yield Emulation(process, has_command)
    finally:
        process.kill()
        process.communicate()


def ask(port: SerialPort, current: int) -> SerialStatus:
    reader = SerialStatusReader()
    port.write(encode_currents((current, 0, 0)))
    deadline = monotonic() + PATIENCE
    while monotonic() < deadline:
        if answers := reader.feed(port.read(deadline)):
            return answers[0]
    pytest.fail("no answer")


def test_serial_device_with_fault_commands_until_ctrl_c(tmp_path: Path) -> None:
    path = tmp_path / "weberlink-polhem_serial"
    with emulate(tmp_path, "polhem_serial", "--set", "model=woodenhaptics", "--set", "handle.seed=4") as emulation:
        assert f"at {path}; configure it as master.device: {{driver: polhem_serial, port: {path}}}" in emulation.line()
        port = SerialPort(str(path))
        answer, status = ask(port, 250), emulation.status()
        assert (answer.model, answer.error) == (3, 0)
        assert (status["plugged"], status["messages"], status["largest_current_ma"]) == (True, 1, 250.0)
        for wrong in ("garbel 3", "late soon"):
            emulation.type(wrong)
            assert emulation.line().startswith(f"{wrong.split()[0]}: ")
        emulation.type("garble 3", "late 0.5", "silent")
        assert emulation.status()["faults"] == {"garble": 3, "late_s": 0.5, "silent": True}
        emulation.type("ok", "wrong_model 1")
        assert emulation.status()["faults"] == {"garble": 0, "late_s": 0.0, "silent": False}
        assert until(lambda: ask(port, 0).model == 1, "the other model")
        emulation.type("unplug")
        assert (emulation.status()["plugged"], path.is_symlink()) == (False, False)
        with pytest.raises(HardwareFault, match="unplugged"):
            ask(port, 0)
        port.close()
        emulation.type("plug", "plug")
        assert emulation.status()["plugged"] is True
        port = SerialPort(str(path))
        assert ask(port, 0).error == 0
        port.close()
        emulation.process.send_signal(signal.SIGINT)
        assert (emulation.end(), path.is_symlink()) == (0, False)


def test_command_ends_the_emulation_and_fifo_gives_faults(tmp_path: Path) -> None:
    fifo, port = tmp_path / "faults", tmp_path / "here"
    port.symlink_to("/dev/pts/999999")  # of an emulation that was killed
    script = 'ls "$0" && read answer && test "$answer" = enough && exit 7'
    options = ("--link", "here", "--faults", fifo, "--", "sh", "-c", script, "{port}")
    with emulate(tmp_path, "polhem_serial", *options) as emulation:
        assert str(port) in emulation.line()
        assert emulation.command_line() == f"{port}\n"
        fifo.write_text("status\n")
        assert json.loads(emulation.line())["name"] == "polhem_serial"
        emulation.type("enough")  # standard input is the command's
        assert emulation.end() == 7
    assert (port.is_symlink(), fifo.exists()) == (False, False)


def test_what_cannot_be_run_is_one_line_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match="nowhere: cannot be run"):
        run("polhem_serial", None, [], ["nowhere"], out=io.StringIO(), source=None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", sorted(TABLES))
def test_every_emulator_has_help_faults_and_status(name: str) -> None:
    emulator_class = TABLES[name].load(name)
    emulator, out = emulator_class(emulator_class.Options()), io.StringIO()
    wire: Any = type("Wire", (), {"plugged": True, "plug": None, "unplug": None})()
    lines = FaultCommands(name, emulator, wire, out)
    lines.execute("help")
    assert [word for word in emulator_class.OWN_FAULTS if f"\n{word} " not in out.getvalue()] == []
    out.truncate(0)
    for word in (*emulator_class.OWN_FAULTS, ""):
        lines.execute(word)
    emulator.advance(1.0)
    status = lines.status()
    json.dumps(status, allow_nan=False)
    assert (out.getvalue(), status["name"], len(status) > 6, name in names()) == ("", name, True, True)
