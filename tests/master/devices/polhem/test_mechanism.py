"""Laws of the mechanisms, over random poses of every published set, and the vectors that are published."""

from dataclasses import replace
from itertools import product
from math import cos, degrees, hypot, inf, isfinite, pi, radians, sin
from random import Random

import pytest

from weberlink.geometry.vector import Vector, distance, dot, norm
from weberlink.master.devices.contract import Quaternion
from weberlink.master.devices.polhem.drive import Angles, Counts, Drive
from weberlink.master.devices.polhem.five_bar import FiveBar
from weberlink.master.devices.polhem.linkage import SerialParallelogram
from weberlink.master.devices.polhem.mechanism import Mechanism
from weberlink.master.devices.polhem.parameters import PARAMETERS, Board, Parameters

every_set = pytest.mark.parametrize("parameters", PARAMETERS.values(), ids=PARAMETERS)
ORIGIN: Vector = (0.0, 0.0, 0.0)
CLOSED = FiveBar(0.034, 0.165, 0.025, 0.190, 0.034, 0.1308, (0.2045, 0.0, 0.0325))


def positions(parameters: Parameters, count: int) -> list[Vector]:
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
def test_most_of_the_workspace_is_within_reach(parameters: Parameters) -> None:
    linkage = parameters.mechanism.linkage
    edge = 0.75 * parameters.radius_m / 3**0.5
    corners = [(edge * x, edge * y, edge * z) for x, y, z in product((-1, -0.5, 0, 0.5, 1), repeat=3)]
    reached = [distance(linkage.position(linkage.inverse(corner)), corner) < 1e-9 for corner in corners]
    assert sum(reached) >= 0.75 * len(reached)


@every_set
def test_the_jacobian_is_the_derivative(parameters: Parameters) -> None:
    linkage, step = parameters.mechanism.linkage, 1e-5
    for position in positions(parameters, 60):
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
def test_position_and_inverse_undo_each_other(parameters: Parameters) -> None:
    linkage = parameters.mechanism.linkage
    for position in positions(parameters, 60):
        assert distance(linkage.position(linkage.inverse(position)), position) < 1e-12


@every_set
def test_counts_come_back_from_their_position(parameters: Parameters) -> None:
    mechanism = parameters.mechanism
    for position in positions(parameters, 60):
        counts = mechanism.counts_at(position)
        assert mechanism.counts_at(mechanism.position(counts)) == counts
        assert distance(mechanism.position(counts), position) < 2e-4


@every_set
def test_the_home_pose_comes_back_too(parameters: Parameters) -> None:
    mechanism = parameters.mechanism
    back = mechanism.counts_at(mechanism.position((0, 0, 0)))
    assert max(map(abs, back)) <= 1
    assert norm(mechanism.position((0, 0, 0))) < parameters.reach_m


@every_set
def test_virtual_work_is_the_same_at_the_hand_and_at_the_motors(parameters: Parameters) -> None:
    """F.dx = tau.dtheta, with the torque taken from the currents and the angle from the counts."""
    drive = replace(parameters.mechanism.drive, motor_directions=parameters.mechanism.drive.encoder_directions)
    mechanism, random = replace(parameters.mechanism, drive=drive), Random(3)
    for position in positions(parameters, 40):
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
def test_force_and_currents_undo_each_other(parameters: Parameters) -> None:
    mechanism = parameters.mechanism
    for position in positions(parameters, 60):
        counts, force = mechanism.counts_at(position), (1.0, -2.0, 0.5)
        assert distance(mechanism.force(mechanism.currents_ma(force, counts), counts), force) < 1e-9


@every_set
def test_every_pose_is_finite_and_bounded(parameters: Parameters) -> None:
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
def test_out_of_reach_is_the_end_of_the_reach(parameters: Parameters) -> None:
    linkage = parameters.mechanism.linkage
    for far in ((10.0, 0.0, 0.0), (0.0, -10.0, 10.0), (0.0, 0.0, -10.0), tuple(-o for o in linkage_origin(linkage))):
        angles = linkage.inverse((far[0], far[1], far[2]))
        assert all(map(isfinite, angles))
        assert norm(linkage.position(angles)) < 1.0


def linkage_origin(linkage: object) -> Vector:
    assert isinstance(linkage, SerialParallelogram | FiveBar)
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


def test_the_home_pose_of_the_phantom_has_the_upper_arm_level_and_the_forearm_hanging() -> None:
    mechanism = PARAMETERS["vintage_phantom"].mechanism
    a, b, c = mechanism.drive.angles((0, 0, 0))
    assert (a, c) == (0.0, 0.0)
    assert b == pytest.approx(pi / 2, abs=1e-3)
    assert mechanism.position((0, 0, 0)) == pytest.approx((0.0, 0.0, -0.015), abs=2e-4)


@pytest.mark.parametrize("name", ["polhem_v2", "polhem_v3"])
def test_the_home_pose_of_the_polhem_is_the_same_in_both_sets(name: str) -> None:
    """Other capstans and other home counts, hence the same angles."""
    angles = PARAMETERS[name].mechanism.drive.angles((0, 0, 0))
    assert [degrees(angle) for angle in angles] == pytest.approx([120.4, 124.8, 238.5], abs=0.3)


def test_motor_a_of_2019_needs_a_twelfth() -> None:
    old, new = (PARAMETERS[f"woodenhaptics_{year}"].mechanism for year in (2015, 2019))
    force, counts = (0.0, 1.0, 0.0), (0, 0, 0)
    assert abs(old.currents_ma(force, counts)[0] / new.currents_ma(force, counts)[0]) == pytest.approx(12.4, abs=0.1)


@pytest.mark.parametrize(
    ("directions", "home_c"),
    [((-1, -1, -1), -6000), ((1, 1, 1), 6000), ((1, -1, -1), -6000)],
    ids=["older driver", "its successor", "serial"],
)
def test_the_three_published_sign_conventions_say_the_same_pose(directions: Counts, home_c: int) -> None:
    """Each with counters that turn its own way: raw, offset minus raw, and with motor A the other way round."""
    reference = PARAMETERS["woodenhaptics_2015"].mechanism
    angles = (0.3, 0.2, 1.9)
    drive = replace(
        reference.drive, encoder_directions=directions, motor_directions=directions, home_counts=(0, 0, home_c)
    )
    raw = drive.counts(angles)
    assert [count * sign for count, sign in zip(raw, directions, strict=True)] == pytest.approx(
        [0.3 / 1.9635e-4, 0.2 / 2.618e-4, (1.9 - pi / 2) / 2.618e-4], abs=2
    )
    mechanism = Mechanism(drive, reference.linkage)
    assert distance(mechanism.position(raw), reference.linkage.position(angles)) < 1e-4
    # The force is the same too: each current turns its motor the way in which the encoder there counts.
    torques = drive.torques(mechanism.currents_ma((1.0, 2.0, 3.0), raw))
    expected = reference.drive.torques(reference.currents_ma((1.0, 2.0, 3.0), reference.drive.counts(angles)))
    assert torques == pytest.approx(expected, rel=1e-3)


def test_a_wrong_direction_is_a_wrong_pose() -> None:
    right = PARAMETERS["woodenhaptics_2015"]
    wrong = replace(right.mechanism, drive=replace(right.mechanism.drive, encoder_directions=(1, 1, -1)))
    counts = right.mechanism.counts_at((0.03, 0.02, -0.05))
    assert distance(wrong.position(counts), (0.03, 0.02, -0.05)) > 0.05


def test_a_wrong_direction_of_a_motor_is_a_wrong_force_in_the_right_place() -> None:
    right = PARAMETERS["woodenhaptics_2015"].mechanism
    wrong = replace(right, drive=replace(right.drive, motor_directions=(-1, -1, -1)))
    counts = right.counts_at((0.03, 0.02, -0.05))
    assert wrong.position(counts) == right.position(counts)
    mine, theirs = (each.currents_ma((1.0, 2.0, 3.0), counts) for each in (wrong, right))
    assert mine == (-theirs[0], theirs[1], theirs[2])


def published_forearm(t2: float, t3: float) -> float:
    """As the makers write it, by three angles at the joint; they are not signed."""
    from math import acos  # noqa: PLC0415

    l0, l1, l2, l3, l4 = 0.034, 0.165, 0.025, 0.190, 0.034
    to_a = hypot(l0 + l1 * cos(t2), l1 * sin(t2))
    to_d = hypot(l0 + l1 * cos(t2) - l2 * cos(t3), l1 * sin(t2) - l2 * sin(t3))
    first = acos((l1**2 - l0**2 + to_a**2) / (2 * l1 * to_a))
    second = acos((l4**2 - l3**2 + to_d**2) / (2 * l4 * to_d))
    third = acos((to_a**2 + to_d**2 - l2**2) / (2 * to_a * to_d))
    return t2 - first - second - third


def test_the_five_bar_is_built_as_its_makers_build_it() -> None:
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


def test_the_links_of_the_five_bar_keep_their_lengths() -> None:
    for position in positions(PARAMETERS["polhem_v3"], 30):
        angles = CLOSED.inverse(position)
        _, t2, t3 = angles
        lam = CLOSED.forearm(angles)
        joint = (CLOSED.l0 / 2 + CLOSED.l1 * cos(t2), CLOSED.l1 * sin(t2))
        end = (joint[0] - CLOSED.l4 * cos(lam), joint[1] - CLOSED.l4 * sin(lam))
        crank = (-CLOSED.l0 / 2 + CLOSED.l2 * cos(t3), CLOSED.l2 * sin(t3))
        assert hypot(end[0] - crank[0], end[1] - crank[1]) == pytest.approx(CLOSED.l3, abs=1e-12)


def turned(by: Quaternion, vector: Vector) -> Vector:
    w, x, y, z = by
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


@pytest.mark.parametrize("name", ["polhem_v1", "polhem_v3", "vintage_phantom"])
def test_with_the_gimbal_straight_the_handle_points_along_the_forearm(name: str) -> None:
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


def test_the_forearm_of_the_serial_linkage_points_where_its_end_is() -> None:
    linkage = SerialParallelogram(0.08, 0.205, 0.245, ORIGIN)
    angles = (0.0, 0.4, 1.2)
    elbow = (0.205 * sin(0.4), 0.0, 0.08 + 0.205 * cos(0.4))
    tip, lam = linkage.position(angles), linkage.forearm(angles)
    assert distance(tip, (elbow[0] + 0.245 * cos(lam), 0.0, elbow[2] + 0.245 * sin(lam))) < 1e-12


def test_the_last_axis_of_the_gimbal_rolls_the_handle() -> None:
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


@pytest.mark.parametrize("name", ["woodenhaptics_2015", "aluhaptics_v2", "vintage_phantom_2021"])
def test_there_is_no_orientation_without_its_sensors(name: str) -> None:
    assert PARAMETERS[name].mechanism.orientation((0,) * 6) is None


def test_three_counts_have_no_orientation() -> None:
    assert PARAMETERS["polhem_v1"].mechanism.orientation((0, 0, 0)) is None


def test_a_drive_is_symmetric() -> None:
    drive = Drive((0.01,) * 3, (0.1,) * 3, (1000,) * 3, (1, -1, 1), (1, 1, -1), (5, 6, 7), (0.02, 0.03, 0.04))
    assert drive.counts(drive.angles((100, -200, 300))) == (100, -200, 300)
    assert drive.torques(drive.currents_ma((0.1, -0.2, 0.3))) == pytest.approx((0.1, -0.2, 0.3))
    # 0.1 N m on the body are 0.01 N m at the motor, and half an ampere.
    assert drive.currents_ma((0.1, 0.0, 0.0))[0] == pytest.approx(500.0)
    assert inf > max(drive.radians_per_count) > 0.0
