"""A tool of several points: forces and torques that can be worked out by hand, and what a tool must not do."""

from math import cos, inf, nan, radians, sin
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from tests.examples import examples
from weberlink.geometry.rotation import Quaternion, turned
from weberlink.geometry.vector import ZERO, Vector, add, scale
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.point import PointOptions, PointRobot
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.settings import SceneSettings, build

TICK = 0.001
SCENES: TypeAdapter[Any] = TypeAdapter(SceneSettings)
STICK = [[0.03, 0.0, 0.0], [-0.03, 0.0, 0.0]]
STIFFNESS = 500.0
PLANE = {"shape": "plane", "stiffness_n_m": STIFFNESS}


def scene(*things: dict[str, Any]) -> Scene:
    return build(SCENES.validate_python(list(things or (PLANE,))))


def robot(*things: dict[str, Any], points: Any = STICK, **options: Any) -> PointRobot:
    made = PointRobot(PointOptions(tool={"points_m": points}, **options), scene(*things), TICK)
    made.open(0.0)
    return made


def about(axis: Vector, degrees: float) -> Quaternion:
    half = radians(degrees) / 2.0
    return (cos(half), *scale(axis, sin(half)))


def held(made: PointRobot, position: Vector, orientation: Quaternion) -> RobotReading:
    now = made.latest(0.0).at + TICK
    made.command(position, now)
    made.point(orientation, now)
    return made.latest(now)


angles = st.floats(-170.0, 170.0)
unit_axes = st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.8, 0.6)])


@examples(50)
@given(unit_axes, angles, st.floats(-0.02, 0.03))
def test_torque_is_that_of_forces_at_points(axis: Vector, angle: float, height: float) -> None:
    """Against one plain robot per point, each on a scene of its own."""
    points = [(0.02, 0.01, -0.01), (-0.02, 0.0, 0.0), (0.0, -0.03, 0.01)]
    sphere = {"shape": "sphere", "center_m": [0.01, 0.0, -0.02], "radius_m": 0.03, "stiffness_n_m": 700}
    made = robot(PLANE, sphere, points=points, force_n=1e3)
    orientation, tip = about(axis, angle), (0.005, -0.003, height)
    force = torque = ZERO
    held(made, (0.0, 0.0, 0.05), orientation)
    reading = held(made, tip, orientation)
    for point in points:
        lever = turned(orientation, point)
        single = scene(PLANE, sphere)
        single.force(add((0.0, 0.0, 0.05), lever), TICK)
        f = single.force(add(tip, lever), TICK)
        force = add(force, f)
        torque = add(torque, cross(lever, f))
    assert reading.force == pytest.approx(force, abs=1e-9)
    assert reading.torque == pytest.approx(torque, abs=1e-9)


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@pytest.mark.parametrize("orientation", [(0.0,) * 4, (nan, 0.0, 0.0, 0.0), (inf, 0.0, 0.0, 0.0)])
def test_invalid_orientation_is_a_value_error(orientation: Quaternion) -> None:
    made = robot()
    with pytest.raises(ValueError, match="point: commanded an orientation that is none"):
        made.point(orientation, TICK)
