"""Daemons that are stopped or killed while a hand presses against something, on a device without a watchdog."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.apps.emulated import Emulated, norm
from tests.program import Program
from tests.wait import until
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink_devices.haply.device import HaplyDevice

pytestmark = pytest.mark.realtime(alone=True)

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


@contextmanager
def pressing(folder: Path) -> Iterator[tuple[Emulated, int]]:
    """A session in contact: the device, and the process id of the master."""
    with Emulated("haply_2diy", folder, PRESS, "handle.tremor_m=0") as haply:
        file = folder / "pressing.yaml"
        file.write_text(FILE.format(port=haply.port, checked=HaplyDevice.fingerprint(HaplyDevice.Options())))
        with Program("loopback", file, "--json", "-") as program:
            master = program.engaged("master")
            until(lambda: force(haply)[1] > 0.5, "a force on the hand")
            yield haply, master.pid


def force(haply: Emulated) -> tuple[float, float]:
    """When, and the force on the hand then [N]."""
    status = haply.status()
    return status["now"], norm(status["force"])


def ends_after(haply: Emulated, pid: int, number: signal.Signals) -> float:
    """At most so long after a signal there is no force [s]."""
    sent_at = monotonic()
    os.kill(pid, number)
    return until(lambda: (seen := force(haply))[1] == 0.0 and seen[0], "no force") - sent_at


def test_a_master_that_is_stopped_in_contact(tmp_path: Path) -> None:
    with pressing(tmp_path) as (haply, pid):
        assert ends_after(haply, pid, signal.SIGSTOP) <= LIMIT_S
        sleep(1.0)
        assert force(haply)[1] == 0.0
        seen = [force(haply)]
        os.kill(pid, signal.SIGCONT)
        while seen[-1][1] < 0.5:
            seen.append(until(lambda: (now := force(haply)) != seen[-1] and now, "another look"))
        for (before, a), (after, b) in pairwise(seen):
            assert b - a <= 2.0 * (after - before + 0.01) / RAMP_S


def test_a_master_that_is_killed_in_contact(tmp_path: Path) -> None:
    with pressing(tmp_path) as (haply, pid):
        assert ends_after(haply, pid, signal.SIGKILL) <= LIMIT_S
        sleep(0.2)
        assert force(haply)[1] == 0.0
