"""How the two ends of the passivity approach share energy, and how the robot returns to the operator."""

import pytest

from tests.control.walls import Wall
from weberlink.control.contract import CREDIT_STEP, LinkQuality, SchemeParameters
from weberlink.control.tdpa import SHARE_AT_MASTER, TdpaMaster, TdpaSlave
from weberlink.geometry.vector import ZERO, distance

TICK = 1e-3
LEVEL = 0.05
SPEED = 0.25
SETTINGS = SchemeParameters(
    tick_period=TICK, force_range=30.0, level=LEVEL, damping=5.0, catch_up_speed=SPEED, coupling=2500.0
)
QUALITY = LinkQuality(0.1, 0.0)


def press(master: TdpaMaster, depth: float, ticks: int, force: float) -> float:
    """Push at constant speed against a constant force; returns the work done [J]."""
    for tick in range(ticks + 1):
        master.observe((0.0, 0.0, -depth * tick / ticks), TICK, 0.0, 0, QUALITY)
        master.displayed((0.0, 0.0, force))
    return force * depth


def test_what_the_hand_puts_in_goes_to_the_robot_but_for_the_level_of_its_own_tank() -> None:
    master = TdpaMaster(SETTINGS)
    work = press(master, 0.02, 200, 5.0)
    assert master.tank <= SHARE_AT_MASTER * LEVEL + 1e-9
    assert work - master.tank - CREDIT_STEP <= master.credit * CREDIT_STEP <= work - master.tank + 1e-9


def test_the_robots_tank_gives_back_what_it_does_not_need() -> None:
    slave = TdpaSlave(SETTINGS)
    slave.follow(ZERO, ZERO, TICK, 2000, QUALITY)
    slave.observe(ZERO, ZERO)
    assert slave.tank == pytest.approx(LEVEL)
    assert slave.credit == pytest.approx(2000 - LEVEL / CREDIT_STEP, abs=1.0)


def test_pressing_spends_the_robots_tank_and_no_more() -> None:
    wall, slave, here = Wall(1e4), TdpaSlave(SETTINGS), ZERO
    for tick in range(500):
        here = slave.follow((0.0, 0.0, -1e-5 * tick), here, TICK, 100, QUALITY)
        slave.observe(here, wall.at(0.0, here))
    stored = 0.5 * 1e4 * here[2] ** 2
    assert 0.5 * 100 * CREDIT_STEP <= stored <= 100 * CREDIT_STEP + 1e-3
    assert slave.tank >= -1e-3


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_the_robot_comes_back_to_the_operator_at_a_limited_speed_on_top_of_the_motion(speed: float) -> None:
    """In free space, with energy for it."""
    slave, here, start = TdpaSlave(SETTINGS), ZERO, 0.05
    distances = []
    for tick in range(400):
        target = (start + speed * TICK * tick, 0.0, 0.0)
        there = slave.follow(target, here, TICK, 5000, QUALITY)
        assert distance(there, here) <= (SPEED + speed) * TICK + 1e-12
        slave.observe(there, ZERO)
        here = there
        distances.append(distance(target, here))
    assert distances[round(0.5 * start / SPEED / TICK)] == pytest.approx(0.5 * start, abs=1e-3)
    assert distances[-1] <= 1e-12


def test_a_free_robot_pays_nothing_and_forgets_what_it_owes() -> None:
    wall, slave, here = Wall(500.0), TdpaSlave(SETTINGS), ZERO
    for tick in range(1000):
        here = slave.follow_freely((0.0, 0.0, -2e-5 * tick), here, TICK, 0)
        slave.observe(here, wall.at(0.0, here))
    assert here[2] == pytest.approx(-2e-5 * 999)
    owed = slave.tank
    assert owed < -0.05
    for _ in range(10_000):
        slave.follow_freely(here, here, TICK, 0)
        slave.observe(here, wall.at(0.0, here))
    assert 0.5 * owed < slave.tank < 0.0
