"""`weberlink device emulate`: a process with a port, fault commands in, answers out."""

import io
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from plugins.devices.tests.emulated import Emulated
from tests.program import weberlink
from tests.wait import PATIENCE, until
from weberlink.config import ConfigurationError
from weberlink.hardware.emulator import EMULATORS
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.polhem.protocol import Sensors, StatusReader, encode_currents
from weberlink_devices.emulation import FaultCommands, run


def ask(port: SerialPort, current: int) -> Sensors:
    reader = StatusReader()
    port.write(encode_currents((current, 0, 0)))
    deadline = monotonic() + PATIENCE
    while monotonic() < deadline:
        if answers := list(filter(None, reader.feed(port.read(deadline)))):
            return answers[0]
    pytest.fail("no answer")


def test_serial_device_with_fault_commands_until_ctrl_c(tmp_path: Path) -> None:
    with Emulated("polhem_serial", tmp_path, "model=woodenhaptics", "handle.seed=4") as emulated:
        path = Path(emulated.port)
        port = SerialPort(str(path))
        answer, status = ask(port, 250), emulated.status()
        assert (answer.model, answer.error) == (3, 0)
        assert (status["plugged"], status["messages"], status["largest_current_ma"]) == (True, 1, 250.0)
        for wrong in ("garbel 3", "late soon"):
            emulated.say(wrong)
            assert emulated.line().startswith(f"{wrong.split()[0]}: ")
        emulated.say("garble 3\nlate 0.5\nsilent")
        assert emulated.status()["faults"] == {"garble": 3, "late_s": 0.5, "silent": True}
        emulated.say("ok\nwrong_model 1")
        assert emulated.status()["faults"] == {"garble": 0, "late_s": 0.0, "silent": False}
        assert until(lambda: ask(port, 0).model == 1, "the other model")
        emulated.say("unplug")
        assert (emulated.status()["plugged"], path.is_symlink()) == (False, False)
        with pytest.raises(HardwareFault, match="unplugged"):
            ask(port, 0)
        port.close()
        emulated.say("plug\nplug")
        assert emulated.status()["plugged"] is True
        port = SerialPort(str(path))
        assert ask(port, 0).error == 0
        port.close()
        emulated.send(signal.SIGINT)
        until(lambda: not path.is_symlink(), "the port to go")


def test_command_ends_the_emulation_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "here").symlink_to("/dev/pts/999999")  # of an emulation that was killed
    script = 'ls "$0" && read answer && test "$answer" = enough && exit 7'  # standard input is the command's
    command = [sys.executable, "-m", "weberlink", "device", "emulate", "polhem_serial", "--link", "here"]
    ended = subprocess.run(
        [*command, "--", "sh", "-c", script, "{port}"],
        cwd=tmp_path, input="enough\n", capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout) == (7, f"{tmp_path / 'here'}\n")
    assert re.search(r" is at \S+; configure it as master.device: {driver: polhem_serial, port:", ended.stderr)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match="nowhere: cannot be run"):
        run("polhem_serial", None, [], ["nowhere"], out=io.StringIO(), source=None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (("polhem_seral",), "polhem_serial"),
        (("polhem_serial", "--set", "handle.sed=1"), "handle.sed"),
        (("polhem_serial", "--link", "port", "--faults", "/"), "/"),
        (("polhem_hid",), "COMMAND"),
    ],
)
def test_a_wrong_argument_is_one_line_that_names_it(
    arguments: tuple[str, ...], field: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert field in weberlink("device", "emulate", *arguments).complaint()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", sorted(EMULATORS))
def test_every_emulator_has_help_faults_and_status(name: str) -> None:
    emulator_class: Any = EMULATORS.load(name)
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
    assert (out.getvalue(), status["name"], len(status) > 6) == ("", name, True)
