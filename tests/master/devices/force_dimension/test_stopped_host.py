"""A program that drives a device is stopped, killed or held up while it pushes: when the force ends, how it comes back.

Times are those at which the stand-in switches the force off or takes a command without one. It keeps the time limit as
the maker's documentation says that the device does.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.force_dimension.fake import STATE, Devices, FakeDevice
from tests.master.devices.pushing import TICK, Log, Pushing, pushing
from weberlink.geometry.vector import norm

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.031875
"""Time limit of the device."""
STALL_LIMIT_S = 0.1
"""In which the thread of the device ends the force of a loop that stands still, on a busy machine."""
BY_WATCHDOG = 3
FORCE_N = 2.0


@contextmanager
def pushing_at(folder: Path) -> Iterator[tuple[FakeDevice, Pushing]]:
    devices = Devices(folder / "devices")
    device = devices[0].plug()

    def log() -> Log:
        """The commands, and the end by the watchdog."""
        taken = [(at, norm(force)) for at, force in device.log()]
        is_over = device["off_cause"] == BY_WATCHDOG and not device["force_on"]
        return [*taken, (device["off_at"], 0.0)] if is_over else taken

    options, environment = {"library": str(devices.library)}, {STATE: str(devices.state)}
    with pushing("force_dimension", options, (0.0, FORCE_N, 0.0), log, environment) as at:
        yield device, at


def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (device, at):
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.2)
        seen, enabled = len(device.log()), device["enables"]
        assert device["off_cause"] == BY_WATCHDOG
        at.process.send_signal(signal.SIGCONT)
        assert at.rises(seen, 2.0 * TICK)
        assert device["enables"] == enabled + 1


def test_killed_program_has_no_force_and_frees_the_device(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (_, at):
        assert at.zero_after(at.process.kill) <= LIMIT_S
        at.process.wait()
    assert Devices(tmp_path / "devices")[0]["off_cause"] == BY_WATCHDOG
    with pushing_at(tmp_path) as (_, at):
        wait_for(at.pushes)


def test_stalled_loop_ends_force_despite_device_thread(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (device, at):
        assert at.zero_after(at.stall) <= STALL_LIMIT_S
        assert device["force_on"] == 1, "the thread goes on with zero"
        wait_for(at.pushes)


def test_unplugged_device_ends_program_with_reason(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (device, at):
        wait_for(at.pushes)
        device["present"] = 0
        assert "force_dimension: " in (said := at.says())
        assert "communication error" in said
        wait_for(lambda: norm(device.wrench[0]) == 0.0)
