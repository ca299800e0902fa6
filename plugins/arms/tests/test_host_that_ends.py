"""A process pushes with an arm, and is killed or stopped: what the motors do from then on.

Only a process of its own can be; what a bus watchdog does is in virtual time elsewhere. The process is this file, run
with DRIVER OPTIONS VALUES: the torques of a leader or the angles of a follower, and the options, are JSON.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.hardware.emulator import EMULATORS
from weberlink.master.devices import LEADERS
from weberlink.realtime.process import prepare
from weberlink.slave.robots import FOLLOWERS
from weberlink.testing.serving import PtyDevice
from weberlink.testing.time import TICK, ahead_of_other_work
from weberlink_arms.feetech.arm import SO101

pytestmark = pytest.mark.realtime

WALL_RAD, GOAL_RAD, STIFFNESS_NM_RAD = 0.15, 0.55, 100.0
SETTLES_S, AFTER_S = 0.3, 0.6
"""A follower bounces off the wall at first, and one that ends in a bounce holds the place of its last measurement."""


class Family(NamedTuple):
    """An arm."""

    driver: str  # its name, which is that of its emulator
    axis: int  # that pushes
    push: float  # torque at least, before [N m]
    left: float  # torque at most, after: the dry friction of the gears, and their share of what they gave way
    options: dict[str, Any]  # of the driver: a busy machine does not trip its watchdogs

    @property
    def leads(self) -> bool:
        return self.driver.endswith("leader")


PATIENT = {"rate_hz": 100.0, "timeout_ms": 50.0, "bus_watchdog_ms": 500.0}
FAMILIES = {
    "Koch, XL430": Family("koch_follower", 0, 1.0, 0.2, PATIENT),
    "SO-101": Family("so101_follower", 2, 1.0, 0.2, {"gravity": False, "timeout_ms": 50.0}),
    "SO-101 leader": Family("so101_leader", 0, 0.1, 0.0, {"reconnect_s": 5.0}),
}


@contextmanager
def arm_that_is_led(family: Family, folder: Path) -> Iterator[tuple[list[str], Any]]:
    """A command that pushes with an emulated arm, and this."""
    emulator_class: Any = EMULATORS.load(family.driver)
    wall = {"joint": SO101.axes[family.axis], "angle_rad": WALL_RAD, "stiffness_nm_rad": STIFFNESS_NM_RAD}
    weightless = {"weight": False} if "weight" in emulator_class.Options.model_fields else {}
    emulator = emulator_class(emulator_class.Options.model_validate({"walls": [wall], **weightless}))
    values = [0.0] * 6 if family.leads else list(emulator.angles)
    values[family.axis] = 0.3 if family.leads else GOAL_RAD
    with PtyDevice(emulator, folder / "arm", begin=lambda: prepare(60, lock_memory=False, cpu=None)) as wire:
        options = json.dumps({"port": str(wire.path), **family.options})
        program = "plugins.arms.tests.test_host_that_ends"
        yield [sys.executable, "-m", program, family.driver, options, json.dumps(values)], emulator


@contextmanager
def pushing(family: Family, folder: Path) -> Iterator[tuple[subprocess.Popen[str], Any]]:
    """The process and the emulated arm, once it has pushed for `SETTLES_S`."""
    with ahead_of_other_work(), arm_that_is_led(family, folder) as (command, emulator):
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        try:
            pushes = lasting(lambda: push(emulator, family) > family.push, SETTLES_S)
            until(lambda: pushes() or process.poll() is not None, "the arm to push")
            assert process.poll() is None, process.communicate()[0]
            yield process, emulator
        finally:
            process.kill()
            process.communicate(timeout=PATIENCE)


def push(emulator: Any, family: Family) -> float:
    """Torque on the wall, or of a leader's motor [N m]."""
    return abs(float(emulator.motor_nm[family.axis] if family.leads else min(0.0, emulator.outside_nm[family.axis])))


def lasting(condition: Callable[[], bool], seconds: float) -> Callable[[], bool]:
    """Whether a condition has held for so long."""
    since = monotonic()

    def holds() -> bool:
        nonlocal since
        if not condition():
            since = monotonic()
        return monotonic() - since > seconds

    return holds


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_arm_pushes_on_nothing_afterwards(family: Family, number: int, tmp_path: Path) -> None:
    """A leader is without torque, a follower does not drop; one that was stopped goes on when it is continued."""
    with pushing(family, tmp_path) as (process, emulator):
        process.send_signal(number)
        until(lasting(lambda: push(emulator, family) <= family.left, AFTER_S), "the push to end")
        if number == signal.SIGSTOP:
            assert process.poll() is None
        else:
            until(lambda: process.poll() is not None, "the process to end")
            assert push(emulator, family) <= family.left
        assert {servo.torque_on for servo in emulator.servos} == {not family.leads}
        if number == signal.SIGSTOP and family.driver.startswith("so101"):
            process.send_signal(signal.SIGCONT)
            until(lambda: push(emulator, family) > family.push, "the arm to push again")


def main(driver: str, options: str, values: str) -> None:
    """Push with an arm until it has a fault."""
    prepare(50, lock_memory=False, cpu=None)  # as a session
    arm_class: Any = (LEADERS if driver in LEADERS else FOLLOWERS)[driver]
    with closing(arm_class(arm_class.Options.model_validate_json(options), TICK)) as arm:
        arm.open(monotonic())
        while True:
            arm.command(tuple(json.loads(values)), monotonic())
            arm.latest(monotonic())
            sleep(TICK)


if __name__ == "__main__":
    main(*sys.argv[1:])
