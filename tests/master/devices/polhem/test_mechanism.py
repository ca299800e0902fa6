"""Kinematics, force map, limits and weight of every published mechanism."""

from dataclasses import replace
from itertools import product
from math import acos, cos, hypot, isfinite, pi, radians, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import Vector, distance, dot, norm
from weberlink.master.devices.contract import Quaternion
from weberlink.master.devices.polhem.linkages import GRAVITY_M_S2, SerialParallelogram, SpatialFiveBar
from weberlink.master.devices.polhem.mechanism import Angles, Counts
from weberlink.master.devices.polhem.parameters import PARAMETERS, Board, MechanismParameters

every_set = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)
ORIGIN: Vector = (0.0, 0.0, 0.0)
CLOSED = SpatialFiveBar(0.034, 0.165, 0.025, 0.190, 0.034, 0.1308, (0.2045, 0.0, 0.0325))


def positions(parameters: MechanismParameters, count: int) -> list[Vector]:
    """Random ones within three quarters of the published radius, which all of the mechanisms reach but for corners."""
    random = Random(7)
    found: list[Vector] = []
    while len(found) < count:
        x, y, z = (random.uniform(-1.0, 1.0) for _ in range(3))
        if hypot(x, y, z) > 1.0:
            continue
        edge = 0.75 * parameters.radius_m
        position = (edge * x, edge * y, edge * z)
        linkage = parameters.mechanism.linkage
        if distance(linkage.position(linkage.inverse(position)), position) < 1e-9:
            found.append(position)
    return found


@every_set
def test_the_jacobian_is_the_derivative(parameters: MechanismParameters) -> None:
    linkage, step = parameters.mechanism.linkage, 1e-5
    for position in positions(parameters, 20):
        angles = linkage.inverse(position)
        rows = linkage.jacobian(angles)
        scale = max(abs(entry) for row in rows for entry in row)
        for body in range(3):
            ahead, behind = (linkage.position(moved(angles, body, way)) for way in (step, -step))
            for axis in range(3):
                numeric = (ahead[axis] - behind[axis]) / (2.0 * step)
                assert abs(rows[axis][body] - numeric) < 1e-6 * scale


def moved(angles: Angles, body: int, by: float) -> Angles:
    a, b, c = (angle + by * (number == body) for number, angle in enumerate(angles))
    return (a, b, c)


@every_set
def test_position_and_inverse_undo_each_other(parameters: MechanismParameters) -> None:
    linkage = parameters.mechanism.linkage
    for position in positions(parameters, 20):
        assert distance(linkage.position(linkage.inverse(position)), position) < 1e-12


@every_set
def test_virtual_work_agrees_at_hand_and_motors(parameters: MechanismParameters) -> None:
    """F.dx = tau.dtheta, with the torque taken from the currents and the angle from the counts."""
    drive = replace(parameters.mechanism.drive, motor_directions=parameters.mechanism.drive.encoder_directions)
    mechanism, random = replace(parameters.mechanism, drive=drive), Random(3)
    for position in positions(parameters, 20):
        counts = mechanism.counts_at(position)
        force = (random.uniform(-5, 5), random.uniform(-5, 5), random.uniform(-5, 5))
        currents = mechanism.currents_ma(force, counts)
        for motor in range(3):
            before, after = (stepped(counts, motor, step) for step in (-1, 1))
            way = tuple(a - b for a, b in zip(mechanism.position(after), mechanism.position(before), strict=True))
            turned = 2.0 * 2.0 * pi / drive.counts_per_turn[motor]
            at_motor = currents[motor] * 1e-3 * drive.torque_constant_n_m_a[motor] * turned
            assert at_motor == pytest.approx(dot(force, (way[0], way[1], way[2])), abs=2e-9)


def stepped(counts: Counts, motor: int, step: int) -> Counts:
    a, b, c = (count + step * (number == motor) for number, count in enumerate(counts))
    return (a, b, c)


@every_set
def test_force_and_currents_undo_each_other(parameters: MechanismParameters) -> None:
    mechanism = parameters.mechanism
    for position in positions(parameters, 20):
        counts, force = mechanism.counts_at(position), (1.0, -2.0, 0.5)
        assert distance(mechanism.force(mechanism.currents_ma(force, counts), counts), force) < 1e-9


@every_set
def test_every_pose_is_finite_and_bounded(parameters: MechanismParameters) -> None:
    """Singular ones, and those in which the links would not meet."""
    linkage = parameters.mechanism.linkage
    turns = [0.25 * pi * eighth for eighth in range(-4, 5)]
    worst = 0.0
    for angles in product((0.0, 1.0), turns, turns):
        assert all(map(isfinite, linkage.position(angles)))
        counts = parameters.mechanism.drive.counts(angles)
        currents = parameters.mechanism.currents_ma((1.0, 1.0, 1.0), counts)
        worst = max(worst, *map(abs, currents))
        assert all(map(isfinite, parameters.mechanism.force((1000.0, 1000.0, 1000.0), counts)))
    assert worst < 1e6


@every_set
def test_inverse_out_of_reach_stays_finite(parameters: MechanismParameters) -> None:
    linkage = parameters.mechanism.linkage
    for far in ((10.0, 0.0, 0.0), (0.0, -10.0, 10.0), (0.0, 0.0, -10.0), tuple(-o for o in linkage_origin(linkage))):
        angles = linkage.inverse((far[0], far[1], far[2]))
        assert all(map(isfinite, angles))
        assert norm(linkage.position(angles)) < 1.0


def linkage_origin(linkage: object) -> Vector:
    assert isinstance(linkage, SerialParallelogram | SpatialFiveBar)
    return linkage.origin


def test_woodenhaptics_as_published() -> None:
    mechanism = PARAMETERS["woodenhaptics_2015"].mechanism
    assert mechanism.drive.angles((0, 0, 0)) == pytest.approx((0.0, 0.0, pi / 2))
    assert mechanism.position((0, 0, 0)) == pytest.approx((0.025, 0.0, 0.205))
    per_count = [abs(each) for each in mechanism.drive.radians_per_count]
    assert per_count == pytest.approx([1.96e-4, 2.62e-4, 2.62e-4], rel=2e-3)
    steps = [
        distance(mechanism.position(counts), mechanism.position((0, 0, 0)))
        for counts in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    assert all(33e-6 < step < 76e-6 for step in steps)
    middle = mechanism.counts_at(ORIGIN)
    needed = [max(map(abs, mechanism.currents_ma(force, middle))) for force in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    assert all(300 <= ma <= 900 for ma in needed)


def published_forearm(t2: float, t3: float) -> float:
    """As the makers write it, by three angles at the joint; they are not signed."""
    l0, l1, l2, l3, l4 = 0.034, 0.165, 0.025, 0.190, 0.034
    to_a = hypot(l0 + l1 * cos(t2), l1 * sin(t2))
    to_d = hypot(l0 + l1 * cos(t2) - l2 * cos(t3), l1 * sin(t2) - l2 * sin(t3))
    first = acos((l1**2 - l0**2 + to_a**2) / (2 * l1 * to_a))
    second = acos((l4**2 - l3**2 + to_d**2) / (2 * l4 * to_d))
    third = acos((to_a**2 + to_d**2 - l2**2) / (2 * to_a * to_d))
    return t2 - first - second - third


def test_five_bar_matches_makers_formula() -> None:
    compared = 0
    for t2, t3 in product(range(30, 126, 8), range(100, 240, 10)):
        angles = (0.0, radians(t2), radians(t3))
        joint = (CLOSED.l0 + CLOSED.l1 * cos(angles[1]), CLOSED.l1 * sin(angles[1]))
        crank = (CLOSED.l2 * cos(angles[2]), CLOSED.l2 * sin(angles[2]))
        if crank[0] * joint[1] > crank[1] * joint[0]:
            continue  # the crank is before the line from its pivot to the joint, where their angles have the wrong sign
        try:
            published = published_forearm(*angles[1:])
        except ValueError:
            continue
        difference = CLOSED.forearm(angles) - published
        assert difference == pytest.approx(2.0 * pi * round(difference / (2.0 * pi)), abs=1e-9)
        compared += 1
    assert compared > 50


def turned(by: Quaternion, vector: Vector) -> Vector:
    w, x, y, z = by
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


@pytest.mark.parametrize("name", ["polhem_v1", "polhem_v3", "vintage_phantom"])
def test_straight_gimbal_points_along_the_forearm(name: str) -> None:
    parameters = PARAMETERS[name]
    mechanism = parameters.mechanism
    home = mechanism.drive.gimbal_home_counts
    for position in positions(parameters, 20):
        counts = (*mechanism.counts_at(position), *(-count for count in home))
        orientation = mechanism.orientation(counts)
        assert orientation is not None
        assert hypot(*orientation) == pytest.approx(1.0)
        angles = mechanism.drive.angles((counts[0], counts[1], counts[2]))
        lam = mechanism.linkage.forearm(angles)
        ahead = (cos(angles[0]) * cos(lam), sin(angles[0]) * cos(lam), sin(lam))
        assert turned(orientation, (1.0, 0.0, 0.0)) == pytest.approx(ahead, abs=1e-12)


def test_last_gimbal_axis_rolls_the_handle() -> None:
    """By +count in the API of 2026, by -count in that of 2021: a quarter turn either way."""
    boards: tuple[tuple[Board, float], ...] = (("serial", 1.0), ("hid14", -1.0))
    for board, sign in boards:
        mechanism = PARAMETERS["polhem_v1"].on(board).mechanism
        counts = (*mechanism.counts_at(ORIGIN), 0, 0)
        straight, rolled = mechanism.orientation((*counts, 0)), mechanism.orientation((*counts, 256))
        assert straight is not None
        assert rolled is not None
        assert turned(rolled, (1.0, 0.0, 0.0)) == pytest.approx(turned(straight, (1.0, 0.0, 0.0)), abs=1e-12)
        assert turned(rolled, (0.0, 1.0, 0.0)) == pytest.approx(turned(straight, (0.0, 0.0, sign)), abs=1e-12)


WOODY = PARAMETERS["woodenhaptics_2015"].mechanism
MIDDLE = WOODY.counts_at(ORIGIN)
components = st.floats(-1e6, 1e6)


@examples(40)
@given(
    st.sampled_from(sorted(PARAMETERS)),
    st.tuples(components, components, components),
    st.tuples(*[st.integers(-40_000, 40_000)] * 3),
)
def test_current_limit_holds_everywhere(name: str, force: Vector, counts: Counts) -> None:
    currents = PARAMETERS[name].mechanism.limited_currents_ma(force, counts, 5.0, 1500.0)
    assert all(isfinite(current) and abs(current) <= 1500 for current in currents)


def test_force_within_limits_is_displayed() -> None:
    force = (0.5, -1.0, 2.0)
    assert distance(WOODY.force(WOODY.limited_currents_ma(force, MIDDLE, 5.0, 6000.0), MIDDLE), force) < 5e-3


@pytest.mark.parametrize(("force_n", "current_ma"), [(2.0, 6000.0), (100.0, 800.0)])
def test_limited_force_keeps_its_direction(force_n: float, current_ma: float) -> None:
    currents = WOODY.limited_currents_ma((10.0, -20.0, 40.0), MIDDLE, force_n, current_ma)
    felt = WOODY.force(currents, MIDDLE)
    share = norm(felt) / norm((10.0, -20.0, 40.0))
    assert distance(felt, (10.0 * share, -20.0 * share, 40.0 * share)) < 0.02
    assert norm(felt) <= force_n + 0.02
    assert max(map(abs, currents)) <= current_ma


def test_currents_are_limited_at_the_dead_point() -> None:
    """Forearm and coupler in line: no force at the tip turns the crank, and the Jacobian is unbounded."""
    mechanism = PARAMETERS["polhem_v3"].mechanism
    for degree in range(0, 360, 2):
        counts = mechanism.drive.counts((0.0, 0.9, degree * pi / 180))
        assert max(map(abs, mechanism.limited_currents_ma((5.0, 0.0, 0.0), counts, 5.0, 2000.0))) <= 2000


@pytest.mark.parametrize(("b", "c"), [(0.0, 1.6), (0.4, 1.2), (0.9, 0.5), (-0.2, 2.0)])
def test_parallelogram_weight_is_derivative_of_energy(b: float, c: float) -> None:
    weight = PARAMETERS["woodenhaptics_2015"].mechanism.weight
    assert weight is not None

    def energy(b: float, c: float) -> float:
        return GRAVITY_M_S2 * (0.170 * 0.051 * cos(b) + 0.110 * (0.205 * cos(b) - 0.091 * cos(c)))

    step = 1e-5
    by_b = (energy(b + step, c) - energy(b - step, c)) / (2.0 * step)
    by_c = (energy(b, c + step) - energy(b, c - step)) / (2.0 * step)
    assert weight.torques((0.3, b, c)) == pytest.approx((0.0, by_b, by_c), abs=1e-8)


def published_centres(t2: float, t3: float) -> list[tuple[float, float]]:
    """Centres of mass [m] and masses as hfab_polhem.h computes them, with lambda of the geometry: height and mass."""
    l0, l1, l2, l3, l4 = 0.034, 0.165, 0.025, 0.190, 0.034
    lam = PARAMETERS["polhem_v3"].mechanism.linkage.forearm((0.0, t2, t3))
    joint = (l1 * cos(t2) + l0 / 2, l1 * sin(t2))
    end = (joint[0] - l4 * cos(lam), joint[1] - l4 * sin(lam))
    from_a = hypot(end[0] + l0 / 2, end[1])
    a3 = acos((l2**2 + l3**2 - from_a**2) / (2 * l2 * l3)) - pi

    def turned(angle: float, x: float, y: float) -> tuple[float, float]:
        return (cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y)

    x3, y3 = turned(a3, 0.087765, 0.001978)
    x45, y45 = turned(lam - t2, 0.061701, 0.000576)
    return [
        (turned(t2, 0.030123, 0.000484)[1], 0.15764),
        (turned(t3, -0.004086, 0.001911)[1], 0.07733),
        (turned(t3, x3 + l2, y3)[1], 0.09767),
        (turned(t2, x45 + l1, y45)[1], 0.11265),
    ]


def links_meet(angles: Angles) -> bool:
    _, t2, t3 = angles
    lam = PARAMETERS["polhem_v3"].mechanism.linkage.forearm(angles)
    across = 0.034 + 0.165 * cos(t2) - 0.034 * cos(lam) - 0.025 * cos(t3)
    up = 0.165 * sin(t2) - 0.034 * sin(lam) - 0.025 * sin(t3)
    return abs(hypot(across, up) - 0.190) < 1e-9


def test_five_bar_weight_matches_makers_formula() -> None:
    weight = PARAMETERS["polhem_v3"].mechanism.weight
    assert weight is not None
    compared, step = 0, 1e-4
    for t2, t3 in product(range(50, 126, 15), range(130, 220, 15)):
        angles: Angles = (0.0, radians(t2), radians(t3))
        if not links_meet(angles):
            continue

        def energy(by_2: float, by_3: float, at: Angles = angles) -> float:
            return 9.81 * sum(height * mass for height, mass in published_centres(at[1] + by_2, at[2] + by_3))

        by_2 = (energy(step, 0.0) - energy(-step, 0.0)) / (2.0 * step)
        by_3 = (energy(0.0, step) - energy(0.0, -step)) / (2.0 * step)
        assert weight.torques(angles) == pytest.approx((0.0, by_2, by_3), abs=1e-5)
        compared += 1
    assert compared > 20
