"""The wall: what is felt of a contact where the decoder has no surface that agrees, and when it ends."""

from itertools import pairwise
from math import sqrt

import pytest

from tests.control.teleoperation import ACCOUNT, TICK, Quality
from tests.control.walls import Wall
from weberlink.control.bounded import BACK, LATE, LEAVE, PRESS, BoundedMaster, BoundedSlave
from weberlink.control.contract import SchemeParameters
from weberlink.control.wall import WRONG, FeltContact
from weberlink.geometry.vector import ZERO, Vector

SETTINGS = SchemeParameters(TICK, 2500.0, ACCOUNT)
STIFFNESS = 500.0


def at(height: float) -> Vector:
    return (0.0, 0.0, height)


def pressed(depth: float = 0.004) -> FeltContact:
    """A contact at height 0 of which samples were received down to a depth [m], without a model."""
    contact = FeltContact(SETTINGS)
    for step in range(1, 41):
        place = at(-depth * step / 40)
        contact.learn(None, at(STIFFNESS * depth * step / 40), place, place)
    return contact


def test_the_stiffness_is_that_of_the_samples() -> None:
    assert pressed().stiffness == pytest.approx(STIFFNESS)


def test_a_hand_ahead_of_the_robot_feels_the_wall_where_it_is() -> None:
    """The newest sample is held: 2 N at 4 mm. The hand is 6 mm deep."""
    assert pressed().at(at(-0.006), at(2.0), at(-0.004), 0.0) == pytest.approx((0.0, 0.0, 3.0))


def test_at_the_place_of_the_robot_it_is_the_decoded_force() -> None:
    assert pressed().at(at(-0.004), at(2.0), at(-0.004), 0.0) == pytest.approx((0.0, 0.0, 2.0))


def test_a_surface_that_agrees_is_displayed_as_it_is() -> None:
    contact = pressed()
    contact.learn(Wall(1.2 * STIFFNESS), at(2.4), at(-0.004), at(-0.004))
    assert contact.at(at(-0.006), at(3.6), at(-0.004), 0.0) == at(3.6)


def test_a_surface_that_is_right_from_the_first_touch_says_what_the_contact_may_store() -> None:
    """No further sample comes: the account must not take the contact for a stiff one, and forget what was put in."""
    master = BoundedMaster(SETTINGS)
    wall, hand = Wall(480.0), at(0.001)

    def tick() -> Vector:
        master.observe(hand, TICK, 0.0, 0, Quality(0.0, 0.0))
        master.command(hand)
        force = master.render(wall.at(0.0, hand))
        master.displayed(force)
        return force

    tick()
    master.learn(wall, at(0.04), at(-0.00008))
    for step in range(101):
        hand = at(-0.0001 * step)
        assert tick() == wall.at(0.0, hand)
    stored = 0.5 * 480.0 * 0.01**2
    assert master.energy == pytest.approx(ACCOUNT.allowance + stored, rel=0.05)


def test_a_robot_that_is_free_in_the_wall_removes_it_at_once_or_slowly() -> None:
    for steps in (1, 20):
        contact = pressed()
        contact.learn(None, ZERO, at(0.001), at(0.001))
        assert contact.at(at(-0.002), ZERO, at(0.001), 0.0) == pytest.approx((0.0, 0.0, 1.0))
        for step in range(1, steps + 1):
            contact.at(at(-0.002), ZERO, at(-1.1 * WRONG * step / steps), 0.0)
        assert contact.normal is None


def test_a_free_robot_outside_the_wall_leaves_it() -> None:
    contact = pressed()
    contact.learn(None, ZERO, at(0.01), at(0.01))
    for height in (0.01, 0.008, 0.006):
        contact.at(at(0.02), ZERO, at(height), 0.0)
    assert contact.at(at(-0.002), ZERO, at(0.006), 0.0) == pytest.approx((0.0, 0.0, 1.0))


def test_the_command_yields_slowly_within_the_contact_and_comes_back_faster() -> None:
    master, hand = BoundedMaster(SETTINGS), at(-0.006)

    def tick(held: Vector) -> float:
        master.observe(hand, TICK, 0.0, 0, Quality(0.0, 0.0))
        (_, _, sent) = master.command(hand)
        master.render(at(3.0))
        master.displayed(held)
        return sent - hand[2]

    tick(ZERO)
    for step in range(1, 41):
        depth = 0.006 * step / 40
        master.learn(None, at(STIFFNESS * depth), at(-depth))
    out = [tick(ZERO) for _ in range(400)]
    assert max(b - a for a, b in pairwise(out)) == pytest.approx(LEAVE * TICK)
    assert out[-1] == pytest.approx(0.006, abs=1e-4), "to the surface, and no further"
    back = [tick(at(3.0)) for _ in range(100)]
    assert max(a - b for a, b in pairwise(back)) == pytest.approx(BACK * TICK)
    assert back[-1] == pytest.approx(0.0, abs=2e-4)


def test_the_robot_presses_a_new_contact_gently_until_it_can_be_answered() -> None:
    slave, quality = BoundedSlave(SETTINGS), Quality(0.1, 0.0)
    here, forces = ZERO, []
    for tick in range(400):
        here = slave.follow(at(-0.0002 * min(tick, 60)), here, TICK, 0, quality)
        force = max(0.0, -STIFFNESS * here[2])
        slave.observe(here, at(force))
        forces.append(force)
    unanswered = 1.5 * 0.1 + LATE
    assert max(forces[: round(unanswered / TICK)]) == pytest.approx(PRESS / sqrt(unanswered), abs=0.15)
    assert forces[-1] == pytest.approx(6.0, abs=0.01)
