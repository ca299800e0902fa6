"""A tool of several points: forces and torques that can be worked out by hand, and what a tool must not do."""

from math import cos, pi, radians, sin
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from tests.examples import examples
from weberlink.geometry.rotation import IDENTITY, Quaternion, turned, vector
from weberlink.geometry.vector import ZERO, Vector, add, dot, is_finite, norm, scale, subtract
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.slave.robots.contract import OrientedRobot, RobotReading
from weberlink.slave.robots.point import PointOptions, PointRobot
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.settings import SceneSettings, build

TICK = 0.001
SCENES: TypeAdapter[Any] = TypeAdapter(SceneSettings)
HALF = 0.03
STICK = [[HALF, 0.0, 0.0], [-HALF, 0.0, 0.0]]
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


def held(made: PointRobot, position: Vector, orientation: Quaternion = IDENTITY, ticks: int = 1) -> RobotReading:
    reading = made.latest(0.0)
    for _ in range(ticks):
        now = reading.at + TICK
        made.command(position, now)
        made.point(orientation, now)
        reading = made.latest(now)
    return reading


def test_it_says_that_it_can_be_turned_and_how_strongly() -> None:
    plain = PointRobot(PointOptions(), scene(), TICK)
    assert plain.spec.torque_n_m == 0.0
    assert robot(points=STICK).spec.torque_n_m == 2.0
    assert plain.description() == "the ideal point"
    assert robot().description() == "a rigid tool of 2 points, torque up to 2 N m"
    assert isinstance(robot(), OrientedRobot)


@given(st.floats(0.001, 0.02))
def test_a_stick_that_lies_flat_on_a_plane_presses_with_both_ends_and_without_torque(depth: float) -> None:
    made = robot()
    held(made, (0.01, 0.0, 0.01))
    reading = held(made, (0.01, 0.0, -depth))
    assert reading.force == pytest.approx((0.0, 0.0, 2.0 * STIFFNESS * depth))
    assert reading.torque == pytest.approx(ZERO, abs=1e-12)


@pytest.mark.parametrize("tilt", [-20.0, -5.0, 5.0, 20.0])
def test_a_tilted_stick_stands_on_one_end_and_is_turned_flat(tilt: float) -> None:
    """One end at depth d: f = k d up at r = (+-a cos, 0, -a sin), so the torque about y is -+ a cos k d."""
    made = robot()
    held(made, (0.0, 0.0, 0.05), about((0.0, 1.0, 0.0), tilt))
    lower, depth = abs(HALF * sin(radians(tilt))), 0.004
    reading = held(made, (0.0, 0.0, lower - depth), about((0.0, 1.0, 0.0), tilt))
    side = 1.0 if tilt > 0.0 else -1.0  # a turn about +y lowers the end on +x
    push = STIFFNESS * depth
    assert reading.force == pytest.approx((0.0, 0.0, push))
    assert reading.torque == pytest.approx((0.0, -side * HALF * cos(radians(tilt)) * push, 0.0), abs=1e-12)


@pytest.mark.parametrize("tilt", [1.0, 4.0])
def test_with_both_ends_in_the_plane_it_is_a_torsion_spring(tilt: float) -> None:
    """f = 2 k d whatever the tilt; torque = -2 k a^2 sin cos about the axis of the tilt."""
    made = robot()
    orientation = about((0.0, 1.0, 0.0), tilt)
    held(made, (0.0, 0.0, 0.02), orientation)
    reading = held(made, (0.0, 0.0, -0.01), orientation)
    angle = radians(tilt)
    assert reading.force == pytest.approx((0.0, 0.0, 2.0 * STIFFNESS * 0.01))
    expected = -2.0 * STIFFNESS * HALF * HALF * sin(angle) * cos(angle)
    assert reading.torque == pytest.approx((0.0, expected, 0.0), abs=1e-12)


def test_a_stick_across_the_edge_of_a_box_rests_on_the_box_and_on_the_table() -> None:
    """Level 2 mm below the lid, with its other end 3 mm over the table: one end carries, and turns it."""
    made = robot(
        PLANE, {"shape": "box", "center_m": [0.05, 0.0, 0.0], "size_m": [0.1, 0.1, 0.01], "stiffness_n_m": 800}
    )
    held(made, (0.0, 0.0, 0.02))
    reading = held(made, (0.0, 0.0, 0.003))
    assert reading.force == pytest.approx((0.0, 0.0, 1.6))
    assert reading.torque == pytest.approx((0.0, -HALF * 1.6, 0.0), abs=1e-12)
    level = held(made, (0.0, 0.0, 0.0))  # now the table carries nothing yet, the box more
    assert level.force == pytest.approx((0.0, 0.0, 4.0))
    flat = held(made, (0.0, 0.0, 0.0 - 0.001))
    assert flat.force == pytest.approx((0.0, 0.0, 0.006 * 800 + 0.001 * STIFFNESS))
    assert flat.torque == pytest.approx((0.0, HALF * (0.001 * STIFFNESS - 0.006 * 800), 0.0), abs=1e-12)


def test_each_point_remembers_its_own_friction() -> None:
    """Turned on the plane about the vertical, both ends rub against it: a torque about -z and no force along it."""
    rough = PLANE | {"friction": {"static": 0.4, "dynamic": 0.3}}
    made = robot(rough)
    held(made, (0.0, 0.0, 0.01))
    held(made, (0.0, 0.0, -0.01), ticks=5)
    for step in range(1, 400):
        reading = held(made, (0.0, 0.0, -0.01), about((0.0, 0.0, 1.0), 0.1 * step))
    assert reading.force == pytest.approx((0.0, 0.0, 10.0), abs=0.05)
    assert reading.torque[2] == pytest.approx(-2.0 * HALF * 0.3 * 5.0, rel=0.02)
    assert norm((reading.torque[0], reading.torque[1], 0.0)) < 1e-3


def test_all_points_are_in_the_same_moment_of_a_scene_that_moves() -> None:
    """Laid on a plane that heaves, the stick feels no torque at any time."""
    heaving = PLANE | {"motion": {"amplitude_m": 0.01, "frequency_hz": 1.0}}
    made = robot(heaving, points=[*STICK, [0.0, 0.02, 0.0], [0.0, -0.02, 0.0]])
    held(made, (0.0, 0.0, 0.03))
    for tick in range(2, 2000):
        reading = held(made, (0.0, 0.0, 0.0))
        height = 0.01 * sin(2.0 * pi * tick * TICK)
        assert reading.force[2] == pytest.approx(4.0 * STIFFNESS * max(0.0, height), abs=1e-6)
        assert reading.torque == pytest.approx(ZERO, abs=1e-12)


def test_damping_knows_the_speed_of_each_point() -> None:
    """Turned about y while both ends are in: the one that goes in is pushed harder than at rest, the other less."""
    damped = PLANE | {"damping_n_s_m": 5.0}
    made = robot(damped)
    held(made, (0.0, 0.0, -0.01), ticks=3)
    rate = 0.1  # [rad/s]
    reading = held(made, (0.0, 0.0, -0.01), about((0.0, 1.0, 0.0), rate * TICK * 180.0 / pi))
    stiff = -2.0 * STIFFNESS * HALF * HALF * rate * TICK
    assert reading.torque[1] == pytest.approx(stiff - 2.0 * 5.0 * HALF * HALF * rate, rel=1e-3)


def test_one_point_at_the_tip_is_the_robot_without_a_tool_bit_for_bit() -> None:
    things = (
        PLANE | {"friction": {"static": 0.4, "dynamic": 0.3}, "damping_n_s_m": 1.0},
        {"shape": "sphere", "center_m": [0.0, 0.0, -0.03], "radius_m": 0.04, "stiffness_n_m": 900},
    )
    tool, plain = robot(*things, points=[[0.0, 0.0, 0.0]]), PointRobot(PointOptions(), scene(*things), TICK)
    plain.open(0.0)
    draw, place = Random(3), (0.0, 0.0, 0.02)
    touched = 0
    for tick in range(1, 3000):
        place = add(place, scale((draw.gauss(0, 1), draw.gauss(0, 1), draw.gauss(-0.02, 1)), 0.0005))
        place = (place[0], place[1], max(place[2], -0.02))
        for made in (tool, plain):
            made.command(place, tick * TICK)
        tool.point(about((0.0, 0.6, 0.8), 0.1 * tick), tick * TICK)
        with_tool, without = tool.latest(tick * TICK), plain.latest(tick * TICK)
        assert with_tool.force == without.force
        assert with_tool.position == without.position
        assert with_tool.torque == without.torque == ZERO
        touched += without.force != ZERO
    assert touched > 300


angles = st.floats(-170.0, 170.0)
unit_axes = st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.8, 0.6)])


@examples(50)
@given(unit_axes, angles, st.floats(-0.02, 0.03))
def test_the_torque_is_that_of_the_forces_at_the_points(axis: Vector, angle: float, height: float) -> None:
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


@pytest.mark.parametrize(
    "things",
    [
        (PLANE,),
        (PLANE | {"friction": {"static": 0.4, "dynamic": 0.3}},),
        ({"shape": "sphere", "center_m": [0.01, 0.01, -0.1], "radius_m": 0.1, "stiffness_n_m": 900},),
    ],
    ids=["plane", "rough", "sphere"],
)
def test_no_closed_way_of_the_tool_gains_energy(things: tuple[dict[str, Any], ...]) -> None:
    """The work that the scene does on the tool, f . dx + torque . w dt, over ways there and back."""
    made = robot(*things, points=[*STICK, [0.0, 0.02, -0.01]], force_n=1e3, workspace_m=0.1)
    draw = Random(5)
    for _ in range(10):
        held(made, (0.0, 0.0, 0.05))
        phases = [draw.uniform(0.0, 2.0 * pi) for _ in range(6)]
        axis, height = (0.6, 0.0, 0.8) if draw.random() < 0.5 else (0.0, 1.0, 0.0), draw.uniform(0.0, 0.01)
        work, before = 0.0, held(made, (0.0, 0.0, 0.05))
        place_before, angle_before = (0.0, 0.0, 0.05), 0.0
        steps = 2000
        for step in range(1, steps + 1):
            turn = 2.0 * pi * step / steps
            down = 0.5 * (1.0 - cos(turn))
            place = (
                0.01 * down * sin(2.0 * turn + phases[0]),
                0.01 * down * sin(turn + phases[1]),
                0.05 - (0.05 + height) * down,
            )
            angle = 40.0 * down * sin(turn + phases[2])
            reading = held(made, place, about(axis, angle))
            f, t = scale(add(before.force, reading.force), 0.5), scale(add(before.torque, reading.torque), 0.5)
            work += dot(f, subtract(place, place_before)) + dot(t, axis) * radians(angle - angle_before)
            before, place_before, angle_before = reading, place, angle
        assert reading.force == ZERO
        assert work < 1e-5, "[J]"


@pytest.mark.parametrize("delay", [1, 3])
def test_a_hand_that_presses_a_stick_askew_rests_where_hand_and_plane_are_in_balance(delay: int) -> None:
    """Both ends in: k_hand (meant - turned) = 2 k a^2 sin cos of the turn, and 2 k depth = k_hand' (meant - depth)."""
    meant = radians(12.0)
    script = [{"motion": "reach", "to_m": [0.0, 0.0, -0.03], "turn_deg": [0.0, 12.0, 0.0], "duration_s": 1.0}]
    calm: dict[str, Any] = {"tremor_m": 0.0, "wrist": {"tremor_rad": 0.0}}
    hand = OperatorDevice(OperatorOptions(script=script, repeat=False, **calm), TICK)
    hand.open(0.0)
    made, late = robot(), [(ZERO, ZERO)] * delay
    for tick in range(1, 3001):
        now = tick * TICK
        reading = hand.latest(now)
        assert reading.orientation is not None
        made.command(reading.position, now)
        made.point(reading.orientation, now)
        felt = made.latest(now)
        late.append((felt.force, felt.torque))
        hand.command(late[-1 - delay][0], now)
        hand.turn(late[-1 - delay][1], now)
    turn = vector(reading.orientation)
    rest = meant
    for _ in range(100):
        rest = meant - 2.0 * STIFFNESS * HALF * HALF * sin(rest) * cos(rest) / 2.0
    assert turn == pytest.approx((0.0, rest, 0.0), abs=1e-4)
    depth = 0.03 * 300.0 / (300.0 + 2.0 * STIFFNESS)
    assert reading.position == pytest.approx((0.0, 0.0, -depth), abs=1e-5)
    assert depth > HALF * sin(rest), "both ends are in"
    assert felt.torque[1] == pytest.approx(2.0 * (rest - meant), abs=1e-4)


def test_the_sensors_saturate_at_their_ranges_each_for_itself() -> None:
    made = PointRobot(PointOptions(tool={"points_m": STICK, "torque_n_m": 0.05}, force_n=3.0), scene(), TICK)
    made.open(0.0)
    tilted = about((0.0, 1.0, 0.0), 30.0)
    held(made, (0.0, 0.0, 0.05), tilted)
    reading = held(made, (0.0, 0.0, 0.0), tilted)
    assert reading.force == pytest.approx((0.0, 0.0, 3.0))
    assert reading.torque == pytest.approx((0.0, -0.05, 0.0))


@pytest.mark.parametrize("place", [1e9, -1e9, 1e15, -1e200])
def test_absurd_places_give_finite_readings(place: float) -> None:
    made = robot()
    for position in ((0.0, 0.0, place), (place, place, place), (0.0, 0.0, 0.03)):
        reading = held(made, position, about((0.0, 1.0, 0.0), 123.0))
        assert is_finite(reading.force)
        assert is_finite(reading.torque)
        assert norm(reading.torque) <= made.spec.torque_n_m * (1 + 1e-12)
    assert reading.force == ZERO


NONE = [(0.0,) * 4, (float("nan"), 0.0, 0.0, 0.0), (float("inf"), 0.0, 0.0, 0.0)]


@pytest.mark.parametrize("orientation", NONE)
def test_an_orientation_that_is_none_is_our_own_error(orientation: Quaternion) -> None:
    made = robot()
    with pytest.raises(ValueError, match="point: commanded an orientation that is none"):
        made.point(orientation, TICK)
    held(made, (0.0, 0.0, 0.01))
    assert held(made, (0.0, 0.0, -0.01)).torque == pytest.approx(ZERO, abs=1e-12), "what was held before still is"


def test_a_second_session_begins_level_and_touches_nothing() -> None:
    made = robot(PLANE | {"friction": {"static": 0.4, "dynamic": 0.3}})
    readings = []
    for _ in range(2):
        made.open(0.0)
        held(made, (0.0, 0.0, 0.0301))
        way = [((1e-4 * step, 0.0, 0.01 - 2e-4 * step), about((0.6, 0.0, 0.8), step)) for step in range(100)]
        readings.append([held(made, *place) for place in way])
        made.close()
    assert readings[0] == readings[1]
    assert any(reading.torque[2] != 0.0 for reading in readings[0])
    made.open(0.0)
    made.command((0.0, 0.0, -0.001), TICK)
    assert made.latest(TICK).torque == pytest.approx(ZERO, abs=1e-12), "level until it is told otherwise"


def test_a_tool_in_free_space_feels_nothing() -> None:
    made = PointRobot(PointOptions(tool={"points_m": STICK}), None, TICK)
    made.open(0.0)
    reading = held(made, (0.0, 0.0, -0.05), about((0.0, 1.0, 0.0), 20.0))
    assert reading.force == reading.torque == ZERO


@pytest.mark.parametrize("tool", [{}, {"points_m": []}, {"points_m": [[0, 0]]}, {"points_m": STICK, "torque_n_m": 0}])
def test_a_wrong_tool_is_refused_by_name(tool: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="tool"):
        PointOptions(tool=tool)
