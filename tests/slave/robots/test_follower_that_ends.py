"""A process pushes with a follower arm on a wall, and is ended, killed or stopped: what the motors do from then on."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.hardware.emulator import PtyDevice
from weberlink.slave import emulators

pytestmark = pytest.mark.realtime(alone=True)

WALL_RAD, GOAL_RAD, STIFFNESS_NM_RAD = 0.15, 0.55, 100.0
AFTER_S = 1.0
PROGRAM = "tests.slave.robots.pushing_follower"
SERVOS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


class Family(NamedTuple):
    """A follower.

    Args:
        driver: its name, which is that of its emulator.
        axis: that pushes.
        push: torque on the wall at least, before [N m].
        left: torque on the wall at most, after: the dry friction of the gears, and their share of what they gave way.
        options: of the driver: a busy machine does not trip its watchdogs.
    """

    driver: str
    axis: int
    push: float
    left: float
    options: dict[str, Any]


PATIENT = {"rate_hz": 100.0, "timeout_ms": 50.0, "bus_watchdog_ms": 500.0}
FAMILIES = {
    "Koch, motor with a goal current": Family("koch_follower", 2, 0.3, 0.02, PATIENT),
    "Koch, XL430": Family("koch_follower", 0, 1.0, 0.2, PATIENT),
    "SO-101": Family("so101_follower", 2, 1.0, 0.2, {"gravity": False, "timeout_ms": 50.0}),
}


@contextmanager
def pushing(family: Family, folder: Path) -> Iterator[tuple[subprocess.Popen[str], Any]]:
    """The process and the emulated arm, once it pushes."""
    emulator_class: Any = emulators.load(family.driver)
    wall = {"joint": SERVOS[family.axis], "angle_rad": WALL_RAD, "stiffness_nm_rad": STIFFNESS_NM_RAD}
    weightless = {"weight": False} if "weight" in emulator_class.Options.model_fields else {}
    emulator = emulator_class(emulator_class.Options.model_validate({"walls": [wall], **weightless}))
    goal = list(emulator.angles)
    goal[family.axis] = GOAL_RAD
    with PtyDevice(emulator, folder / "arm") as wire:
        options = json.dumps({"port": str(wire.path), **family.options})
        command = [sys.executable, "-m", PROGRAM, family.driver, options, json.dumps(goal)]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        try:
            until(lambda: push(emulator, family) > family.push or process.poll() is not None, "the arm to push")
            assert process.poll() is None, process.communicate()[0]
            yield process, emulator
        finally:
            process.kill()
            process.communicate(timeout=PATIENCE)


def push(emulator: Any, family: Family) -> float:
    """Torque on the wall [N m]."""
    return -float(emulator.outside_nm[family.axis])


def pushes_no_more(emulator: Any, family: Family) -> Callable[[], bool]:
    """A condition that holds once the arm has not pushed for `AFTER_S`."""
    pushed_at = monotonic()

    def holds() -> bool:
        nonlocal pushed_at
        if push(emulator, family) > family.left:
            pushed_at = monotonic()
        return monotonic() - pushed_at > AFTER_S

    return holds


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_arm_pushes_on_nothing_afterwards(family: Family, number: int, tmp_path: Path) -> None:
    with pushing(family, tmp_path) as (process, emulator):
        process.send_signal(number)
        until(pushes_no_more(emulator, family), "the push to end")
        assert (process.poll() is None) is (number == signal.SIGSTOP)
        assert all(servo.torque_on for servo in emulator.servos), "it does not drop"


def test_stopped_process_pushes_again_when_it_is_continued(tmp_path: Path) -> None:
    family = FAMILIES["SO-101"]
    with pushing(family, tmp_path) as (process, emulator):
        process.send_signal(signal.SIGSTOP)
        until(pushes_no_more(emulator, family), "the push to end")
        process.send_signal(signal.SIGCONT)
        until(lambda: push(emulator, family) > family.push, "the arm to push again")
