"""The energy-bounded display between a hand and a wall keeps its bound, with any wall, link and hand.

The hand is a mass on a spring whose far end moves. Energy that it takes out of the device beyond its own work is
bounded by `weberlink.control.account`.
"""

from random import Random

import pytest

from tests.control.teleoperation import ACCOUNT, SETTINGS, Course, Hand, Link, Wall, operate
from weberlink.control.contract import LEAST_CONTACT, Surface
from weberlink.control.table import build_master_control, build_slave_control

HANDS = {
    "arm": Hand(),
    "fingertip": Hand(mass=0.02, stiffness=300.0, damping=1.0),
    "5 g": Hand(mass=0.005, stiffness=300.0, damping=1.0),
    "stiff and heavy": Hand(mass=1.0, stiffness=1000.0, damping=1.0),
}


def run(name: str, stiffness: float, link: Link, hand: Hand, **more: object) -> Course:
    """With a robot of the stiffness of the coupling."""
    master, slave = build_master_control(name, SETTINGS), build_slave_control(name, SETTINGS)
    felt = stiffness * SETTINGS.coupling / (SETTINGS.coupling + stiffness)
    return operate(master, slave, wall=Wall(felt), link=link, hand=hand, seconds=4.5, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("hand", "stiffness", "delay"),
    [
        *(("arm", stiffness, delay) for stiffness in (1e1, 1e3, 1e4, 1e6) for delay in (0.0, 0.05, 0.35)),
        *((hand, stiffness, delay) for hand in HANDS for stiffness in (1e3, 1e5) for delay in (0.0, 0.05)),
    ],
)
def test_the_bound_is_kept_on_any_wall_with_any_hand(hand: str, stiffness: float, delay: float) -> None:
    for link in (Link(delay), Link(delay, jitter=0.05, loss=0.3, seed=3)):
        assert run("bounded", stiffness, link, HANDS[hand]).share_of_bound(ACCOUNT) <= 1.0, link


@pytest.mark.parametrize("seed", range(3))
def test_it_is_kept_over_links_walls_and_models_that_chance_makes(seed: int) -> None:
    """Models wrong by a factor of two and by millimetres, and missing in some samples."""
    random = Random(seed)
    stiffness = 10.0 ** random.uniform(1.0, 6.0)
    link = Link(random.uniform(0.0, 0.35), random.uniform(0.0, 0.1), random.uniform(0.0, 0.6), seed)
    hand = Hand(10.0 ** random.uniform(-2.0, 0.0), random.uniform(100.0, 1000.0), random.uniform(0.5, 8.0))

    def model(force: float, at: float) -> Surface:
        wrong = Wall(stiffness * random.uniform(0.5, 2.0), at + force / stiffness + random.uniform(-0.002, 0.002))
        return wrong if force and random.random() < 0.8 else None

    course = run("bounded", stiffness, link, hand, model=model)
    assert course.share_of_bound(ACCOUNT) <= 1.0, (stiffness, link, hand)


@pytest.mark.parametrize("stiffness", [500.0, 1e4])
def test_without_control_the_same_world_breaks_it(stiffness: float) -> None:
    """Otherwise the tests above could not fail."""
    assert run("none", stiffness, Link(0.05), HANDS["arm"]).share_of_bound(ACCOUNT) > 1.2


@pytest.mark.parametrize("delay", [0.0, 0.005, 0.05])
@pytest.mark.parametrize(("stiffness", "within"), [(500.0, 0.05), (1e4, 0.15)])
def test_the_wall_is_felt_and_pressed_on_alike(stiffness: float, within: float, delay: float) -> None:
    """A control that displays no force at all would be passive too. A hard wall is tapped on gently at first."""
    course = run("bounded", stiffness, Link(delay), HANDS["arm"])
    assert sum(course.forces) / sum(course.wall_forces) == pytest.approx(1.0, abs=within)
    assert max(course.forces) >= 3.0


def test_without_delay_what_the_robot_feels_is_displayed() -> None:
    course, presses = run("bounded", 1e3, Link(), HANDS["arm"]), 3000  # then it taps, at first gently
    assert course.forces[1:presses] == pytest.approx(course.wall_forces[: presses - 1], abs=LEAST_CONTACT)
