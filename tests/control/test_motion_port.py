"""The robot's port: work that is exact for a spring, and steps that the tank can pay for."""

from math import inf, isfinite

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.control.vectors import positions, steps, vectors
from weberlink.control.contract import LEAST_CONTACT
from weberlink.control.motion_port import CAUTION, MotionPort, affordable_share
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract

RANGE = 30.0
COUPLING = 2500.0
DEBT = 1e-4
costs = st.floats(-1.0, 1.0)
stiffnesses = st.floats(1.0, 1e6)


def cost(share: float, against: float, rise: float, jump: float) -> float:
    """Of a share of a step [J]."""
    of_rise = share * share * rise if share * share > 0.0 else 0.0
    return share * against + min(of_rise, share * jump)


@given(
    against=costs,
    rise=st.one_of(st.floats(0.0, 1.0), st.just(inf)),
    jump=st.floats(0.0, 1.0),
    tank=st.one_of(costs, st.floats(-1e-9, 1e-9)),
)
@example(against=-1.0, rise=2.0, jump=2.0, tank=1e-20)
@example(against=-1.0, rise=0.0, jump=0.0, tank=-2.0)
@example(against=-10.0, rise=9.0, jump=9.9, tank=-2.0)
def test_the_share_is_paid_for_or_gains_most_and_no_larger_one_is(
    against: float, rise: float, jump: float, tank: float
) -> None:
    """Compared with every hundredth of the step."""
    share = affordable_share(against, rise, jump, tank)
    assert 0.0 <= share <= 1.0
    paid = cost(share, against, rise, jump)
    grid = [i / 100.0 for i in range(101)]
    least = min(cost(s, against, rise, jump) for s in grid)
    if least <= tank:
        assert paid <= tank + 1e-9
    else:
        assert paid <= least + 1e-9
    if tank >= 0.0:
        assert share >= max((s for s in grid if cost(s, against, rise, jump) <= tank - 1e-9), default=0.0) - 1e-9


@given(
    normal=vectors(1.0).filter(lambda v: norm(v) > 0.1),
    stiffness=stiffnesses,
    way=st.lists(steps, max_size=40),
)
def test_work_on_a_spring_is_the_energy_that_it_stores(normal: Vector, stiffness: float, way: list[Vector]) -> None:
    """As long as the contact does not open: the force changes linearly within each step."""
    normal = scale(normal, 1.0 / norm(normal))
    port, at, done = MotionPort(inf, COUPLING, DEBT), ZERO, 0.0
    pressed = 2.0 * LEAST_CONTACT / stiffness + sum(map(norm, way))  # so deep that no way leads out
    for step in [ZERO, *way]:
        at = add(at, step)
        done += port.book(at, scale(normal, stiffness * (pressed - dot(at, normal))))
    stored = 0.5 * stiffness * ((pressed - dot(at, normal)) ** 2 - pressed**2)
    assert done == pytest.approx(stored, rel=1e-9, abs=1e-9 * stiffness * (1.0 + pressed) ** 2)


@given(at=positions, way=st.lists(steps, max_size=20), tank=st.floats(0.0, 1.0))
def test_a_step_that_costs_nothing_is_made(at: Vector, way: list[Vector], tank: float) -> None:
    port = MotionPort(0.0, COUPLING, DEBT)
    for step in way:
        at = add(at, step)
        port.book(at, ZERO)
        assert port.affordable(add(at, step), at, tank) == add(at, step)


def mean_work(way: Vector, before: Vector, after: Vector) -> float:
    """Of the robot on the environment, by the mean of two forces [J]."""
    return -0.5 * dot(add(before, after), way)


def pressed(stiffness: float, depth: float) -> MotionPort:
    """A port that moved into a wall on z to this depth, and estimated its stiffness."""
    port = MotionPort(RANGE, COUPLING, DEBT)
    port.book(ZERO, ZERO)
    for share in (0.5, 1.0):
        port.book((0.0, 0.0, -share * depth), (0.0, 0.0, stiffness * share * depth))
    return port


@given(
    stiffness=stiffnesses,
    force=st.floats(0.01, RANGE),
    step=steps,
    tank=st.floats(0.0, 0.05),
    stiffer=st.floats(0.0, CAUTION),
)
def test_no_step_costs_more_than_the_tank_at_a_wall_that_is_not_much_stiffer_than_it_was(
    stiffness: float, force: float, step: Vector, tank: float, stiffer: float
) -> None:
    depth = force / stiffness
    if depth <= 4e-6:  # too short a way to have shown anything
        depth, stiffness = 4e-6, force / 4e-6
    port = pressed(stiffness, depth)
    here = (0.0, 0.0, -depth)
    there = port.affordable(add(here, step), here, tank)
    then = min(RANGE, max(0.0, force + stiffer * stiffness * (here[2] - there[2])))
    spared = tank if force > LEAST_CONTACT else max(tank, DEBT)
    assert mean_work(subtract(there, here), (0.0, 0.0, force), (0.0, 0.0, then)) <= spared + 1e-9


@given(
    step=steps.filter(lambda v: norm(v) > 1e-9),
    tank=st.floats(-0.01, 0.05),
    then=vectors(1.0).filter(lambda v: norm(v) > 0.1),
    stiffness=stiffnesses,
)
def test_no_step_costs_more_than_the_tank_or_the_debt_where_a_wall_may_be_anywhere(
    step: Vector, tank: float, then: Vector, stiffness: float
) -> None:
    """The wall begins here, the robot is as stiff as stated, and the force may have any direction."""
    port = MotionPort(RANGE, stiffness, DEBT)
    port.book(ZERO, ZERO)
    way = port.affordable(step, ZERO, tank)
    met = min(RANGE, CAUTION * stiffness * norm(way))
    assert mean_work(way, ZERO, scale(then, met / norm(then))) <= max(tank, DEBT) + 1e-9


@pytest.mark.parametrize("stiffness", [1e4, 1e6])
def test_a_robot_that_is_stiffer_than_stated_is_noticed_in_a_few_contacts(stiffness: float) -> None:
    """A force at the range of the sensor shows less than the whole stiffness."""
    port = MotionPort(RANGE, COUPLING, DEBT)
    for _ in range(4):
        port.book(ZERO, ZERO)
        (_, _, z) = port.affordable((0.0, 0.0, -1e-3), ZERO, 0.0)
        cost = 0.5 * min(RANGE, -stiffness * z) * -z
        port.book((0.0, 0.0, z), (0.0, 0.0, min(RANGE, -stiffness * z)))
    assert cost <= DEBT


@given(
    stiffness=st.floats(100.0, 1e6),
    depths=st.lists(st.floats(-0.002, 0.002), max_size=40),
)
def test_a_wall_never_seems_to_give_back_more_than_it_was_given(stiffness: float, depths: list[float]) -> None:
    """With steps of any size, also if the contact opens within a step or the sensor saturates."""
    port, done = MotionPort(RANGE, COUPLING, DEBT), 0.0
    port.book(ZERO, ZERO)
    for depth in [*depths, -0.001]:
        done += port.book((0.0, 0.0, -depth), (0.0, 0.0, min(RANGE, max(0.0, stiffness * depth))))
    assert done >= -1e-9


@given(stiffness=st.floats(100.0, 1e5), step=steps, tank=st.floats(0.0, 0.01))
def test_sliding_is_kept_where_pressing_is_not_affordable(stiffness: float, step: Vector, tank: float) -> None:
    port = pressed(stiffness, 1e-3)
    here = (0.0, 0.0, -1e-3)
    step = (step[0], step[1], min(-1e-9, step[2]))
    there = subtract(port.affordable(add(here, step), here, tank), here)
    assert there[:2] == pytest.approx(step[:2], abs=1e-15)
    assert step[2] - 1e-15 <= there[2] <= 1e-15


@given(stiffness=st.floats(100.0, 1e5), step=steps)
def test_a_deep_debt_lets_the_robot_be_pushed_out(stiffness: float, step: Vector) -> None:
    port = pressed(stiffness, 1e-3)
    here = (0.0, 0.0, -1e-3)
    there = port.affordable(add(here, step), here, -1.0)
    then = max(0.0, stiffness * -there[2])
    assert there[2] >= here[2]
    assert port.book(there, (0.0, 0.0, then)) <= 1e-12


@given(step=steps, above=st.floats(0.0, 1e-3))
def test_a_robot_in_debt_that_has_lifted_off_stays_outside_and_free_along_the_surface(
    step: Vector, above: float
) -> None:
    port = pressed(1e4, 1e-3)
    here = (0.0, 0.0, above)
    port.book(here, ZERO)
    step = scale(step, min(1.0, 4e-5 / max(norm(step), 1e-9)))
    there = port.affordable(add(here, step), here, -1.0)
    assert there[2] >= min(0.0, above + step[2])
    assert there[2] >= -1e-12
    assert there[:2] == pytest.approx(step[:2], abs=1e-12)


@given(st.lists(st.tuples(vectors(1e30), vectors(1e30), vectors(1e30), st.floats(-1e30, 1e30)), max_size=8))
def test_nothing_finite_makes_it_raise_or_infinite(ticks: list[tuple[Vector, Vector, Vector, float]]) -> None:
    port = MotionPort(RANGE, COUPLING, DEBT)
    for position, force, target, tank in ticks:
        assert all(map(isfinite, port.affordable(target, position, tank)))
        assert isfinite(port.book(position, force))


def test_reset_forgets() -> None:
    port = pressed(500.0, 0.01)
    port.reset()
    fresh = MotionPort(RANGE, COUPLING, DEBT)
    assert port.book((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)) == 0.0
    fresh.book((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    step = (1.0, 0.0, -0.001)
    assert port.affordable(step, (1.0, 0.0, 0.0), 1e-4) == fresh.affordable(step, (1.0, 0.0, 0.0), 1e-4)


def test_an_overdrawn_robot_yields_to_the_wall_until_it_is_even() -> None:
    stiffness, debt = 1e4, 2e-3
    port = pressed(stiffness, 1e-3)
    here, target = (0.0, 0.0, -1e-3), (0.0, 0.0, -1e-2)
    tank = -debt
    for _ in range(200):
        here = port.affordable(target, here, tank)
        tank -= port.book(here, (0.0, 0.0, max(0.0, -stiffness * here[2])))
    assert here[2] > -1e-3
    assert tank == pytest.approx(0.0, abs=0.1 * debt)


def test_the_noise_of_a_sensor_is_no_contact() -> None:
    """Otherwise the stiffness of a wall and the energy that it took would never be forgotten."""
    port = pressed(1e5, 1e-4)
    for height in (0.001, 0.002):
        port.book((0.0, 0.0, height), (0.0, 0.0, 0.9 * LEAST_CONTACT))
    # A new wall may be anywhere, and the robot turned out to be as stiff as this one.
    here = (0.0, 0.0, 0.002)
    there = port.affordable((0.0, 0.0, 0.0), here, 1e-3)
    assert 0.5 * CAUTION * 1e5 * (here[2] - there[2]) ** 2 == pytest.approx(1e-3, rel=0.05)
