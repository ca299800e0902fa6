"""Live sessions: the handle of the stand-in presses against a robot's world, and the daemon is stopped or killed."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import radians
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.master.devices.force_dimension.fake import STATE, Devices, FakeDevice
from tests.program import Program
from tests.wait import until
from weberlink.geometry.vector import norm
from weberlink.master.devices.force_dimension.device import ForceDimensionDevice
from weberlink.master.devices.force_dimension.options import ForceDimensionOptions
from weberlink.master.devices.threaded_device import RAMP_S

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.031875
BY_WATCHDOG = 3
PLAIN = {"codec": "{}", "more": "", "tool": ""}
SIX = "{rotation: {torque: {weber: 0.13, floor_nm: 0.005}, orientation: {bound_rad: 0.005}}}"
FILE = """
axes: xyz
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: session, silence_ms: 500}}
codec: {codec}
master:
  device: {{driver: force_dimension, model: {model}, library: {library}, signs_checked: {checked}, {more}}}
  limits: {{device_ms: 5000}}
slave:
  robot: {{driver: point, workspace_m: 0.3, {tool}}}
  scene: [{{shape: plane, stiffness_n_m: 400}}]
  limits: {{robot_ms: 500}}
"""


@contextmanager
def pressing(folder: Path, model: str, type_: int, **parts: str) -> Iterator[tuple[FakeDevice, int]]:
    """A session whose hand presses on a floor: the device, and the process id of the master."""
    devices = Devices(folder / "devices")
    handle = devices[0].plug(type_)
    handle["z"], handle["turned_rad"] = -0.006, radians(20.0)
    checked = ForceDimensionDevice.fingerprint(ForceDimensionOptions.model_validate({"model": model}))
    file = folder / "pressing.yaml"
    file.write_text(FILE.format(**{"model": model, "library": devices.library, "checked": checked, **PLAIN, **parts}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE, str(devices.state))
        with Program("loopback", file, "--json", "-") as program:
            master = program.engaged("master")
            until(lambda: norm(handle.wrench[0]) > 1.5, "a force on the hand")
            yield handle, master.pid


def ends_after(handle: FakeDevice, pid: int, number: signal.Signals) -> float:
    """How long after a signal the device has switched its force off [s]."""
    sent_at = monotonic()
    os.kill(pid, number)
    until(lambda: norm(handle.wrench[0]) == 0.0, "no force")
    assert handle["off_cause"] == BY_WATCHDOG
    return handle["off_at"] - sent_at


@pytest.mark.hunt
def test_master_stopped_then_killed_in_contact(tmp_path: Path) -> None:
    with pressing(tmp_path, "omega.3", 33) as (handle, pid):
        floor = 400.0 * 0.006 / (1.0 + 400.0 * 3e-4)  # the handle yields by 0.3 mm for a newton
        until(lambda: handle.wrench[0] == pytest.approx((0.0, 0.0, floor), rel=0.12, abs=0.02), "what the floor gives")
        assert ends_after(handle, pid, signal.SIGSTOP) <= LIMIT_S
        sleep(0.2)
        seen = int(handle["sets"])
        os.kill(pid, signal.SIGCONT)
        until(lambda: norm(handle.wrench[0]) > 1.5, "the force again")
        forces = [(at, norm(force)) for at, force in handle.log(seen)]
        assert forces[0][1] == 0.0
        for (before, a), (after, b) in pairwise(forces):
            assert b - a <= 2.0 * 2.4 * (after - before + 0.002) / RAMP_S
        assert ends_after(handle, pid, signal.SIGKILL) <= LIMIT_S
        sleep(0.1)
        assert norm(handle.wrench[0]) == 0.0


@pytest.mark.hunt
def test_turned_handle_feels_the_torque_of_its_tool(tmp_path: Path) -> None:
    """A stick of 6 cm, whose lower end alone touches the floor."""
    more = "torque_n_m: 0.2"
    tool = "tool: {points_m: [[0.03, 0, 0], [-0.03, 0, 0]], torque_n_m: 2}"
    with pressing(tmp_path, "lambda.7", 108, codec=SIX, more=more, tool=tool) as (handle, _):
        until(lambda: norm(handle.wrench[1]) > 0.05, "a torque on the hand")
        _, (x, y, z) = handle.wrench
        assert y < -0.05, "that turns the stick flat: it was turned about +y"
        assert norm((x, y, z)) <= 0.2 + 1e-9
        assert abs(y) > 0.99 * norm((x, y, z))
