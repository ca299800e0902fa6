"""`weberlink device emulate`: a process with a port, fault commands in, answers out."""

import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import IO, Any

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.apps.emulate import names, run
from weberlink.apps.emulate.fault_commands import WIRE_FAULTS, FaultCommands
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.hardware.umockdev import ADVICE, SYSTEM_PYTHON, WRAPPER, missing
from weberlink.master import emulators as devices
from weberlink.master.devices.polhem.serial_protocol import SerialStatus, SerialStatusReader, encode_currents
from weberlink.slave import emulators as robots
from weberlink.system.configuration import ConfigurationError

REASON = missing()


class Emulation:
    """The command in a process."""

    def __init__(self, process: "subprocess.Popen[str]", out: IO[str]) -> None:
        self.process = process
        self._out = out

    def line(self) -> str:
        return self._out.readline().rstrip("\n")

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def status(self) -> dict[str, Any]:
        self.type("status")
        status: dict[str, Any] = json.loads(self.line())
        return status

    def end(self) -> int:
        return self.process.wait(PATIENCE)


@contextmanager
def emulate(
    name: str,
    folder: Path,
    *,
    link: str | None = None,
    overrides: Sequence[str] = (),
    command: Sequence[str] = (),
    faults: Path | None = None,
) -> Iterator[Emulation]:
    options = [argument for each in overrides for argument in ("--set", each)]
    options += [] if link is None else ["--link", link]
    options += [] if faults is None else ["--faults", str(faults)]
    process = subprocess.Popen(
        [sys.executable, "-m", "weberlink", "device", "emulate", name, *options, "--", *command],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE if command else None,
        text=True,
    )
    try:
        out = process.stderr if command else process.stdout
        assert out is not None
        yield Emulation(process, out)
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
    with emulate("polhem_serial", tmp_path, overrides=["model=woodenhaptics", "handle.seed=4"]) as emulation:
        path = tmp_path / "weberlink-polhem_serial"
        settings = f"master.device: {{driver: polhem_serial, port: {path}}}"
        assert emulation.line() == f"polhem_serial is at {path}; configure it as {settings}"
        port = SerialPort(str(path))
        answer = ask(port, 250)
        assert (answer.model, answer.error) == (3, 0)
        status = emulation.status()
        assert (status["plugged"], status["messages"], status["largest_current_ma"]) == (True, 1, 250.0)

        emulation.type("garbel 3")
        assert emulation.line() == "garbel: unknown; did you mean garble?"
        emulation.type("late soon")
        assert emulation.line().startswith("late: ")
        emulation.type("garble 3")
        emulation.type("late 0.5")
        emulation.type("silent")
        assert emulation.status()["faults"] == {"garble": 3, "late_s": 0.5, "silent": True}
        emulation.type("ok")
        emulation.type("wrong_model 1")
        assert emulation.status()["faults"] == {"garble": 0, "late_s": 0.0, "silent": False}
        assert until(lambda: ask(port, 0).model == 1, "the other model")

        emulation.type("unplug")
        assert emulation.status()["plugged"] is False
        assert not path.is_symlink()
        with pytest.raises(HardwareFault, match="unplugged"):
            ask(port, 0)
        port.close()
        emulation.type("plug")
        emulation.type("plug")
        assert emulation.status()["plugged"] is True
        port = SerialPort(str(path))
        assert ask(port, 0).error == 0
        port.close()

        emulation.process.send_signal(signal.SIGINT)
        assert emulation.end() == 0
        assert not path.is_symlink()


def test_command_ends_the_emulation_and_fifo_gives_faults(tmp_path: Path) -> None:
    fifo, port = tmp_path / "faults", tmp_path / "here"
    command = ["sh", "-c", 'ls "$0" && read answer && test "$answer" = enough && exit 7', "{port}"]
    with emulate("polhem_serial", tmp_path, link="here", command=command, faults=fifo) as emulation:
        assert str(port) in emulation.line()
        assert emulation.process.stdout is not None
        assert emulation.process.stdout.readline() == f"{port}\n"
        with fifo.open("w") as lines:
            lines.write("help\nstatus\n")
        said = [emulation.line()]
        while not said[-1].startswith("{"):
            said.append(emulation.line())
        assert {line.split()[0] for line in said[:-1]} >= {"garble", "unplug", "stuck_encoder", "help"}
        assert json.loads(said[-1])["name"] == "polhem_serial"
        emulation.type("enough")  # standard input is the command's
        assert emulation.end() == 7
    assert not port.is_symlink()
    assert not fifo.exists()


def test_stop_signal_goes_to_the_command(tmp_path: Path) -> None:
    command = ["sh", "-c", "echo up; exec sleep 60"]
    with emulate("haply_2diy", tmp_path, command=command) as emulation:
        assert emulation.process.stdout is not None
        assert emulation.process.stdout.readline() == "up\n"
        emulation.process.send_signal(signal.SIGTERM)
        assert emulation.end() == 128 + signal.SIGTERM
    assert not (tmp_path / "weberlink-haply_2diy").is_symlink()


@pytest.mark.skipif(REASON is not None, reason=str(REASON))
def test_hid_device_is_driven_by_the_command(tmp_path: Path) -> None:
    host = """
import sys
from time import monotonic
from weberlink.hardware.discovery import UsbId, hid_devices
from weberlink.hardware.hid_port import HidPort
from weberlink.master.devices.polhem.hid_protocol import decode_sensors, encode_command

(found,) = hid_devices([UsbId(0x1234, 6)])
port = HidPort(found.path)
port.read_all(monotonic() + 20.0)
places = set()
for number in range(200):
    port.write(encode_command((number, 0, 0), 14))
    places.add(decode_sensors(port.read_all(monotonic() + 20.0)[-1]).counts)
print(found.serial_number, len(places) > 1, flush=True)
sys.stdin.readline()
"""
    fifo = tmp_path / "faults"
    os.mkfifo(fifo)
    with emulate(
        "polhem_hid",
        tmp_path,
        overrides=["frame_s=0", "serial_number='77'"],
        command=[sys.executable, "-c", host],
        faults=fifo,
    ) as emulation:
        assert emulation.line().endswith("configure it as master.device: {driver: polhem_hid, port: /dev/hidraw0}")
        assert emulation.process.stdout is not None
        assert emulation.process.stdout.readline() == "77 True\n"
        fifo.write_text("status\n")
        status = json.loads(emulation.line())
        assert (status["messages"], status["errors"], status["largest_current_ma"]) == (200, 0, 199.0)
        emulation.type("")
        assert emulation.end() == 0
    assert fifo.exists(), "it was there before"


def refused(name: str, **arguments: Any) -> str:
    given: dict[str, Any] = {"link": None, "overrides": [], "command": [], **arguments}
    with pytest.raises(ConfigurationError) as caught:
        run(name, out=io.StringIO(), source=None, **given)
    (line,) = str(caught.value).splitlines()
    return line


def test_wrong_arguments_are_one_line_and_leave_nothing(tmp_path: Path) -> None:
    there, port = tmp_path / "there", tmp_path / "port"
    there.write_text("")
    assert "'polhem_seral'; nearest is 'polhem_serial'" in refused("polhem_seral")
    assert "--set handle.sed: unknown key; did you mean seed?" in refused("polhem_serial", overrides=["handle.sed=1"])
    assert "--set model: " in refused("polhem_serial", overrides=["model=falcon"])
    assert "there: exists already; choose another with --link" in refused("polhem_serial", link=there)
    assert "cannot be created: No such file" in refused("polhem_serial", link=tmp_path / "no" / "port")
    assert "nowhere: cannot be run" in refused("polhem_serial", link=port, command=["nowhere"])
    assert "exists already and is no FIFO" in refused("polhem_serial", link=port, faults=there)
    assert "-- COMMAND" in refused("polhem_hid")
    assert "--link" in refused("polhem_hid", link=port, command=["true"])
    assert list(tmp_path.iterdir()) == [there]


def test_a_folder_that_is_gone_is_one_line(tmp_path: Path) -> None:
    leave = "import os, sys; from weberlink.cli import main; os.rmdir(os.getcwd()); sys.exit(main())"
    folder = tmp_path / "gone"
    folder.mkdir()
    ended = subprocess.run(
        [sys.executable, "-c", leave, "device", "emulate", "polhem_serial"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, len(ended.stderr.splitlines())) == (2, 1), ended.stderr
    assert "polhem_serial: cannot be created: No such file" in ended.stderr


@pytest.mark.skipif(not Path(SYSTEM_PYTHON).exists(), reason="the system has no Python of its own")
def test_a_testbed_that_cannot_be_started_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wrapper = tmp_path / WRAPPER
    wrapper.write_bytes(b"\x7fELF")  # of another processor, as the system says
    wrapper.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "polhem_hid: cannot be plugged in: Exec format error" in refused("polhem_hid", command=["true"])


def test_stale_link_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "port").symlink_to("/dev/pts/999999")
    out = io.StringIO()
    assert run("polhem_serial", tmp_path / "port", [], ["true"], out=out, source=None) == 0
    assert not (tmp_path / "port").is_symlink()


def test_missing_umockdev_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "apt-get install umockdev gir1.2-umockdev-1.0 python3-gi" in refused("polhem_hid", command=["true"])


@pytest.mark.parametrize("name", sorted({**devices.EMULATORS, **robots.EMULATORS}))
def test_every_emulator_has_help_faults_and_status(name: str, tmp_path: Path) -> None:
    table: Any = devices if name in devices.EMULATORS else robots
    emulator_class = table.load(name)
    emulator = emulator_class(emulator_class.Options())
    wire, out = Plugged(), io.StringIO()
    lines = FaultCommands(name, emulator, wire, out)
    lines.execute("help")
    for word in emulator_class.OWN_FAULTS:
        assert f"\n{word} " in out.getvalue()
    out.truncate(0)
    for word in emulator_class.OWN_FAULTS:
        lines.execute(word)
    lines.execute("")
    assert out.getvalue() == ""
    emulator.advance(1.0)
    status = lines.status()
    assert status["name"] == name
    assert len(status) > 6
    json.dumps(status, allow_nan=False)
    assert name in names()


class Plugged:
    """A device that is plugged in."""

    plugged = True

    def plug(self) -> None:
        raise AssertionError

    def unplug(self) -> None:
        raise AssertionError


def test_emulator_page_lists_all_devices_and_common_faults() -> None:
    page = (ROOT / "docs" / "emulators.md").read_text(encoding="utf-8")
    (words,) = re.findall(r"^\| word \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", page, re.M)
    assert {word for row in words.splitlines() for word in re.findall(r"`(\w+)`", row.split("|")[1])} == set(
        WIRE_FAULTS
    )
    listed = re.findall(r"^\| `(\w+)` \| .* \| (serial|HID|evdev|WebSocket) \|$", page, re.M)
    tables: dict[str, Any] = {**dict.fromkeys(devices.EMULATORS, devices), **dict.fromkeys(robots.EMULATORS, robots)}
    assert {name: wire.lower() for name, wire in listed} == {
        name: tables[name].load(name).transport for name in names()
    }
    assert ADVICE.rpartition(": ")[2] in page
