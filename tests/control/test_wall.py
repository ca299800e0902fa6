"""The wall: what is felt of a contact where the decoder has no surface that agrees, and when it ends."""

from dataclasses import dataclass
from itertools import pairwise
from math import inf, sin, sqrt

import pytest

from tests.control.wall import ACCOUNT, SETTINGS, TICK, Wall
from weberlink.codec.predictors.geometry_based import Sphere
from weberlink.control.account import passivity_limit
from weberlink.control.bounded import (
    BACK,
    LATE,
    LEAVE,
    PRESS,
    REACH,
    SOFTEST,
    TURN,
    WRONG,
    BoundedMaster,
    BoundedSlave,
    FeltContact,
)
from weberlink.control.contract import LEAST_CONTACT, SentCommands
from weberlink.geometry.vector import ZERO, Vector, distance, dot, interpolate, norm, subtract, unit

STIFFNESS = 500.0


def at(height: float) -> Vector:
    return (0.0, 0.0, height)


def press(end: FeltContact | BoundedMaster, depth: float = 0.004) -> None:
    """Samples of a contact at height 0 are received down to a depth [m], without a model."""
    for step in range(1, 41):
        end.learn(None, at(STIFFNESS * depth * step / 40), at(-depth * step / 40))


def pressed() -> FeltContact:
    contact = FeltContact(SETTINGS)
    press(contact)
    return contact


def tick(master: BoundedMaster, hand: Vector, decoded: Vector, displayed: Vector | None = None) -> tuple[float, Vector]:
    """The height that is sent, and the force; displayed is that, unless told otherwise."""
    master.observe(hand, TICK, 0.0, 0, 0.0)
    (_, _, sent) = master.command(hand)
    force = master.render(decoded)
    master.displayed(force if displayed is None else displayed)
    return sent, force


def test_a_surface_that_is_right_from_the_first_touch_says_what_the_contact_may_store() -> None:
    """No further sample comes: the account must not take the contact for a stiff one, and forget what was put in."""
    master, wall = BoundedMaster(SETTINGS), Wall(480.0)
    tick(master, at(0.001), ZERO)
    master.learn(wall, at(0.04), at(-0.00008))
    for step in range(101):
        force = wall.at(0.0, at(-0.0001 * step))
        assert tick(master, at(-0.0001 * step), force)[1] == force
    stored = 0.5 * 480.0 * 0.01**2
    assert master.energy == pytest.approx(ACCOUNT.allowance + stored, rel=0.05)


def test_a_free_robot_outside_the_wall_leaves_it() -> None:
    contact = pressed()
    contact.learn(None, ZERO, at(0.01))
    for height in (0.01, 0.008, 0.006):
        contact.at(at(0.02), ZERO, at(height), 0.0)
    assert contact.at(at(-0.002), ZERO, at(0.006), 0.0) == pytest.approx((0.0, 0.0, 1.0))


def test_the_command_yields_slowly_within_the_contact_and_comes_back_faster() -> None:
    master, hand = BoundedMaster(SETTINGS), at(-0.006)

    def off(displayed: Vector) -> float:
        return tick(master, hand, at(3.0), displayed)[0] - hand[2]

    off(ZERO)
    press(master, 0.006)
    out = [off(ZERO) for _ in range(400)]
    assert max(b - a for a, b in pairwise(out)) == pytest.approx(LEAVE * TICK)
    assert out[-1] == pytest.approx(0.006, abs=1e-4), "to the surface, and no further"
    back = [off(at(3.0)) for _ in range(100)]
    assert max(a - b for a, b in pairwise(back)) == pytest.approx(BACK * TICK)
    assert back[-1] == pytest.approx(0.0, abs=2e-4)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_robot_presses_a_new_contact_gently_until_it_can_be_answered(axis: int) -> None:
    """Then it regains its command slowly, beside the motion of the command itself; the hand goes on at 200 ms."""

    def along(value: float) -> Vector:
        return tuple(value if each == axis else 0.0 for each in range(3))  # type: ignore[return-value]

    slave, rtt = BoundedSlave(SETTINGS), 0.1
    here, forces = ZERO, []
    for tick in range(500):
        goal = along(-0.0002 * min(tick, 60) - 0.0001 * min(max(tick - 200, 0), 60))
        here = slave.follow(goal, here, TICK, 0, rtt)
        force = max(0.0, -STIFFNESS * here[axis])
        slave.observe(here, along(force))
        forces.append(force)
    unanswered = round((1.5 * 0.1 + LATE) / TICK)
    assert max(forces[:unanswered]) == pytest.approx(PRESS / sqrt(unanswered * TICK), abs=0.15)
    rises = [STIFFNESS * TICK * (LEAVE + (0.1 if 200 < tick <= 260 else 0.0)) for tick in range(unanswered + 2, 300)]
    found = [after - before for before, after in pairwise(forces[unanswered + 1 : 300])]
    assert found == pytest.approx(rises)
    assert forces[-1] == pytest.approx(9.0)
    # It has its command again, and is held back no more.
    assert [slave.follow(along(-0.03), here, TICK, 0, rtt) for _ in range(2)] == [along(-0.03)] * 2


def test_a_robot_that_was_led_out_while_it_waits_still_goes_in_slowly_and_once_there_may_lag() -> None:
    slave, rtt = BoundedSlave(SETTINGS), 0.1

    def follow(target: float, here: float) -> float:
        slave.observe(at(here), at(9.0))
        (_, _, commanded) = slave.follow(at(target), at(here), TICK, 0, rtt)
        return commanded

    assert follow(-0.005, -0.001) == -0.001
    for _ in range(round((1.5 * rtt + LATE) / TICK) - 2):
        assert follow(-0.0005, -0.001) == -0.0005
    assert follow(-0.0006, 0.0) == pytest.approx(-0.0001 - LEAVE * TICK), "pushed out as the time is over"
    here = 0.0
    while here > -0.0006:
        before, here = here, follow(-0.0006, here)
        assert before - here <= LEAVE * TICK * (1.0 + 1e-9)
    assert [follow(-0.0006, 0.0), follow(-0.02, 0.0)] == [-0.0006, -0.02]


@pytest.mark.parametrize(
    ("force", "speed", "felt"),
    [
        (2.0, 0.1, 1.96), (2.0, -0.1, 2.04), (2.0, 6.0, 0.0), (2.0, -6.0, 4.0), (0.0, -0.1, 0.0), (-1.0, 0.1, -1.0),
    ],
)  # fmt: skip
def test_the_damping_of_a_contact_neither_pulls_nor_more_than_doubles(force: float, speed: float, felt: float) -> None:
    assert pressed().damped(at(force), (0.3, 0.0, speed), 0.004) == pytest.approx(at(felt), abs=1e-9)


# What is known of a contact: 500 N/m at height 0, the newest sample 2 N at 4 mm.


@pytest.mark.parametrize(
    ("hand", "force", "robot", "felt"),
    [
        (-0.006, 2.0, -0.004, 3.0), (-0.004, 2.0, -0.004, 2.0), (-0.002, 2.0, -0.004, 1.0), (0.0, 2.0, -0.004, 0.0),
        (0.001, 2.0, -0.004, 0.0), (-0.006, 3.0, -0.006, 3.0), (-0.002, 1.0, -0.002, 1.0),
        (-0.006, 2.0, -0.0049, 2.55), (-0.006, 2.0, -0.0051, 3.0),  # one that yields carries it; one held back does not
        (-0.002, 0.0, 0.001, 1.0),  # a robot that is not there yet does not refute the wall,
        (-0.002, 0.0, -0.99 * WRONG, 1.0 - 0.99 * WRONG * STIFFNESS), (-0.002, 0.0, -1.01 * WRONG, 0.0),  # until it is
        (-0.002, 0.99 * LEAST_CONTACT, 0.001, 1.0),
    ],
)  # fmt: skip
def test_a_hand_feels_the_wall_where_it_is(hand: float, force: float, robot: float, felt: float) -> None:
    contact = pressed()
    assert contact.stiffness == pytest.approx(STIFFNESS)
    assert contact.at(at(hand), at(force), at(robot), 0.0) == pytest.approx(at(felt), abs=1e-9)
    assert (contact.normal is None) == (force < LEAST_CONTACT and robot < -WRONG)


@pytest.mark.parametrize(
    ("depth", "felt"), [(0.0016, (0.2, 0.0, 0.8)), (0.0008, (0.1, 0.0, 0.4)), (0.0032, (0.2, 0.0, 1.6))]
)
def test_what_friction_adds_is_felt_in_proportion_up_to_what_was_decoded(depth: float, felt: Vector) -> None:
    assert pressed().at(at(-depth), (0.2, 0.0, 0.8), at(-0.0016), 0.0) == pytest.approx(felt)


@pytest.mark.parametrize("share", [0.49, 0.51, 1.0, 1.99, 2.01])
def test_a_surface_is_displayed_where_its_stiffness_agrees_within_a_factor_of_two(share: float) -> None:
    contact = pressed()
    contact.learn(Wall(share * STIFFNESS), at(2.0), at(-0.004))
    felt = contact.at(at(-0.006), at(0.006 * share * STIFFNESS), at(-0.004), 0.0)
    agrees = 0.5 < share < 2.0
    assert (felt == at(0.006 * share * STIFFNESS)) == (agrees or share == 1.0)


@pytest.mark.parametrize(("rtt", "hand"), [(0.0, -0.004), (0.04, -0.004), (0.04, 0.0005), (0.1, -0.02)])
def test_a_surface_that_moves_is_displayed_where_it_is_by_now(rtt: float, hand: float) -> None:
    """Not where it was half a round trip ago, when the newest news of it left; near the robot, and far from it."""

    @dataclass(frozen=True)
    class Rising:
        stiffness: float = STIFFNESS

        def at(self, tick: float, position: Vector) -> Vector:
            return at(max(0.0, self.stiffness * (1e-4 * (tick - 100.0) - position[2])))

    contact, wall, now = pressed(), Rising(), 100.0 + 0.5 * rtt / TICK
    contact.learn(wall, at(2.0), at(-0.004))
    felt = contact.at(at(hand), wall.at(100.0, at(hand)), at(-0.004), 100.0, rtt)
    assert felt == pytest.approx(wall.at(now, at(hand)))


def test_a_displayed_surface_is_a_wall_that_the_command_can_leave() -> None:
    """Also after the robot, or a force that lasted without a contact, has removed the wall before."""
    contact, wall = pressed(), Wall(STIFFNESS)
    contact.learn(wall, at(2.0), at(-0.004))
    contact.normal = None
    assert contact.at(at(-0.006), at(3.0), at(0.01), 0.0) == at(3.0)
    assert contact.normal == at(1.0)
    assert contact.depth(at(-0.006)) == pytest.approx(0.006)


@pytest.mark.parametrize(("hand", "felt"), [(-0.001, 0.0), (-0.003, 0.5)])
def test_a_surface_below_a_robot_far_above_is_displayed_as_decoded(hand: float, felt: float) -> None:
    """Not the wall of the last contact, here 2 mm higher."""
    contact, wall = pressed(), Wall(STIFFNESS, -0.002)
    contact.learn(wall, at(2.0), at(-0.004))
    assert contact.at(at(hand), at(felt), at(0.012), 0.0) == at(felt)


@pytest.mark.parametrize("along", [0.0, 0.009, 0.0105, 0.03, 0.06])
def test_a_dome_goes_on_flat_beyond_its_reach(along: float) -> None:
    """So the far side of a dome is no pit; nearer than that the dome is felt as it was decoded."""
    contact, robot, hand = pressed(), at(-0.004), (along, 0.0, -0.004)
    dome = Sphere(at(-0.05), 0.05, STIFFNESS, at(2.0))
    contact.learn(dome, at(2.0), robot)
    felt, far = contact.at(hand, dome.at(0.0, hand), robot, 0.0), distance(hand, robot)
    if far <= REACH:
        assert felt == dome.at(0.0, hand)
        return
    edge = interpolate(robot, hand, REACH / far)
    normal = unit(dome.at(0.0, edge))
    flat = norm(dome.at(0.0, edge)) - STIFFNESS * dot(normal, subtract(hand, edge))
    assert dot(normal, felt) == pytest.approx(max(0.0, flat))


@pytest.mark.parametrize(
    ("stiffness", "found"), [(10.0, SOFTEST), (60.0, 60.0), (2400.0, 2400.0), (9000.0, SETTINGS.coupling)]
)
def test_a_stiffness_is_between_the_softest_wall_and_the_coupling(stiffness: float, found: float) -> None:
    contact = FeltContact(SETTINGS)
    assert contact.stiffness == SETTINGS.coupling
    for depth in (0.012, 0.014, 0.016):
        contact.learn(None, at(stiffness * depth), at(-depth))
    assert contact.stiffness == pytest.approx(found)
    contact.forget()
    assert (contact.normal, contact.stiffness) == (None, pytest.approx(found))
    contact.reset()
    assert (contact.stiffness, contact.softest) == (SETTINGS.coupling, inf)


def test_a_normal_turns_slowly_to_a_similar_force_and_at_once_to_another() -> None:
    contact = pressed()
    contact.learn(None, (0.6, 0.0, 1.0), at(-0.004))
    tilted = unit((TURN * 0.6 / sqrt(1.36), 0.0, 1.0 + TURN * (1.0 / sqrt(1.36) - 1.0)))
    assert contact.normal == pytest.approx(tilted)
    contact.learn(None, (1.0, 0.0, 0.0), at(-0.004))
    assert contact.normal == (1.0, 0.0, 0.0)
    contact.normal = None
    assert contact.normal is None
    assert contact.depth(at(-1.0)) == 0.0
    contact = pressed()
    contact.learn(None, at(9.0), (0.01, 0.0, -0.0041))
    assert contact.stiffness == pytest.approx(STIFFNESS), "slid rather than pressed"


@pytest.mark.parametrize(("back", "found"), [(0.0, 9), (0.0014, 8), (0.0016, 7), (0.0041, 5), (0.3, 5)])
def test_the_command_of_so_long_ago(back: float, found: int) -> None:
    """Of ten, the newest five are kept; before there are so many, the oldest one counts."""
    sent = SentCommands(TICK, 0.004)
    sent.add(at(77.0))
    assert sent.ago(0.3) == at(77.0)
    sent.reset()
    for step in range(10):
        sent.add(at(step))
    assert sent.ago(back) == at(found)


@pytest.mark.parametrize("depth", [0.01, 0.03])
def test_the_command_leaves_no_farther_than_the_contact(depth: float) -> None:
    master = BoundedMaster(SETTINGS)
    press(master, depth)
    sent = [tick(master, at(-depth), at(STIFFNESS * depth), ZERO)[0] for _ in range(1500)]
    assert sent[-1] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("free", [0.003, 0.02, 0.1, 1.0])
def test_an_answered_contact_that_opens_becomes_a_new_one_again(free: float) -> None:
    """How long the next tap is gentle grows with the time without a contact, to that of an answer."""
    rtt, answered, slave = 0.04, 1.5 * 0.04 + LATE, BoundedSlave(SETTINGS)

    def follow(target: float, here: float, force: float) -> Vector:
        slave.observe(at(here), at(force))
        return slave.follow(at(target), at(here), TICK, 0, rtt)

    for _ in range(round(2.0 * answered / TICK)):
        follow(-0.004, -0.004, 9.0)
    for _ in range(round(free / TICK)):
        assert follow(0.001, 0.001, 0.0) == at(0.001)
    gentle = 0
    while follow(-0.005, -0.001, 1.01 * PRESS / sqrt(answered)) == pytest.approx(at(-0.001)):
        gentle += 1
    assert gentle * TICK == pytest.approx(min(answered, free), abs=1.1 * TICK)
    assert follow(-0.005, -0.001, 0.99 * PRESS / sqrt(answered)) != at(-0.001)


@pytest.mark.parametrize(("force", "counts"), [(LEAST_CONTACT, True), (0.999 * LEAST_CONTACT, False)])
def test_the_least_contact_is_one_at_both_ends(force: float, counts: bool) -> None:
    """The work of a scene that gives, the yielding of the robot and the refutation of a wall begin with it."""
    slave = BoundedSlave(SETTINGS)
    slave.observe(ZERO, at(force))
    slave.observe(at(0.1), at(force))
    assert slave.credit == (50 if counts else 0)
    late = 1000.0
    assert (slave.follow(at(-0.01), at(0.1), TICK, 0, late) == at(-0.01)) != counts
    contact = pressed()
    contact.at(at(-0.006), at(force), at(-2.0 * WRONG), 0.0)
    assert (contact.normal is not None) == counts


@pytest.mark.parametrize(
    ("options", "limit"),
    [
        ({}, 16_000.0), ({"delay_ticks": 1.0}, 16_000.0 / 3.0), ({"wall_damping": 3.0}, 10_000.0),
        ({"wall_damping": -3.0}, 10_000.0), ({"wall_damping": 8.0}, 0.0), ({"wall_damping": 9.0}, 0.0),
    ],
)  # fmt: skip
def test_the_stiffness_of_a_passive_wall(options: dict[str, float], limit: float) -> None:
    assert passivity_limit(8.0, TICK, **options) == pytest.approx(limit)


def oblique(order: tuple[int, int, int]) -> list[tuple[Vector, Vector]]:
    """The forces at the hand and the goals of the robot; `order` says which axis of the motion is x, y and z."""

    def axes(vector: Vector) -> Vector:
        return (vector[order[0]], vector[order[1]], vector[order[2]])

    master, slave, rtt = BoundedMaster(SETTINGS), BoundedSlave(SETTINGS), 0.04
    found: list[tuple[Vector, Vector]] = []
    here = axes((0.001, 0.002, 0.003))
    for tick in range(600):
        depth = 0.02 * sin(0.02 * tick)  # hard enough for the robot to hold back a new contact
        along = 0.002 * sin(0.013 * tick)
        hand = axes((-0.48 * depth + 0.8 * along, -0.6 * depth, -0.64 * depth - 0.6 * along))
        push = STIFFNESS * max(0.0, depth)
        measured = axes((0.48 * push - 0.1 * push, 0.6 * push, 0.64 * push + 0.08 * push))
        if tick % 7 == 0:
            master.learn(None, measured, hand)
        master.observe(hand, TICK, tick, 0, rtt)
        sent = master.command(hand)
        force = master.render(measured)
        master.displayed(force)
        here = slave.follow(sent, here, TICK, 0, rtt)
        slave.observe(here, measured)
        found.append((force, here))
    return found


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1), (1, 0, 2)])
def test_no_axis_is_special(order: tuple[int, int, int]) -> None:
    """Of a hand that slides over an oblique wall with friction, in and out of contact, on a link of 40 ms."""
    ours = oblique((0, 1, 2))
    for pair, others in zip(ours, oblique(order), strict=True):
        assert others == tuple(pytest.approx([vector[axis] for axis in order], abs=1e-9) for vector in pair)
    assert max(norm(force) for force, _ in ours) > 1.0
