"""Test of a robot: readings, then a small slow motion along each axis and back."""

from collections.abc import Callable
from math import inf
from typing import Any

from weberlink.cli.device_test.dialog import DeviceTestError, Dialog, View, described, uninterrupted
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
        dialog.watch(View(robot.latest, force_of(robot)), "Press Enter to continue: ")
        _check_motion(robot, dialog)
    finally:
        with uninterrupted():
            robot.close()


def force_of(robot: Robot) -> Callable[[RobotReading], list[str]]:
    """The line on the force of a reading, if the robot senses it."""
    newtons, share = robot.spec.force_error
    error = f"    (+-{newtons:g} N and {share * 100:g} %)" if newtons or share else ""

    def lines(reading: RobotReading) -> list[str]:
        components = zip("xyz", reading.force, strict=True)
        return ["  ".join(f"{axis} {component:+7.2f}" for axis, component in components) + f" N{error}"]

    return lines if robot.spec.force_sensing else lambda _: []


def _check_motion(robot: Robot, dialog: Dialog) -> None:
    """Move a little along every axis and back. Raises DeviceTestError if it does not follow, or meets something."""
    spec = robot.spec
    dialog.tell("", f"Check of motion: {WAY_M * 1e3:g} mm along each axis and back, {LEG_S:g} s each way.")
    if not dialog.agrees("Is the workspace free? Type yes to move it: "):
        dialog.tell("The motion is not tested.")
        return
    position = robot.latest(dialog.now()).position
    signs = {axis: _direction("xyz".index(axis), position, spec) for axis in spec.axes}  # all, before any motion
    went = {axis: _out_and_back("xyz".index(axis), sign, robot, dialog) for axis, sign in signs.items()}
    wrong = [axis for axis, way_m in went.items() if way_m < FOLLOWS * WAY_M]
    if wrong:
        raise DeviceTestError(
            f"{spec.name}: does not follow along {', '.join(wrong)}; check that the file describes this robot"
        )
    dialog.tell("The motion is right.")


def _out_and_back(index: int, sign: float, robot: Robot, dialog: Dialog) -> float:
    """Move along one axis in a direction, +1 or -1; returns the greatest distance along the way [m]."""
    start = robot.latest(dialog.now())
    x, y, z = (sign * WAY_M if axis == index else 0.0 for axis in range(3))
    went_m, back_m, change_n = -inf, 0.0, 0.0
    began = dialog.now()

    def tick(now: float) -> None:
        nonlocal went_m, back_m, change_n
        reading = robot.latest(now)
        went_m = max(went_m, sign * (reading.position[index] - start.position[index]))
        back_m = distance(reading.position, start.position)
        change_n = max(change_n, norm(subtract(reading.force, start.force)))
        if change_n > FORCE_CHANGE_N:
            robot.command(reading.position, now)
            raise DeviceTestError(f"{robot.spec.name}: met {change_n:.1f} N along {'xyz'[index]} and was stopped")
        robot.command(add(start.position, scale((x, y, z), _share(now - began))), now)

    dialog.wait(2.0 * (LEG_S + REST_S), tick)
    dialog.tell(
        f"  {'+' if sign > 0.0 else '-'}{'xyz'[index]}: went {went_m * 1e3:.1f} mm, "
        f"came back to within {back_m * 1e3:.1f} mm"
        + (f", force changed by {change_n:.2f} N" if robot.spec.force_sensing else "")
    )
    return went_m


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
