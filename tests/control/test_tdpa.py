"""How the two ends of the passivity approach share energy, and how the robot returns to the operator."""

from math import pi, sin

import pytest

from tests.control.teleoperation import Quality
from tests.control.walls import Wall
from weberlink.control.contract import CREDIT_STEP, SchemeParameters
from weberlink.control.force_port import DEBT
from weberlink.control.tdpa import FIRST_DEBT, KEPT_IN_CONTACT, SHARE_AT_MASTER, TdpaMaster, TdpaSlave
from weberlink.geometry.vector import ZERO, distance

TICK = 1e-3
LEVEL = 0.05
SPEED = 0.25
SETTINGS = SchemeParameters(
    tick_period=TICK, force_range=30.0, level=LEVEL, damping=5.0, catch_up_speed=SPEED, coupling=2500.0
)
QUALITY = Quality(0.1, 0.0)
DEPTH = 0.005
"""Of a command below a rubbing surface [m]."""


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


def test_a_robot_on_stand_by_follows_freely_and_its_tank_stays_as_it_is() -> None:
    wall, slave, here = Wall(500.0), TdpaSlave(SETTINGS), ZERO
    for tick in range(1000):
        here = slave.follow_freely((0.0, 0.0, -2e-5 * tick), here, TICK, 5 * tick)
        slave.stand_by(here, wall.at(0.0, here))
        assert (slave.tank, slave.credit) == (0.0, 0)
    assert here[2] == pytest.approx(-2e-5 * 999)


@pytest.mark.parametrize("depth", [-0.002, -0.01])
def test_what_the_hand_has_paid_for_before_is_not_gained_by_the_robot(depth: float) -> None:
    """The robot is in contact when control begins: the wall returns the energy, and it is on the master's account."""
    wall, slave, here = Wall(500.0), TdpaSlave(SETTINGS), ZERO
    for tick in range(101):
        here = slave.follow_freely((0.0, 0.0, depth * tick / 100), here, TICK, 0)
        slave.stand_by(here, wall.at(0.0, here))
    slave.begin()
    for tick in range(101):
        here = (0.0, 0.0, depth * (1.0 - tick / 100) + 1e-5)
        slave.observe(here, wall.at(0.0, here))
    assert slave.tank == pytest.approx(0.0, abs=0.02 * 250.0 * depth**2)
    for tick in range(101):  # a later contact counts as ever
        here = (0.0, 0.0, depth * tick / 100)
        slave.observe(here, wall.at(0.0, here))
    assert slave.tank == pytest.approx(-250.0 * depth**2, rel=0.05)


def rub(friction: float, stiffness: float, speed: float, income: float, turns: int) -> tuple[float, float, float]:
    """Command a robot `DEPTH` below a rubbing surface on z, back and forth along x.

    The surface is a spring to an anchor that slides at the friction cone.

    Args:
        friction: coefficient.
        stiffness: of the contact [N/m].
        speed: along the surface [m/s].
        income: energy that the operator's end hands over [W].
        turns: number of passes of 50 mm.

    Returns:
        The largest distance to the command along the surface [m], the largest debt [J], the mean normal force [N].
    """
    slave, here, anchor, x, given = TdpaSlave(SETTINGS), ZERO, 0.0, 0.0, 1e-3
    drift = debt = pressed = 0.0
    ticks = round(0.05 / speed / TICK)
    for tick in range(turns * ticks):
        x += speed * TICK if tick // ticks % 2 == 0 else -speed * TICK
        given += income * TICK
        here = slave.follow((x, 0.0, -DEPTH), here, TICK, int(given / CREDIT_STEP), QUALITY)
        normal = max(0.0, -stiffness * here[2])
        cone = friction * normal / stiffness
        anchor = min(max(anchor, here[0] - cone), here[0] + cone)
        slave.observe(here, (stiffness * (anchor - here[0]), 0.0, normal))
        drift, debt, pressed = max(drift, abs(x - here[0])), max(debt, -slave.tank), pressed + normal
    return drift, debt, pressed / (turns * ticks)


@pytest.mark.parametrize("stiffness", [300.0, 2500.0])
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("income", [0.0, 0.02, 0.1])
def test_a_robot_that_cannot_pay_for_friction_lifts_and_does_not_lag(
    friction: float, stiffness: float, income: float
) -> None:
    """It lags by no more than friction bends a contact of the commanded depth before it slides, and by 0.5 mm."""
    for speed in (0.02, 0.1):
        drift, debt, pressed = rub(friction, stiffness, speed, income, turns=4)
        assert drift <= friction * DEPTH + 5e-4
        assert debt <= 2.0 * FIRST_DEBT * LEVEL
        if income > 0.02:
            assert pressed >= 0.3


@pytest.mark.parametrize("amplitude", [1e-4, 1e-3])
@pytest.mark.parametrize("stiffness", [500.0, 2500.0])
def test_a_hand_shaken_in_contact_draws_a_debt_and_one_tick_at_most(amplitude: float, stiffness: float) -> None:
    """At 1 to 500 Hz; the received force is that of a wall a tick ago."""
    for hz in (1.0, 20.0, 60.0, 150.0, 240.0, 250.0, 260.0, 375.0, 450.0, 499.0, 500.0):
        master, at, force, work, lowest, tick_worth = TdpaMaster(SETTINGS), 0.0, 0.0, 0.0, 0.0, 0.0
        for tick in range(2000):
            before, at = at, amplitude * sin(2.0 * pi * hz * TICK * tick + 0.3)
            work -= force * (at - before)
            tick_worth = max(tick_worth, abs(force * (at - before)))
            lowest = min(lowest, work)
            master.observe((0.0, 0.0, at), TICK, tick, 0, QUALITY)
            (_, _, force) = master.render((0.0, 0.0, max(0.0, -stiffness * before)))
            master.displayed((0.0, 0.0, force))
        assert -lowest <= DEBT + tick_worth, hz


def test_in_contact_the_robots_tank_gives_back_what_pressing_does_not_need() -> None:
    """So that the operator's end can push the hand out of a wall that it felt late."""
    slave, here = TdpaSlave(SETTINGS), ZERO
    for _ in range(2000):
        here = slave.follow((0.0, 0.0, -1e-3), here, TICK, 400, QUALITY)
        slave.observe(here, (0.0, 0.0, -2500.0 * here[2]))
    stored = 0.5 * 2500.0 * 1e-6
    assert here[2] == pytest.approx(-1e-3)
    assert slave.tank == pytest.approx(KEPT_IN_CONTACT * LEVEL + stored, rel=0.02)


def test_a_held_sample_does_not_move_the_command() -> None:
    """Else the robot yields to what is withheld, the next sample is smaller, and so on to no force."""
    master, position = TdpaMaster(SETTINGS), (0.0, 0.0, -0.01)
    master.learn(None, (0.0, 0.0, 5.0), position)
    master.displayed((0.0, 0.0, 1.0))
    assert master.command(position) == position
    master.learn(Wall(500.0), (0.0, 0.0, 5.0), position)
    assert master.command(position)[2] == pytest.approx(-0.002)
