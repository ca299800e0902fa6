"""Live sessions of real drivers with emulated hardware: only processes have ports, kernels and signals between them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.apps.emulated import Emulated, norm
from tests.program import Program, document
from tests.wait import until
from weberlink.master.devices.polhem.serial_device import PolhemSerialDevice

pytestmark = pytest.mark.realtime
FILE = Path(__file__).parents[1] / "configs" / "phantom-arm.yaml"
GROUND = "scene=[{shape: plane, point_m: [0, 0, 0.15], stiffness_n_m: 400}]"
PRESS = "handle.script=[{motion: press, at_m: [0, 0, 0], depth_m: 0.04, duration_s: 0.3, approach_s: 0.3, hold_s: 600}]"
PATIENT = (
    *("--set", "master.limits.device_ms=500", "--set", "slave.limits.robot_ms=500", "--set", "link.silence_ms=500"),
    *("--set", "slave.robot.bus_watchdog_ms=1000"),
)
"""This is not about a machine that stalls."""
CHECKED = PolhemSerialDevice.fingerprint(PolhemSerialDevice.Options(model="vintage_phantom"))
POINT = "slave.robot={driver: point, workspace_m: 0.3, home_m: [0.19, 0.0, 0.15]}"
STILL = [0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def hardware(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Emulated, Emulated]]:
    """A device in a hand that presses, and an arm over the ground."""
    folder = tmp_path_factory.mktemp("hardware")
    made = Emulated("polhem_serial", folder, PRESS), Emulated("dynamixel", folder, GROUND)  # both start at once
    with made[0] as phantom, made[1] as arm:
        yield phantom, arm


def session(phantom: Emulated, *settings: str) -> Program:
    overrides = (f"master.device.port={phantom.port}", *settings)
    return Program("loopback", FILE, *PATIENT, *(f"--set={each}" for each in overrides), "--json", "-")


def test_without_checked_signs_no_current_and_an_unplugged_device_ends_the_session(
    hardware: tuple[Emulated, Emulated],
) -> None:
    phantom, _ = hardware
    with session(phantom, POINT) as program:
        master = program.engaged("master")
        until(lambda: master.last["updates_sent"] > 0, "the handle to lead")
        assert phantom.status()["largest_current_ma"] == 0.0
        phantom.say("unplug")
        status, output, errors = program.finish()
    phantom.say("plug")
    assert "signs not checked" in errors
    assert (status, "device fault: polhem_serial" in document(output)["outcome"]) == (1, True)


def test_phantom_feels_what_the_arm_touches_until_the_arm_fails(hardware: tuple[Emulated, Emulated]) -> None:
    phantom, arm = hardware
    with session(phantom, f"master.device.signs_checked={CHECKED}", f"slave.robot.port={arm.port}") as program:
        program.engaged("slave")
        until(lambda: norm(phantom.status()["force"]) > 0.5 < arm.status()["tip_force"][2], "force at both ends")
        arm.say("overload 2")
        status, output, _ = program.finish()
    summary = document(output)
    assert (status, "robot fault: dynamixel" in summary["outcome"]) == (1, True)
    assert summary["force"]["packets"] > 0 < summary["position"]["packets"]
    until(lambda: phantom.status()["force"] == STILL, "no force")
    assert phantom.status()["largest_current_ma"] <= 2000.0
