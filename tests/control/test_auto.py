"""The change of schemes: no jump of the force, and no permanent debt."""

from math import ceil

import pytest

from tests.control.vectors import largest_step
from tests.control.walls import Wall
from weberlink.control.auto import DWELL, HANDOVER, ORDER, AutoMaster, AutoSlave
from weberlink.control.contract import LinkQuality, SchemeParameters
from weberlink.control.energy import FORGIVENESS
from weberlink.control.force_port import STEEPEST
from weberlink.geometry.vector import ZERO, Vector

TICK = 1e-3
NONE, TDPA, MMT = ORDER
SETTINGS = SchemeParameters(TICK, 30.0, level=0.05, damping=5.0, catch_up_speed=0.25, coupling=2500.0)
WALL = Wall(500.0)
DELAY = {NONE: 0.001, TDPA: 0.1, MMT: 0.7}
LONG = 3.0 * DWELL


class Operator:
    """An operator who presses on a wall; the decoded force may differ from that of the model."""

    def __init__(self) -> None:
        self.control = AutoMaster(SETTINGS)
        self.credit = 0
        self.at = 0.001
        self.forces: list[Vector] = []
        self.control.learn(WALL, (0.0, 0.0, 2.5), (0.0, 0.0, -0.005))

    def go(self, height: float, seconds: float, delay: float, decoded: Vector | None = None) -> None:
        """Move evenly to a height [m]; `delay` is the round trip [s], `decoded` by default the force of the wall."""
        ticks, start = round(seconds / TICK), self.at
        for tick in range(1, ticks + 1):
            self.at = start + (height - start) * tick / ticks
            self.control.observe((0.0, 0.0, self.at), TICK, 0.0, self.credit, LinkQuality(delay, 0.0))
            force = self.control.render(WALL.at(0.0, (0.0, 0.0, self.at)) if decoded is None else decoded)
            self.control.displayed(force)
            self.forces.append(force)


@pytest.mark.parametrize("course", [(NONE, TDPA, MMT), (MMT, TDPA, NONE), (TDPA, NONE, TDPA, MMT, TDPA)])
def test_the_force_goes_over_without_a_jump(course: tuple[str, ...]) -> None:
    """The decoded force and that of the model differ by 3.5 N; a hand at rest feels a ramp between them.

    It takes 200 ms, and is steeper while a port returns a withheld force.
    """
    operator = Operator()
    operator.credit = 5000  # enough energy for everything
    operator.go(0.001, 0.3, 0.1, ZERO)
    operator.go(-0.005, 0.3, 0.1, (0.0, 0.0, 6.0))
    operator.go(-0.005, LONG, DELAY[course[0]], (0.0, 0.0, 6.0))
    for scheme in course:
        before = len(operator.forces) - 1
        operator.go(-0.005, LONG, DELAY[scheme], (0.0, 0.0, 6.0))
        assert operator.control.active == scheme
        assert largest_step(operator.forces[before:]) <= 10.0 * 3.5 * TICK / HANDOVER
    felt = operator.forces[-1][2]
    assert felt == pytest.approx(2.5 if course[-1] == MMT else 6.0, abs=0.1)


def test_a_change_in_motion_is_no_steeper_than_what_a_port_may_do() -> None:
    operator = Operator()
    for delay in (0.7, 0.1, 0.001, 0.1, 0.7):
        for height in (-0.005, 0.002, -0.004, 0.001) * ceil(LONG / 0.8):
            operator.go(height, 0.2, delay)
    assert largest_step(operator.forces) <= 2.0 * STEEPEST * TICK + 1e-9


def test_a_debt_of_a_time_without_control_is_forgotten() -> None:
    """A debt below the limit that starts passivity control: the hand is pushed out without work before."""
    operator = Operator()
    operator.go(0.001, LONG, DELAY[NONE], ZERO)
    assert operator.control.active == NONE
    operator.go(0.009, 0.2, DELAY[NONE], (0.0, 0.0, 5.0))
    assert operator.control.active == NONE
    operator.go(0.009, 6.0 * FORGIVENESS, DELAY[NONE], ZERO)
    operator.go(0.009, 1.5 * DWELL, DELAY[TDPA], ZERO)
    assert operator.control.active == TDPA
    assert operator.control.tank >= -1e-3


def test_an_active_loop_is_taken_under_control_whatever_the_delay() -> None:
    operator = Operator()
    operator.go(0.001, LONG, DELAY[NONE], ZERO)
    operator.go(0.051, 0.5, DELAY[NONE], (0.0, 0.0, 5.0))
    assert operator.control.active == TDPA
    assert operator.control.tank < -SETTINGS.level


def test_energy_that_is_handed_over_counts_under_every_scheme() -> None:
    operator = Operator()
    handed = []
    for scheme in (NONE, TDPA, MMT):
        operator.go(0.001, LONG, DELAY[scheme], ZERO)
        operator.go(-0.005, 0.5, DELAY[scheme], (0.0, 0.0, 2.0))
        handed.append(operator.control.credit)
    assert 0 < handed[0] < handed[1] < handed[2]


@pytest.mark.parametrize("scheme", [NONE, MMT])
def test_the_robot_follows_freely_where_its_port_is_not_controlled(scheme: str) -> None:
    slave = AutoSlave(SETTINGS)
    here = ZERO
    for tick in range(round(2.0 * LONG / TICK)):
        target = (0.0, 0.0, -1e-6 * tick)
        here = slave.follow(target, here, TICK, 0, LinkQuality(DELAY[scheme], 0.0))
        slave.observe(here, (0.0, 0.0, 1.0 if slave.active == scheme else 0.0))
    assert slave.active == scheme
    assert here == target


def test_and_no_further_than_its_tank_reaches_where_it_is() -> None:
    slave = AutoSlave(SETTINGS)
    here = ZERO
    for tick in range(1000):
        here = slave.follow((0.0, 0.0, -1e-5 * tick), here, TICK, 10, LinkQuality(DELAY[TDPA], 0.0))
        slave.observe(here, (0.0, 0.0, 500.0 * -here[2]))
    assert 0.5 * 500.0 * here[2] ** 2 == pytest.approx(10e-4, rel=0.3)
