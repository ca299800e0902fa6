"""Test of a robot: readings, then a small slow motion along each axis and back."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from weberlink.apps.device_test.dialog import (
    DeviceTestError,
    Dialog,
    SampleRate,
    described,
    millimetres,
    uninterrupted,
)
from weberlink.geometry.vector import Vector, add, distance, norm, scale, subtract
from weberlink.registry import is_hardware
from weberlink.slave.robots.contract import Robot, RobotReading, RobotSpec

WAY_M = 0.01
LEG_S = 1.0
REST_S = 0.5
"""Pause at either end, for the robot to arrive."""
FOLLOWS = 0.5
"""Least share of the way that counts as following."""
FORCE_CHANGE_N = 5.0
"""A larger change is a contact; the motion ends there."""


def try_robot(driver: Any, build: Callable[[], Robot], dialog: Dialog) -> None:
    """Test a robot.

    Args:
        driver: class of the robot.
        build: makes the robot.
        dialog: with the person.

    Raises:
        DeviceTestError: the test failed; the robot stays where it is.
        RobotFault: the robot failed.
        StoppedByUser: the person stopped.
    """
    robot = build()
    dialog.tell(*described(robot.spec))
    if is_hardware(driver):
        dialog.ask("Support the arm if it is limp: its motors switch on. Press Enter to open it: ")
    try:
        robot.open(dialog.now())
        dialog.watch(RobotView(robot), "Press Enter to continue: ")
        _check_motion(robot, dialog)
    finally:
        with uninterrupted():
            robot.close()


class RobotView:
    """Position, rate, age, and the force if it is sensed."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._rate = SampleRate()
        self._reading: RobotReading | None = None

    def look(self, now: float) -> None:
        self._reading = self._robot.latest(now)
        self._rate.note(now, self._reading.at, self._reading.sampled_at)

    def lines(self) -> list[str]:
        reading, spec = self._reading, self._robot.spec
        assert reading is not None
        lines = [f"{millimetres(reading.position)}   {self._rate.in_words()}"]
        if spec.force_sensing:
            newtons, share = spec.force_error
            force = "  ".join(f"{axis} {component:+7.2f}" for axis, component in zip("xyz", reading.force, strict=True))
            lines.append(f"{force} N" + (f"    (+-{newtons:g} N and {share * 100:g} %)" if newtons or share else ""))
        return lines


@dataclass
class AxisMotion:
    """Result of the motion out and back along an axis.

    Args:
        way: commanded displacement [m].
        went_m: greatest distance along the way [m]; negative for the other direction.
        back_m: final distance from the start [m].
        force_change_n: greatest change of the force [N].
    """

    way: Vector
    went_m: float = -inf
    back_m: float = 0.0
    force_change_n: float = 0.0

    @property
    def right(self) -> bool:
        return self.went_m >= FOLLOWS * norm(self.way)


def _check_motion(robot: Robot, dialog: Dialog) -> None:
    """Move a little along every axis and back. Raises DeviceTestError if it does not follow, or meets something."""
    spec = robot.spec
    dialog.tell("", f"Check of motion: {WAY_M * 1e3:g} mm along each axis and back, {LEG_S:g} s each way.")
    if not dialog.agrees("Is the workspace free? Type yes to move it: "):
        dialog.tell("The motion is not tested.")
        return
    motions = {axis: _out_and_back(index, robot, dialog) for index, axis in enumerate("xyz") if axis in spec.axes}
    wrong = [axis for axis, motion in motions.items() if not motion.right]
    if wrong:
        raise DeviceTestError(
            f"{spec.name}: does not follow along {', '.join(wrong)}; check that the file describes this robot"
        )
    dialog.tell("The motion is right.")


def _out_and_back(index: int, robot: Robot, dialog: Dialog) -> AxisMotion:
    """Move along one axis, in the direction where the workspace has room."""
    start = robot.latest(dialog.now())
    sign = _direction(index, start.position, robot.spec)
    x, y, z = (sign * WAY_M if axis == index else 0.0 for axis in range(3))
    motion = AxisMotion((x, y, z))
    began = dialog.now()

    def tick(now: float) -> None:
        reading = robot.latest(now)
        motion.went_m = max(motion.went_m, sign * (reading.position[index] - start.position[index]))
        motion.back_m = distance(reading.position, start.position)
        motion.force_change_n = max(motion.force_change_n, norm(subtract(reading.force, start.force)))
        if motion.force_change_n > FORCE_CHANGE_N:
            robot.command(reading.position, now)
            raise DeviceTestError(
                f"{robot.spec.name}: met {motion.force_change_n:.1f} N along {'xyz'[index]} and was stopped"
            )
        robot.command(add(start.position, scale(motion.way, _share(now - began))), now)

    dialog.wait(2.0 * (LEG_S + REST_S), tick)
    dialog.tell(
        f"  {'+' if sign > 0.0 else '-'}{'xyz'[index]}: went {motion.went_m * 1e3:.1f} mm, "
        f"came back to within {motion.back_m * 1e3:.1f} mm"
        + (f", force changed by {motion.force_change_n:.2f} N" if robot.spec.force_sensing else "")
    )
    return motion


def _direction(index: int, position: Vector, spec: RobotSpec) -> float:
    """Direction with room in the workspace, +1 or -1. Raises DeviceTestError if there is none."""
    there, lower, upper = (vector[index] for vector in (position, *spec.workspace_m))
    for sign in (1.0, -1.0):
        if lower <= there + sign * WAY_M <= upper:
            return sign
    raise DeviceTestError(
        f"{spec.name}: is at {there * 1e3:.0f} mm along {'xyz'[index]}, outside of its workspace of "
        f"{lower * 1e3:.0f} to {upper * 1e3:.0f} mm: move it inside by hand, or set another workspace"
    )


def _share(elapsed: float) -> float:
    """Share of the way after this time [s]: minimum jerk out, rest, back, rest."""
    along = elapsed / LEG_S if elapsed < LEG_S + REST_S else (2.0 * LEG_S + REST_S - elapsed) / LEG_S
    share = min(1.0, max(0.0, along))
    return share * share * share * (10.0 + share * (6.0 * share - 15.0))
