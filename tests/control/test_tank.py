"""Energy of two tanks and of what travels between them, whatever the link does."""

from math import isclose

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.control.contract import CREDIT_STEP
from weberlink.control.energy import EnergyTank

MOST = 100.0
joules = st.floats(-MOST, MOST)
sides = st.integers(0, 1)
operations = st.one_of(
    st.tuples(st.just("work"), sides, joules),
    st.tuples(st.just("hand over"), sides, joules),
    st.tuples(st.just("tell"), sides, st.integers(0, 50)),
    st.tuples(st.just("spill"), sides, st.floats(0.0, MOST)),
    st.tuples(st.just("forgive"), sides, st.floats(0.0, 2.0)),
)


class TwoTanks:
    """Both ends, and every sum that one of them ever told: the link delivers any, in any order, or none."""

    def __init__(self) -> None:
        self.tanks = EnergyTank(), EnergyTank()
        self.told: tuple[list[int], list[int]] = [0], [0]
        self.heard = [0, 0]
        self.work = 0.0

    def do(self, what: str, side: int, amount: float) -> None:
        tank = self.tanks[side]
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
        else:
            tank.forgive(amount)
        self.told[side].append(tank.credit)

    @property
    def lacking(self) -> float:
        """What went in, and is in no tank, not on the way and not spilled [J]."""
        kept = sum(tank.level + tank.spilled for tank in self.tanks)
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


@given(st.lists(st.floats(0.0, 3.0 * CREDIT_STEP), max_size=200))
def test_many_small_amounts_are_not_lost_by_rounding(amounts: list[float]) -> None:
    giver, taker = EnergyTank(), EnergyTank()
    for amount in amounts:
        giver.hand_over(amount)
        taker.receive(giver.credit)
    assert -1e-12 <= sum(amounts) - taker.level <= CREDIT_STEP + 1e-12
    assert isclose(giver.level, -sum(amounts), abs_tol=1e-12)


@given(joules, st.floats(0.0, MOST), st.floats(0.0, 2.0))
def test_only_what_is_above_the_cap_is_spilled_and_only_a_debt_is_forgiven(
    level: float, cap: float, share: float
) -> None:
    tank = EnergyTank()
    tank.level = level
    tank.spill(cap)
    assert tank.level == min(level, cap)
    tank.forgive(share)
    assert tank.level == (min(level, cap) if level >= 0.0 else pytest.approx(level * (1.0 - min(1.0, share))))


def test_reset_forgets_what_was_heard() -> None:
    tank = EnergyTank()
    tank.receive(100)
    tank.hand_over(1.0)
    tank.spill(0.0)
    tank.reset()
    assert (tank.level, tank.credit, tank.spilled) == (0.0, 0, 0.0)
    tank.receive(1)
    assert tank.level == CREDIT_STEP
