"""Live sessions of real drivers on both sides with emulated hardware."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import sleep

import pytest

from tests.apps.emulated import Emulated, norm
from tests.program import Program, document, faults_of
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.master.devices.polhem.serial_device import PolhemSerialDevice
from weberlink.protocol.keys import generate

pytestmark = pytest.mark.realtime

FILE = CONFIGS / "phantom-arm.yaml"
GROUND = "scene=[{shape: plane, point_m: [0, 0, 0.15], stiffness_n_m: 400}]"
PRESS = "handle.script=[{motion: press, at_m: [0, 0, 0], depth_m: 0.04, duration_s: 0.5, hold_s: 2}]"
PATIENT = (
    *("--set", "master.limits.device_ms=500", "--set", "slave.limits.robot_ms=500", "--set", "link.silence_ms=500"),
    *("--set", "slave.robot.bus_watchdog_ms=1000"),
)
"""This is not about a machine that stalls."""


@contextmanager
def both(folder: Path) -> Iterator[tuple[Emulated, Emulated, list[object]]]:
    """The device, the arm, and the arguments that lead to them; the device may have force."""
    with ExitStack() as stack:
        made = Emulated("polhem_serial", folder, PRESS), Emulated("dynamixel", folder, GROUND)  # both start at once
        phantom, arm = map(stack.enter_context, made)
        checked = PolhemSerialDevice.fingerprint(PolhemSerialDevice.Options(model="vintage_phantom"))
        overrides = [
            f"master.device.port={phantom.port}",
            f"master.device.signs_checked={checked}",
            f"slave.robot.port={arm.port}",
        ]
        yield phantom, arm, [FILE, *PATIENT, *(each for option in overrides for each in ("--set", option))]


def test_phantom_feels_what_the_arm_touches(tmp_path: Path) -> None:
    with both(tmp_path) as (phantom, arm, arguments):
        with Program("loopback", *arguments, "--duration", 5, "--json", "-") as program:
            strongest = touched = 0.0
            program.engaged("slave")
            while program.daemons():
                strongest = max(strongest, norm(phantom.status()["force"]))
                touched = max(touched, arm.status()["tip_force"][2])
                sleep(0.05)
            status, output, errors = program.finish()
        summary = document(output)
        assert (status, summary["outcome"]) == (0, "completed"), errors
        assert faults_of(summary) == {"master": {}, "slave": {}}
        assert strongest > 0.5, "felt"
        assert touched > 0.5, "touched"
        assert summary["force"]["packets"] > 0
        assert summary["position"]["packets"] > 0
        after = phantom.status()
        assert after["force"] == [0.0, 0.0, 0.0]
        assert after["largest_current_ma"] <= 2000.0


@pytest.mark.parametrize(
    ("fault", "reason"), [("unplug", "unplugged"), pytest.param("silent", "does not answer", marks=pytest.mark.hunt)]
)
def test_device_fault_ends_the_session_with_reason(tmp_path: Path, fault: str, reason: str) -> None:
    with both(tmp_path) as (phantom, arm, arguments):
        with Program("loopback", *arguments, "--json", "-") as program:
            program.engaged("master")
            phantom.say(fault)
            status, output, _ = program.finish()
        summary = document(output)
        assert status == 1
        assert "device fault: polhem_serial" in summary["outcome"]
        assert reason in summary["outcome"]
        if fault != "unplug":
            until(lambda: phantom.status()["force"] == [0.0, 0.0, 0.0], "no force")
        assert any(arm.status()["currents"]), "the arm is held up"


def test_robot_fault_ends_the_session_with_reason(tmp_path: Path) -> None:
    with both(tmp_path) as (phantom, arm, arguments):
        with Program("loopback", *arguments, "--json", "-") as program:
            program.engaged("slave")
            arm.say("overload 2")
            status, output, _ = program.finish()
        summary = document(output)
        assert status == 1
        assert "robot fault: dynamixel" in summary["outcome"]
        assert "overload" in summary["outcome"]
        until(lambda: phantom.status()["force"] == [0.0, 0.0, 0.0], "no force")


def test_unchecked_signs_give_no_current(tmp_path: Path) -> None:
    with Emulated("polhem_serial", tmp_path, PRESS) as phantom:
        arguments = [
            FILE,
            *PATIENT,
            "--set",
            f"master.device.port={phantom.port}",
            "--set",
            "slave.robot={driver: point, workspace_m: 0.3, home_m: [0.19, 0.0, 0.15]}",
        ]
        with Program("loopback", *arguments, "--duration", 1, "--json", "-") as program:
            status, output, errors = program.finish()
        assert status == 0, output
        assert "signs not checked; run: weberlink device test polhem_serial" in errors
        assert document(output)["position"]["packets"] > 0
        assert phantom.status()["largest_current_ma"] == 0.0


@pytest.mark.hunt
def test_signal_during_homing_exits_0(tmp_path: Path) -> None:
    with Emulated("polhem_serial", tmp_path, PRESS) as phantom:
        generate(tmp_path / "key")
        link = ["link.slave=127.0.0.1:47999", "link.security=psk", f"link.key_file={tmp_path / 'key'}"]
        overrides = [f"master.device.port={phantom.port}", "master.device.homing=button", *link]
        arguments = [FILE, *(each for option in overrides for each in ("--set", option))]
        with Program("master", *arguments, "--json", "-") as program:
            until(lambda: phantom.status()["messages"] > 0, "the driver to wait for the button")
            program.send(signal.SIGINT)
            status, output, _ = program.finish()
        assert (status, document(output)["outcome"]) == (0, "interrupted")
