"""The change of schemes: no jump of the force, no debt taken along, and no energy made beyond the stated debt."""

from math import ceil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.teleoperation import Quality
from tests.control.vectors import forces, largest_step, steps
from tests.control.walls import Wall
from tests.examples import examples
from weberlink.control.auto import (
    DEBT,
    DWELL,
    HANDOVER,
    LARGEST_DEBT,
    ORDER,
    AutoMaster,
    AutoSlave,
    ContactBalance,
    slid,
)
from weberlink.control.contract import SchemeParameters
from weberlink.control.force_port import STEEPEST
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale

TICK = 1e-3
NONE, TDPA, MMT = ORDER
SETTINGS = SchemeParameters(TICK, 30.0, level=0.05, damping=5.0, catch_up_speed=0.25, coupling=2500.0)
WALL = Wall(500.0)
DELAY = {NONE: 0.001, TDPA: 0.03, MMT: 0.7}
LONG = 3.0 * DWELL
MOST = LARGEST_DEBT * SETTINGS.level


class Operator:
    """An operator who presses on a wall; the decoded force may differ from that of the model."""

    def __init__(self) -> None:
        self.control = AutoMaster(SETTINGS)
        self.credit = 0
        self.at = 0.001
        self.forces: list[Vector] = []
        self.work = 0.0
        self.control.learn(WALL, (0.0, 0.0, 2.5), (0.0, 0.0, -0.005))

    def go(self, height: float, seconds: float, delay: float = 0.03, decoded: Vector | None = None) -> None:
        """Move evenly to a height [m]; `delay` is the round trip [s], `decoded` by default the force of the wall."""
        ticks, start = round(seconds / TICK), self.at
        for tick in range(1, ticks + 1):
            before, self.at = self.at, start + (height - start) * tick / ticks
            if self.forces:
                self.work -= self.forces[-1][2] * (self.at - before)
            self.control.observe((0.0, 0.0, self.at), TICK, 0.0, self.credit, Quality(delay, 0.0))
            force = self.control.render(WALL.at(0.0, (0.0, 0.0, self.at)) if decoded is None else decoded)
            self.control.displayed(force)
            self.forces.append(force)


@pytest.mark.parametrize("scheme", [NONE, TDPA, MMT])
def test_it_wants_the_scheme_of_the_delay_and_uses_it_when_told(scheme: str) -> None:
    operator = Operator()
    for _ in range(3):
        operator.go(0.001, LONG, DELAY[scheme], ZERO)
        if operator.control.wanted is not None:
            operator.control.use(operator.control.wanted)
    assert (operator.control.active, operator.control.wanted) == (scheme, None)


def test_it_changes_nothing_by_itself() -> None:
    operator = Operator()
    operator.go(0.001, LONG, DELAY[NONE], ZERO)
    assert (operator.control.active, operator.control.wanted) == (TDPA, NONE)


@pytest.mark.parametrize("course", [(NONE, TDPA, MMT), (MMT, TDPA, NONE), (TDPA, NONE, TDPA, MMT, TDPA), (MMT, NONE)])
@pytest.mark.parametrize("pause", [1.5, 0.5, 0.1])
def test_the_force_goes_over_without_a_jump(course: tuple[str, ...], pause: float) -> None:
    """The decoded force and that of the model differ by 3.5 N; a hand at rest feels a ramp between them.

    It takes 200 ms, and is steeper while a port returns a withheld force. The next change may come before it is over.
    """
    operator = Operator()
    operator.credit = 5000  # enough energy for everything
    operator.go(0.001, 0.3, 0.03, ZERO)
    operator.go(-0.005, 0.3, 0.03, (0.0, 0.0, 6.0))
    operator.go(-0.005, LONG, 0.03, (0.0, 0.0, 6.0))
    for scheme in course:
        before = len(operator.forces) - 1
        operator.control.use(scheme)
        operator.go(-0.005, pause * HANDOVER, 0.03, (0.0, 0.0, 6.0))
        assert operator.control.active == scheme
        assert largest_step(operator.forces[before:]) <= 10.0 * 3.5 * TICK / HANDOVER
    operator.go(-0.005, LONG, 0.03, (0.0, 0.0, 6.0))
    felt = operator.forces[-1][2]
    assert felt == pytest.approx(2.5 if course[-1] == MMT else 6.0, abs=0.1)


def test_a_change_in_motion_is_no_steeper_than_what_a_port_may_do() -> None:
    operator = Operator()
    for scheme in (MMT, TDPA, NONE, TDPA, MMT):
        operator.control.use(scheme)
        for height in (-0.005, 0.002, -0.004, 0.001) * ceil(LONG / 0.8):
            operator.go(height, 0.2)
    assert largest_step(operator.forces) <= 2.0 * STEEPEST * TICK + 1e-9


def test_taps_on_a_wall_need_no_control() -> None:
    """However many: the wall returns what it took, and a little more because it is sampled."""
    operator = Operator()
    operator.control.use(NONE)
    operator.go(0.001, LONG, DELAY[NONE], ZERO)
    for _ in range(20):
        operator.go(-0.008, 0.05, DELAY[NONE])
        operator.go(0.008, 0.2, DELAY[NONE])
        assert operator.control.wanted is None
    assert operator.work < -DEBT * SETTINGS.level, "over all of them it is more than a single contact may return"


def test_an_active_loop_calls_for_control_whatever_the_delay_and_gets_out_no_more_than_the_debt() -> None:
    operator = Operator()
    operator.control.use(NONE)
    operator.go(0.001, LONG, DELAY[NONE], ZERO)
    operator.go(0.001 + 0.8 * DEBT * SETTINGS.level / 5.0, 0.05, DELAY[NONE], (0.0, 0.0, 5.0))
    assert operator.control.wanted is None
    operator.go(0.051, 0.5, DELAY[NONE], (0.0, 0.0, 5.0))
    assert (operator.control.active, operator.control.wanted) == (NONE, TDPA), "the other end has not agreed"
    assert -MOST <= operator.work < -DEBT * SETTINGS.level
    operator.control.use(TDPA)
    operator.go(0.101, 0.5, DELAY[NONE], (0.0, 0.0, 5.0))
    assert operator.control.wanted is None
    assert operator.work >= -MOST - 1e-3 * MOST


def test_a_debt_is_forgiven_at_the_handover() -> None:
    operator = Operator()
    operator.control.use(NONE)
    operator.go(0.051, 0.5, DELAY[NONE], (0.0, 0.0, 5.0))
    assert operator.control.tank < 0.0
    operator.control.use(TDPA)
    assert 0.0 <= operator.control.tank <= MOST
    operator.control.use(NONE)
    operator.go(0.051, 2.0 * HANDOVER, DELAY[NONE], ZERO)
    assert operator.control.tank == pytest.approx(0.0, abs=0.2 * MOST)


@given(st.floats(-0.02, 0.0), st.sampled_from([(NONE, TDPA), (MMT, TDPA), (NONE, MMT), (TDPA, MMT)]))
@examples(20)
def test_a_handover_in_contact_makes_no_energy_beyond_the_debt(depth: float, change: tuple[str, str]) -> None:
    """What the hand has pressed into the wall, it gets back after the change; not more."""
    operator = Operator()
    operator.control.use(change[0])
    operator.go(0.001, 2.0 * HANDOVER)
    began = operator.work
    operator.go(depth, 0.2)
    operator.control.use(change[1])
    operator.go(depth, 0.3)
    operator.go(0.002, 0.2)
    assert operator.work - began >= -MOST


@given(
    st.lists(
        st.tuples(st.sampled_from(ORDER), st.floats(-0.004, 0.004), st.floats(0.0, 8.0), st.floats(0.02, 0.4)),
        min_size=1,
        max_size=12,
    )
)
@examples(30)
def test_whatever_the_robot_reports_each_change_makes_no_more_than_the_debt(
    course: list[tuple[str, float, float, float]],
) -> None:
    """The operator's port is passive under every scheme, so it does not matter which one the robot's end uses."""
    operator = Operator()
    changes, before = 1, TDPA
    for scheme, height, force, seconds in course:
        changes += scheme != before
        before = scheme
        operator.control.use(scheme)
        operator.go(height, seconds, 0.03, (0.0, 0.0, force))
        contacts = len(course)  # without control each contact has its own account
        assert operator.work >= -(changes + contacts) * MOST


@pytest.mark.parametrize("scheme", [NONE, MMT])
def test_no_energy_is_handed_over_where_nobody_controls_the_robot(scheme: str) -> None:
    operator = Operator()
    operator.go(-0.005, 0.5)
    operator.control.use(scheme)
    operator.go(0.001, LONG)
    handed = operator.control.credit
    operator.go(-0.005, 0.5)
    operator.go(0.001, 0.5)
    assert operator.control.credit == handed


@pytest.mark.parametrize("scheme", [NONE, MMT])
def test_the_robot_follows_freely_where_its_port_is_not_controlled(scheme: str) -> None:
    slave = AutoSlave(SETTINGS)
    slave.use(scheme)
    here = ZERO
    for tick in range(round(2.0 * LONG / TICK)):
        target = (0.0, 0.0, -1e-6 * tick)
        here = slave.follow(target, here, TICK, 0, Quality(0.03, 0.0))
        slave.observe(here, (0.0, 0.0, 1.0))
    assert slave.active == scheme
    assert here == target
    assert slave.tank == 0.0


def test_and_no_further_than_its_tank_reaches_where_it_is() -> None:
    slave = AutoSlave(SETTINGS)
    here = ZERO
    for tick in range(1000):
        here = slave.follow((0.0, 0.0, -1e-5 * tick), here, TICK, 10, Quality(DELAY[TDPA], 0.0))
        slave.observe(here, (0.0, 0.0, 500.0 * -here[2]))
    assert 0.5 * 500.0 * here[2] ** 2 == pytest.approx(10e-4, rel=0.3)


def test_a_balance_begins_with_each_contact_and_is_bounded_by_what_a_contact_stores() -> None:
    balance = ContactBalance(SETTINGS)
    for tick in range(100_000):  # a contact that dissipates
        balance.displayed((0.0, 0.0, 1.0 if tick % 2 else 0.5))
        balance.book((0.0, 0.0, -1e-5 * tick), TICK, touches=True, stiffness=500.0)
    assert balance.level <= 3.0 * SETTINGS.level + 0.5 / 500.0 + 1e-9
    balance.displayed(ZERO)
    balance.book((0.0, 0.0, 0.0), TICK, touches=False, stiffness=500.0)
    assert balance.level == 0.0


@given(force=forces, way=steps)
def test_way_along_the_force_is_no_sliding(force: Vector, way: Vector) -> None:
    squared = dot(force, force)
    assert 0.0 <= slid(force, squared, way) <= norm(force) * norm(way) * (1.0 + 1e-9)
    along = scale(force, 1e-6)
    assert slid(force, squared, along) == 0.0
