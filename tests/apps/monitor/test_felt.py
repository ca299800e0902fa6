"""The felt error that is drawn against the figures, which keep no rows: the same join, the same ticks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.feeds import BANK, RATE, pieces, records
from tests.examples import examples
from weberlink.apps.monitor.felt import LONGEST_WAIT, FeltError, message
from weberlink.protocol.states import State
from weberlink.system.scoring.session import SessionScore


@examples(40)
@given(
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.sampled_from((0.0, 2e-4, 4.9e-4, 5.1e-4, 8e-4)),
)
def test_pairs_are_those_of_the_figures(cuts: list[int], others: list[int], phase: float) -> None:
    master, slave = records(900, phase=phase, seed=1), records(900, seed=2)
    slave["state"][200:300] = State.SILENT.value
    master["ramping"][400:450] = 1
    score, felt = SessionScore(RATE, BANK), FeltError(RATE)
    errors: list[float] = []
    for one, other in zip(pieces(master, cuts), pieces(slave, others), strict=True):
        score.add(one, other)
        told = message(*felt.add(one, other), origin=10.0)
        errors += told["error_n"]
        assert told["t"] == sorted(told["t"])
        assert told["jnd"] == pytest.approx([error / 1.5 for error in told["error_n"]], abs=1e-4)
    force = score.summary()["force"]
    assert max(errors) == pytest.approx(force["error_max"], abs=1e-5)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(force["error_rms"], abs=1e-5)
    assert np.mean(np.array(errors) > 1.5) == pytest.approx(force["violation_fraction"], abs=2 / len(errors))


def test_a_bound_of_zero_is_no_unit() -> None:
    master, slave = records(10), records(10)
    assert message(*FeltError(RATE).add(master, slave), origin=10.0)["jnd"] == [None] * 9


def test_a_side_that_runs_alone_for_long_is_let_go() -> None:
    felt = FeltError(RATE)
    for first in range(0, 20_000, 1000):
        assert not len(felt.add(records(0), records(1000, first=first))[0])
    _, pairs = felt.add(records(1000, first=17_000), records(0))
    assert (pairs["tick"][0], pairs["tick"][-1]) == (20_000 - LONGEST_WAIT, 17_998)
