"""The contract of both ends of every scheme of the table, with any input."""

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.teleoperation import ACCOUNT, TICK
from tests.control.walls import Ball, Wall
from tests.examples import examples
from weberlink.control.contract import CREDIT_STEP, SchemeParameters, WallModel
from weberlink.control.ends import MasterControl, SlaveControl
from weberlink.control.table import SCHEMES, build_master_control, build_slave_control
from weberlink.geometry.vector import ZERO, Vector

SETTINGS = SchemeParameters(TICK, 2500.0, ACCOUNT)
every = pytest.mark.parametrize("name", SCHEMES)
trips = st.one_of(st.none(), st.floats(0.0, 2.0))
surfaces = st.one_of(st.none(), st.builds(Wall, st.floats(1.0, 1e6)), st.builds(Ball, st.floats(1.0, 1e6)))


class MasterTick(NamedTuple):
    """The inputs of the operator's end in a tick."""

    news: tuple[WallModel | None, Vector, Vector] | None
    position: Vector
    elapsed: float
    peer_credit: int
    rtt: float | None
    force: Vector
    share: float
    """Share of the rendered force that is displayed."""
    refuted: bool
    """Whether what is displayed lasts without a contact."""


class SlaveTick(NamedTuple):
    """The inputs of the teleoperator's end in a tick."""

    target: Vector
    elapsed: float
    peer_credit: int
    rtt: float | None
    moved: Vector
    """Commanded position if its x is not positive; otherwise the robot goes where `follow` allows [m]."""
    force: Vector


def vectors(most: float) -> st.SearchStrategy[Vector]:
    """Components from -most to most."""
    return st.tuples(*[st.floats(-most, most)] * 3)


def inputs(position: st.SearchStrategy[Vector], force: st.SearchStrategy[Vector]) -> dict[str, st.SearchStrategy[Any]]:
    """Ticks of each end."""
    elapsed, credit = st.floats(0.0, 0.5), st.integers(0, 10**6)
    news = st.one_of(st.none(), st.tuples(surfaces, force, position))
    share, refuted = st.floats(0.0, 1.0), st.booleans()
    master = st.builds(MasterTick, news, position, elapsed, credit, trips, force, share, refuted)
    slave = st.builds(SlaveTick, position, elapsed, credit, trips, position, force)
    return {"master": st.lists(master, max_size=12), "slave": st.lists(slave, max_size=12)}


ORDINARY = inputs(vectors(0.1), vectors(30.0))
WILD = inputs(*[st.one_of(vectors(1e30), vectors(1.0), vectors(1e-300))] * 2)


def run_master(control: MasterControl, ticks: list[MasterTick]) -> list[object]:
    """The outputs of an end in these ticks; asserts that they are valid."""
    out: list[object] = []
    credit = control.credit
    for tick in ticks:
        if tick.news is not None:
            control.learn(*tick.news)
        control.observe(tick.position, tick.elapsed, 0.0, tick.peer_credit, tick.rtt)
        assert all(map(isfinite, control.command(tick.position)))
        assert control.stiffness > 0.0
        force = control.render(tick.force)
        assert all(map(isfinite, force))
        control.displayed((force[0] * tick.share, force[1] * tick.share, force[2] * tick.share))
        if tick.refuted:
            control.refute()
        check(control, credit)
        credit = control.credit
        out.append((force, control.energy, credit))
    return out


def run_slave(control: SlaveControl, ticks: list[SlaveTick]) -> list[object]:
    out: list[object] = []
    credit, here = control.credit, (0.0, 0.0, 0.0)
    for tick in ticks:
        goal = control.follow(tick.target, here, tick.elapsed, tick.peer_credit, tick.rtt)
        assert all(map(isfinite, goal))
        here = goal if tick.moved[0] > 0.0 else tick.moved
        control.observe(here, tick.force)
        check(control, credit)
        credit = control.credit
        out.append((goal, control.energy, credit))
    return out


def check(control: MasterControl | SlaveControl, credit: int) -> None:
    assert isfinite(control.energy)
    assert control.credit >= credit >= 0


BUILD: dict[str, Callable[[str, SchemeParameters], Any]] = {
    "master": build_master_control,
    "slave": build_slave_control,
}
RUN: dict[str, Callable[[Any, Any], list[object]]] = {"master": run_master, "slave": run_slave}
ends = pytest.mark.parametrize("end", BUILD)


@every
@ends
@given(data=st.data())
@examples(15)
def test_nothing_finite_upsets_a_side(name: str, end: str, data: st.DataObject) -> None:
    RUN[end](BUILD[end](name, SETTINGS), data.draw(WILD[end]))


@every
@ends
@given(data=st.data())
@examples(10)
def test_a_reset_side_is_as_a_new_one(name: str, end: str, data: st.DataObject) -> None:
    before, after = data.draw(ORDINARY[end]), data.draw(ORDINARY[end])
    control = BUILD[end](name, SETTINGS)
    RUN[end](control, before)
    control.reset()
    assert RUN[end](control, after) == RUN[end](BUILD[end](name, SETTINGS), after)


@every
@ends
@given(data=st.data())
@examples(10)
def test_a_resumed_side_has_no_energy_and_force_from_before(name: str, end: str, data: st.DataObject) -> None:
    before, after = data.draw(ORDINARY[end]), data.draw(ORDINARY[end])
    control = BUILD[end](name, SETTINGS)
    RUN[end](control, before)
    credit = control.credit
    control.resume(before[-1].peer_credit if before else 0)
    assert control.energy <= 0.0
    assert control.credit == credit
    if end == "master":
        assert control.render((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    RUN[end](control, after)


@every
def test_the_robots_end_tells_what_the_scene_gave_if_the_scheme_carries_credit(name: str) -> None:
    """A wall that pushes a robot out gives energy; one that takes some first gives the rest only."""
    slave, force = build_slave_control(name, SETTINGS), (0.0, 0.0, 4.0)
    way, told = [*range(0, -11, -1), *range(-10, 41)], []
    for step in way:
        here = (0.0, 0.0, 1e-3 * step)
        slave.follow(here, here, TICK, 0, 0.05)
        slave.observe(here, force)
        told.append(slave.credit)
    assert max(told[:21]) == 0, "until the scene has given back what it took"
    assert told[-1] * CREDIT_STEP == pytest.approx(0.04 * 4.0 if SCHEMES[name].carries_credit else 0.0, abs=2e-4)


def test_credit_from_before_an_interruption_cannot_be_spent_after_it() -> None:
    control = build_master_control("bounded", SETTINGS)
    control.resume(5000)
    control.observe(ZERO, 0.0, 0.0, 5000, 0.1)
    assert control.energy == 0.0
    control.observe(ZERO, 0.0, 0.0, 5100, 0.1)
    assert control.energy == pytest.approx(100 * CREDIT_STEP)
