"""A robot and a person beside it: readings, and then a small slow motion along each axis and back."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from weberlink.apps.device_test.dialog import Dialog
from weberlink.apps.device_test.gauge import Gauge
from weberlink.apps.device_test.outcome import DeviceTestError, described, millimetres, uninterrupted
from weberlink.geometry.vector import Vector, add, distance, norm, scale, subtract
from weberlink.slave.robots.contract import Robot, RobotReading, RobotSpec

WAY_M = 0.01
LEG_S = 1.0
REST_S = 0.5
"""At either end, for a robot to arrive."""
FOLLOWS = 0.5
"""Share of the way that it must go at least: what is less is not it that moved."""
FORCE_CHANGE_N = 5.0
"""A stronger one is a contact; the motion ends there."""


def try_robot(driver: Any, build: Callable[[], Robot], dialog: Dialog) -> None:
    """The whole test of a robot.

    Args:
        driver: its class.
        build: makes the robot.
        dialog: with the person.

    Raises:
        DeviceTestError: something is not as it should be; the robot is left where it is.
        RobotFault: the robot cannot go on.
        Left: the person does not go on.
    """
    robot = build()
    dialog.tell(*described(robot.spec))
    if hasattr(driver, "plugged"):
        dialog.ask("Support the arm if it is limp: it stiffens. Enter opens it: ")
    try:
        robot.open(dialog.now())
        dialog.watch(RobotView(robot), "Enter to go on: ")
        _check_motion(robot, dialog)
    finally:
        with uninterrupted():
            robot.close()


class RobotView:
    """Position, rate and age, and the force where it is sensed."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._gauge = Gauge()
        self._reading: RobotReading | None = None

    def look(self, now: float) -> None:
        self._reading = self._robot.latest(now)
        self._gauge.note(now, self._reading.at, self._reading.sampled_at)

    def lines(self) -> list[str]:
        reading, spec = self._reading, self._robot.spec
        assert reading is not None
        lines = [f"{millimetres(reading.position)}   {self._gauge.in_words()}"]
        if spec.force_sensing:
            newtons, share = spec.force_error
            force = "  ".join(f"{axis} {component:+7.2f}" for axis, component in zip("xyz", reading.force, strict=True))
            lines.append(f"{force} N" + (f"    (+-{newtons:g} N and {share * 100:g} %)" if newtons or share else ""))
        return lines


@dataclass
class Motion:
    """What came of the way out and back along an axis.

    Args:
        way: where it was sent, from where it was [m].
        went_m: how far it went along the way at most [m]; negative for the other direction.
        back_m: how far from the start it ended [m].
        force_change_n: the greatest [N].
    """

    way: Vector
    went_m: float = -inf
    back_m: float = 0.0
    force_change_n: float = 0.0

    @property
    def right(self) -> bool:
        return self.went_m >= FOLLOWS * norm(self.way)


def _check_motion(robot: Robot, dialog: Dialog) -> None:
    """Move by a little along every axis, and back.

    Raises:
        DeviceTestError: it did not follow, or met something.
    """
    spec = robot.spec
    dialog.tell("", f"The motion: {WAY_M * 1e3:g} mm along each axis and back, {LEG_S:g} s each way, from where it is.")
    if not dialog.agrees("Is the way free? Type yes to see it move: "):
        dialog.tell("No motion, then.")
        return
    motions = {axis: _out_and_back(index, robot, dialog) for index, axis in enumerate("xyz") if axis in spec.axes}
    wrong = [axis for axis, motion in motions.items() if not motion.right]
    if wrong:
        raise DeviceTestError(
            f"{spec.name}: does not follow along {', '.join(wrong)}: is it the robot that the file describes?"
        )
    dialog.tell("The motion is right.")


def _out_and_back(index: int, robot: Robot, dialog: Dialog) -> Motion:
    """Along one axis, to the side where there is room."""
    start = robot.latest(dialog.now())
    sign = _side(index, start.position, robot.spec)
    x, y, z = (sign * WAY_M if axis == index else 0.0 for axis in range(3))
    motion = Motion((x, y, z))
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


def _side(index: int, position: Vector, spec: RobotSpec) -> float:
    """+1 or -1, where the workspace goes on for long enough.

    Raises:
        DeviceTestError: on neither side.
    """
    there, lower, upper = (vector[index] for vector in (position, *spec.workspace_m))
    for sign in (1.0, -1.0):
        if lower <= there + sign * WAY_M <= upper:
            return sign
    raise DeviceTestError(
        f"{spec.name}: is at {there * 1e3:.0f} mm along {'xyz'[index]}, outside of its workspace of "
        f"{lower * 1e3:.0f} to {upper * 1e3:.0f} mm: move it into it by hand, or set another workspace"
    )


def _share(elapsed: float) -> float:
    """Of the way, after this time [s]: out by minimum jerk, rest, back, rest."""
    along = elapsed / LEG_S if elapsed < LEG_S + REST_S else (2.0 * LEG_S + REST_S - elapsed) / LEG_S
    share = min(1.0, max(0.0, along))
    return share * share * share * (10.0 + share * (6.0 * share - 15.0))
