"""Energy tanks and the credit between them, the prediction of credit, and the drag that fills a tank."""

from math import isfinite

from hypothesis import example, given
from hypothesis import strategies as st
from pytest import approx

from tests.control.vectors import forces, steps, vectors
from tests.examples import examples
from weberlink.control.contract import CREDIT_STEP
from weberlink.control.energy import (
    LONGEST,
    STRONGEST,
    CreditPrediction,
    EnergyTank,
    GripGrant,
    LevelDrag,
    yielding_share,
)
from weberlink.control.force_port import LEAST_STEP, ForcePort
from weberlink.geometry.vector import ZERO, Vector, dot, norm, subtract

LARGEST = 100.0
"""Largest work in a test [J]."""
MOST = 1e-3
"""Largest prediction [J]."""
LEVEL = 0.05
TICK = 1e-3

joules = st.floats(-LARGEST, LARGEST)
sides = st.integers(0, 1)
operations = st.one_of(
    st.tuples(st.just("work"), sides, joules),
    st.tuples(st.just("hand over"), sides, joules),
    st.tuples(st.just("tell"), sides, st.integers(0, 50)),
    st.tuples(st.just("spill"), sides, st.floats(0.0, LARGEST)),
    st.tuples(st.just("forgive"), sides, st.just(0.0)),
)


class TwoTanks:
    """Both ends, and every credit that they sent: the link delivers any of them, in any order, or none."""

    def __init__(self) -> None:
        self.tanks = EnergyTank(), EnergyTank()
        self.told: tuple[list[int], list[int]] = [0], [0]
        self.heard = [0, 0]
        self.work = self.given_up = 0.0

    def do(self, what: str, side: int, amount: float) -> None:
        tank = self.tanks[side]
        before = tank.level
        if what == "work":
            tank.level += amount
            self.work += amount
        elif what == "hand over":
            tank.hand_over(amount)
        elif what == "tell":
            sums = self.told[side]
            told = sums[int(amount) % len(sums)]
            self.tanks[1 - side].receive(told)
            self.heard[1 - side] = max(self.heard[1 - side], told)
        elif what == "spill":
            tank.spill(amount)
            self.given_up += before - tank.level
        else:
            tank.forgive()
            self.given_up += before - tank.level
        self.told[side].append(tank.credit)

    @property
    def lacking(self) -> float:
        """Energy that went in, and is in no tank, not on its way and not given up [J]."""
        kept = sum(tank.level for tank in self.tanks) + self.given_up
        travelling = sum(tank.credit - self.heard[1 - side] for side, tank in enumerate(self.tanks))
        return self.work - kept - travelling * CREDIT_STEP


@given(st.lists(operations, max_size=60))
def test_no_loss_order_or_repetition_makes_energy_and_rounding_holds_back_less_than_a_unit_a_side(
    done: list[tuple[str, int, float]],
) -> None:
    both = TwoTanks()
    for what, side, amount in done:
        before = [tank.credit for tank in both.tanks]
        both.do(what, side, amount)
        assert all(tank.credit >= earlier for tank, earlier in zip(both.tanks, before, strict=True))
        assert -1e-9 <= both.lacking <= 2.0 * CREDIT_STEP + 1e-9


@given(joules, st.floats(0.0, LARGEST))
def test_only_what_is_above_the_cap_is_spilled_and_only_a_debt_is_forgiven(level: float, cap: float) -> None:
    tank = EnergyTank()
    tank.level = level
    tank.spill(cap)
    assert tank.level == min(level, cap)
    tank.forgive()
    assert tank.level == max(0.0, min(level, cap))


small = st.floats(-1e-2, 1e-2)


@example(0.0, 5e-324, 0.0, 0.0078125)
@given(small, st.floats(0.0, 1e-2), small, st.floats(0.0, 1e-2))
def test_the_yielding_share_is_the_largest_within(along: float, rise: float, before: float, most: float) -> None:
    def leaves(share: float) -> float:
        return share * along + share * max(0.0, share * rise - before)

    share = yielding_share(along, rise, before, most)
    assert 0.0 <= share <= 1.0
    assert leaves(share) <= most + 1e-12
    if share < 1.0:
        assert leaves(min(1.0, share * (1.0 + 1e-6) + 1e-9)) >= most - 1e-12


@example([(1, 5e-324), (0, 0.0)])
@given(st.lists(st.tuples(st.integers(0, 1000), st.one_of(st.floats(0.0, 0.1), st.just(5e-324))), max_size=60))
def test_never_ahead_by_more_than_the_most_and_never_behind(ticks: list[tuple[int, float]]) -> None:
    prediction, credit = CreditPrediction(MOST), 0
    for more, elapsed in ticks:
        credit += more
        ahead = prediction.ahead(credit, elapsed)
        assert isfinite(ahead)
        assert 0.0 <= ahead <= MOST


@given(st.lists(st.integers(1, 100), min_size=1, max_size=20), st.integers(0, 200))
def test_nothing_is_predicted_long_after_the_last_news(news: list[int], ticks: int) -> None:
    prediction, credit = CreditPrediction(MOST), 0
    for more in news:
        credit += more
        prediction.ahead(credit, TICK)
    since = 0.0
    for _ in range(ticks):
        since += TICK
        ahead = prediction.ahead(credit, TICK)
        if since > LONGEST + TICK:
            assert ahead == 0.0


def test_between_news_it_goes_on_at_the_rate_of_the_last_two_sums() -> None:
    prediction = CreditPrediction(MOST)
    for _ in range(3):
        known = prediction.ahead(0, 0.01)
        assert known == 0.0
    assert prediction.ahead(3, 0.01) == 0.0
    rate = 3 * CREDIT_STEP / 0.04
    assert prediction.ahead(3, 0.002) == approx(rate * 0.002)
    assert prediction.ahead(3, 0.002) == approx(rate * 0.004)


@given(force=forces, way=steps, elapsed=st.floats(0.0, 0.1), tank=st.floats(-1.0, 1.0), mobility=st.floats(1e-9, 1e-2))
def test_drag_goes_against_the_way_and_is_bounded(
    force: Vector, way: Vector, elapsed: float, tank: float, mobility: float
) -> None:
    drag = subtract(LevelDrag(5.0, LEVEL).added(force, way, elapsed, tank, mobility), force)
    assert dot(drag, way) <= 1e-12
    assert norm(drag) <= STRONGEST + 1e-9


@given(force=forces, way=steps, tank=st.floats(LEVEL, 1.0))
def test_a_full_tank_drags_nothing(force: Vector, way: Vector, tank: float) -> None:
    assert LevelDrag(5.0, LEVEL).added(force, way, TICK, tank, 1e-5) == force


@given(
    force=vectors(1e30),
    way=vectors(1e30),
    elapsed=st.floats(0.0, 1e3),
    tank=st.floats(-1e30, 1e30),
    mobility=st.floats(1e-30, 1e30),
)
def test_nothing_finite_makes_it_raise_or_infinite(
    force: Vector, way: Vector, elapsed: float, tank: float, mobility: float
) -> None:
    assert all(map(isfinite, LevelDrag(5.0, LEVEL).added(force, way, elapsed, tank, mobility)))


@given(mass=st.floats(0.001, 0.1), speed=st.floats(0.001, 0.5), damping=st.floats(1.0, 100.0))
@examples(40)
def test_a_free_mass_comes_to_rest_and_gains_no_speed(mass: float, speed: float, damping: float) -> None:
    """From 1 g on. A drag below `LEAST_STEP` does not show how light a hand is; the first tick does."""
    drag, port = LevelDrag(damping, LEVEL), ForcePort(TICK, LEVEL)
    at, start, swing = 0.0, speed, STRONGEST * TICK / mass
    for _ in range(600):
        port.move((at, 0.0, 0.0))
        (force, _, _) = drag.added(ZERO, port.way, TICK, 0.0, port.mobility)
        port.hold((force, 0.0, 0.0))
        at += speed * TICK + 0.5 * force / mass * TICK * TICK
        speed += force / mass * TICK
        assert abs(speed) <= max(start, swing)
    assert abs(speed) <= max(0.02 * start, LEAST_STEP / damping)


@given(
    begin=st.floats(-1.0, 1.0),
    ticks=st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 1.0), st.floats(-1.0, 1.0)), min_size=1),
)
def test_grip_pays_for_what_the_contact_stores_and_no_more(
    begin: float, ticks: list[tuple[float, float, float]]
) -> None:
    grant, level, granted = GripGrant(), begin, 0.0
    for number, (stored, share, work) in enumerate(ticks):
        level += work
        raised = grant.raised(level, stored, share)
        paid = max(0.0, level) if number == 0 else level  # a debt from before is forgiven
        granted += raised - paid
        assert raised >= paid
        most = max(before for before, _, _ in ticks[: number + 1])
        assert raised >= min(share * stored, paid + most - (granted - (raised - paid))) - 1e-9
        assert granted <= most + 1e-9
        level = raised


@given(stored=st.floats(0.0, 10.0))
def test_hand_that_pressed_itself_is_given_nothing(stored: float) -> None:
    grant = GripGrant()
    for share in (0.0, 0.5, 1.0):
        assert grant.raised(stored, stored, share) == stored
