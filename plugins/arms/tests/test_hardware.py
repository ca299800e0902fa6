"""A live session of real drivers with emulated hardware: only processes have ports, kernels and signals."""

from math import hypot
from pathlib import Path

import pytest

from plugins.devices.tests.emulated import Emulated
from tests.program import Program, document
from tests.wait import until
from weberlink.master.devices.polhem.serial_device import PolhemSerialDevice

pytestmark = pytest.mark.realtime
FILE = Path(__file__).parents[1] / "configs" / "phantom-arm.yaml"
GROUND = "scene=[{shape: plane, point_m: [0, 0, 0.15], stiffness_n_m: 400}]"
PRESS = "handle.script=[{motion: press, at_m: [0, 0, 0], depth_m: 0.04, duration_s: 0.3, approach_s: 0.3, hold_s: 600}]"
PATIENT = (  # this is not about a machine that stalls
    *("--set", "master.limits.device_ms=500", "--set", "slave.limits.robot_ms=500", "--set", "link.silence_ms=500"),
    *("--set", "slave.robot.bus_watchdog_ms=1000"),
)
CHECKED = PolhemSerialDevice.fingerprint(PolhemSerialDevice.Options(model="vintage_phantom"))
STILL = [0.0, 0.0, 0.0]


def test_phantom_feels_what_the_arm_touches_until_the_arm_fails(tmp_path: Path) -> None:
    made = Emulated("polhem_serial", tmp_path, PRESS), Emulated("dynamixel", tmp_path, GROUND)  # both start at once
    with made[0] as phantom, made[1] as arm:
        ports = f"master.device.port={phantom.port}", f"slave.robot.port={arm.port}"
        sets = [f"--set={each}" for each in (*ports, f"master.device.signs_checked={CHECKED}")]
        with Program("loopback", FILE, *PATIENT, *sets, "--json", "-") as program:
            program.engaged("slave")
            until(lambda: hypot(*phantom.status()["force"]) > 0.5 < arm.status()["tip_force"][2], "force at both ends")
            arm.say("overload 2")
            status, output, _ = program.finish()
        until(lambda: phantom.status()["force"] == STILL, "no force")
        assert phantom.status()["largest_current_ma"] <= 2000.0
    summary = document(output)
    assert (status, "robot fault: dynamixel" in summary["outcome"]) == (1, True)
    assert summary["force"]["packets"] > 0 < summary["position"]["packets"]
