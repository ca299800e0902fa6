"""A program that drives a device is stopped, killed or held up while it pushes: when the force ends, how it comes back.

Times are those at which the stand-in switches the force off or takes a command without one. It keeps the time limit as
the maker's documentation says that the device does.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.force_dimension import host
from tests.master.devices.force_dimension.fake import STATE, Devices, FakeDevice
from weberlink.geometry.vector import norm
from weberlink.master.devices.threaded_device import RAMP_S

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.031875
"""Time limit of the device."""
STALL_LIMIT_S = 0.1
"""In which the thread of the device ends the force of a loop that stands still, on a busy machine."""
BY_WATCHDOG = 3
FORCE_N = 2.0
STEP_N = FORCE_N * 2.0 * host.TICK / RAMP_S
"""The largest one on the way up: what the ramp has in the longest pause between two commands."""


class Host:
    """The program, while it pushes."""

    def __init__(self, device: FakeDevice, process: "subprocess.Popen[str]") -> None:
        self.device = device
        self.process = process

    def pushes(self) -> bool:
        return norm(self.device.wrench[0]) > 0.95 * FORCE_N

    def zero_after(self, deed: Callable[[], None]) -> float:
        """How long after a deed, in the middle of a push, there is no force [s]."""
        wait_for(self.pushes)
        at, sets = monotonic(), int(self.device["sets"])
        deed()
        wait_for(lambda: norm(self.device.wrench[0]) == 0.0)
        if self.device["off_cause"] == BY_WATCHDOG:
            return self.device["off_at"] - at
        return next(when for when, force in self.device.log(sets) if when >= at and norm(force) == 0.0) - at


@contextmanager
def pushing(folder: Path) -> Iterator[Host]:
    devices = Devices(folder / "devices")
    device = devices[0].plug()
    process = subprocess.Popen(
        [sys.executable, "-m", host.__name__, json.dumps({"library": str(devices.library)}), str(FORCE_N)],
        cwd=Path(__file__).parents[4],
        env={**os.environ, STATE: str(devices.state)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield Host(device, process)
    finally:
        process.kill()
        process.communicate()


def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.2)
        seen, enabled = int(at.device["sets"]), at.device["enables"]
        assert at.device["off_cause"] == BY_WATCHDOG
        at.process.send_signal(signal.SIGCONT)
        wait_for(at.pushes)
        assert at.device["enables"] == enabled + 1
        forces = [norm(force) for _, force in at.device.log(seen)]
        assert forces[0] == 0.0
        assert max(b - a for a, b in pairwise(forces)) <= STEP_N * 1.01


def test_killed_program_has_no_force_and_frees_the_device(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(at.process.kill) <= LIMIT_S
        at.process.wait()
    assert Devices(tmp_path / "devices")[0]["off_cause"] == BY_WATCHDOG
    with pushing(tmp_path) as at:
        wait_for(at.pushes)


def test_stalled_loop_ends_force_despite_device_thread(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:

        def stall() -> None:
            assert at.process.stdin is not None
            at.process.stdin.write("0.3\n")
            at.process.stdin.flush()

        assert at.zero_after(stall) <= STALL_LIMIT_S
        assert at.device["force_on"] == 1, "the thread goes on with zero"
        wait_for(at.pushes)


def test_unplugged_device_ends_program_with_reason(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        wait_for(at.pushes)
        at.device["present"] = 0
        assert at.process.stdout is not None
        assert "force_dimension: " in (said := at.process.stdout.readline())
        assert "communication error" in said
        wait_for(lambda: norm(at.device.wrench[0]) == 0.0)
