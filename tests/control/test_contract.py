"""The contract of both ends of every scheme of the table, with any input."""

from math import isfinite
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.control.wall import SETTINGS, TICK, Wall
from tests.examples import examples
from weberlink.codec.predictors.geometry_based import Sphere
from weberlink.codec.sample import UNKNOWN
from weberlink.control.contract import CREDIT_STEP, MasterControl, SlaveControl
from weberlink.control.table import SCHEMES, build_master_control, build_slave_control
from weberlink.geometry.vector import ZERO, Vector, scale

every = pytest.mark.parametrize("name", SCHEMES)
every_end = pytest.mark.parametrize("build", [build_master_control, build_slave_control])


def inputs(most: float, force: float) -> st.SearchStrategy[list[tuple[Any, ...]]]:
    """Ticks: what is received, positions, the time, credit and round trip, forces, and whether one is refuted."""
    places, forces = (st.tuples(*[st.floats(-size, size)] * 3) for size in (most, force))
    stiffness = st.floats(1.0, 1e6)
    balls = st.builds(Sphere, st.just((0.0, 0.0, -0.05)), st.just(0.05), stiffness, st.just((0.0, 0.0, 1.0)))
    surfaces = st.none() | st.builds(Wall, stiffness) | balls
    news = st.none() | st.tuples(surfaces, forces, places)
    link = st.tuples(st.floats(0.0, 0.5), st.integers(0, 10**6), st.none() | st.floats(0.0, 2.0))
    return st.lists(
        st.tuples(news, places, link, forces, st.floats(0.0, 1.0), st.booleans(), st.none() | places), max_size=12
    )


ORDINARY = inputs(0.1, 30.0)
WILD = inputs(1e30, 1e30) | inputs(1e-300, 1.0)


def run(control: MasterControl | SlaveControl, ticks: list[tuple[Any, ...]]) -> list[object]:
    """The outputs of an end in these ticks; asserts that they are valid."""
    out: list[object] = []
    credit, here = control.credit, ZERO
    for news, position, (elapsed, peer_credit, rtt), force, share, refuted, moved in ticks:
        if isinstance(control, MasterControl):
            if news is not None:
                control.learn(*news)
            control.observe(position, elapsed, 0.0, peer_credit, rtt)
            assert all(map(isfinite, control.command(position)))
            assert control.stiffness > 0.0
            given = control.render(force)
            control.displayed(scale(given, share))
            if refuted:
                control.refute()
        else:
            given = control.follow(position, here, elapsed, peer_credit, rtt)
            here = given if moved is None else moved  # a robot may also be elsewhere than `follow` allows
            control.observe(here, force)
        assert all(map(isfinite, (*given, control.energy)))
        assert control.credit >= credit >= 0
        credit = control.credit
        out.append((given, control.energy, credit))
    return out


@every
@every_end
@given(ticks=WILD)
@examples(15)
def test_nothing_finite_upsets_a_side(name: str, build: Any, ticks: list[tuple[Any, ...]]) -> None:
    run(build(name, SETTINGS), ticks)


@every
@every_end
@given(before=ORDINARY, after=ORDINARY)
@examples(10)
def test_a_reset_side_is_as_a_new_one_and_a_resumed_one_has_nothing_from_before(
    name: str, build: Any, before: list[tuple[Any, ...]], after: list[tuple[Any, ...]]
) -> None:
    control = build(name, SETTINGS)
    run(control, before)
    credit = control.credit
    control.resume(before[-1][2][1] if before else 0)
    assert control.energy <= 0.0
    assert control.credit == credit
    if isinstance(control, MasterControl):
        assert control.render(ZERO) == ZERO
    run(control, after)
    control.reset()
    assert run(control, after) == run(build(name, SETTINGS), after)


@every
def test_the_robots_end_tells_what_the_scene_gave_if_the_scheme_carries_credit(name: str) -> None:
    """A wall that pushes a robot out gives energy; one that takes some first gives the rest only."""
    slave, force = build_slave_control(name, SETTINGS), (0.0, 0.0, 4.0)
    told = []
    for step in (*range(0, -11, -1), *range(-10, 41)):
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


@pytest.mark.parametrize("name", [name for name, scheme in SCHEMES.items() if not scheme.reads_position])
def test_a_scheme_that_does_not_read_positions_does_the_same_without_them(name: str) -> None:
    def displayed(position: Vector | None) -> list[Vector]:
        end, shown = build_master_control(name, SETTINGS), []
        for tick in range(50):
            force, hand = (0.0, 0.0, 0.1 * tick), (0.0, 0.0, -1e-4 * tick)
            end.learn(Wall() if tick % 3 == 1 else None, force, position or hand)
            end.observe(hand, TICK, tick, 10 * tick, 0.01)
            shown += [end.command(hand), end.render(force)]
            end.displayed(shown[-1])
        return shown

    assert displayed(None) == displayed(UNKNOWN)
