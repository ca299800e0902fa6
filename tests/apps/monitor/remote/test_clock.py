"""Two hosts with clocks of their own: the slave's records in the master's time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.feeds import RATE, pieces, records
from tests.examples import examples
from weberlink.apps.monitor.remote.clock import HELD_S, MARGIN_S, MastersClock
from weberlink.system.scoring.session import Records

TICK_0 = 10.0
APART = 4321.0
"""What the slave's clock shows beyond the master's [s]."""


def slave(ticks: int, *, unheard: int = 0, early: float = 0.0) -> Records:
    """A slave that begins `early` before the master's tick 0, and hears it after `unheard` ticks."""
    made = records(ticks)
    masters_time = TICK_0 - early + made["tick"] / RATE
    made["at"] = masters_time + APART
    made["peer_at"] = masters_time - TICK_0
    made["peer_at"][:unheard] = np.nan
    made["updates_sent"] = made["tick"]
    return made


def moved(clock: MastersClock, made: list[Records]) -> Records:
    return np.concatenate([clock.move(piece) for piece in made])


@examples(40)
@given(st.lists(st.integers(0, 2000), max_size=8), st.integers(0, 500))
def test_every_record_is_dated_once_in_order_however_they_come(cuts: list[int], unheard: int) -> None:
    made = slave(2000, unheard=unheard, early=0.3)
    clock = MastersClock(RATE, TICK_0)
    clock.learn(records(50, first=7))
    dated = moved(clock, pieces(made, cuts))
    assert dated["tick"].tolist() == list(range(2000))
    assert dated["at"] == pytest.approx(made["at"] - APART, abs=1e-9)
    assert dated["updates_sent"].tolist() == list(range(2000))


def test_records_wait_until_both_clocks_are_known() -> None:
    made = slave(300, unheard=100)
    clock = MastersClock(RATE, TICK_0)
    assert not len(clock.move(made[:100]))
    assert not len(clock.move(made[100:200]))
    clock.learn(records(0))
    clock.learn(records(3))
    assert len(clock.move(made[200:])) == 300


def test_a_slave_that_waits_for_days_holds_no_more_than_seconds() -> None:
    clock = MastersClock(RATE, TICK_0)
    clock.learn(records(1))
    made = slave(30_000, unheard=29_990, early=29.0)
    dated = moved(clock, np.split(made, 30))
    assert len(dated) <= HELD_S * RATE
    assert dated["at"][0] == pytest.approx(TICK_0 - MARGIN_S, abs=2e-3)
    assert dated["updates_sent"][0] == 1  # of this session only


def test_what_an_earlier_master_was_told_is_left_out() -> None:
    made = slave(1000)
    made["peer_at"][:400] += 500.0
    clock = MastersClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = clock.move(made)
    assert dated["tick"].tolist() == list(range(400, 1000))
    assert dated["at"] == pytest.approx(made["at"][400:] - APART)
    assert dated["updates_sent"][0] == 1


def test_the_next_master_is_the_end() -> None:
    made = slave(1000)
    made["peer_at"][700:] = made["peer_at"][:300]
    clock = MastersClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = moved(clock, np.split(made, 10))
    assert dated["tick"].tolist() == list(range(700))
    assert clock.lost


def test_time_does_not_go_back_where_the_estimate_does() -> None:
    made = slave(1000)
    made["peer_at"][500:] -= 0.005
    clock = MastersClock(RATE, TICK_0)
    clock.learn(records(1))
    dated = moved(clock, np.split(made, 10))
    assert (np.diff(dated["at"]) >= 0.0).all() and len(dated) == 1000
