"""Daemons that are stopped or killed while a hand presses against something, on a device without a watchdog."""

import os
import signal
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.apps.emulated import Emulated, norm
from tests.program import Program
from tests.wait import until
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink_devices.haply.device import HaplyDevice

LIMIT_S = 0.1
FILE = """
axes: xy
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: session, silence_ms: 500}}
master:
  device: {{driver: haply_2diy, port: {port}, signs_checked: {checked}}}
  limits: {{device_ms: 5000}}
slave:
  robot: {{driver: point, workspace_m: 0.3}}
  scene: [{{shape: plane, point_m: [0.01, 0, 0], normal: [-1, 0, 0], stiffness_n_m: 200}}]
  limits: {{robot_ms: 500}}
"""
PRESS = "handle.script=[{motion: reach, to_m: [0.02, 0, 0]}, {motion: rest, duration_s: 600}]"


def force(haply: Emulated) -> tuple[float, float]:
    """When, and the force on the hand then [N]."""
    status = haply.status()
    return status["now"], norm(status["force"])


@pytest.mark.realtime(alone=True)
def test_a_master_that_is_stopped_in_contact_goes_on_from_zero_and_is_killed(tmp_path: Path) -> None:
    with Emulated("haply_2diy", tmp_path, PRESS, "handle.tremor_m=0") as haply:
        file = tmp_path / "pressing.yaml"
        file.write_text(FILE.format(port=haply.port, checked=HaplyDevice.fingerprint(HaplyDevice.Options())))
        with Program("loopback", file, "--json", "-") as program:
            pid = program.engaged("master").pid
            until(lambda: force(haply)[1] > 0.5, "a force on the hand")
            for number in (signal.SIGSTOP, signal.SIGKILL):
                sent_at = monotonic()
                os.kill(pid, number)
                assert until(lambda: (seen := force(haply))[1] == 0.0 and seen[0], "no force") - sent_at <= LIMIT_S
                sleep(0.5)
                seen = [force(haply)]
                assert seen[0][1] == 0.0
                if number == signal.SIGSTOP:
                    os.kill(pid, signal.SIGCONT)
                    while seen[-1][1] < 0.5:
                        seen.append(until(lambda: (now := force(haply)) != seen[-1] and now, "another look"))  # noqa: B023
                    for (before, a), (after, b) in pairwise(seen):
                        assert b - a <= 2.0 * (after - before + 0.01) / RAMP_S
