"""The felt error without the delay, against a search of every lag."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.figures.test_session import RATE, records, score
from weberlink.figures.felt import MARGIN_S, AlignedError

TICK = 0.01
"""Long, so that a second is few ticks [s]."""


def walk(rng: np.random.Generator, ticks: int) -> np.ndarray:
    return np.cumsum(rng.normal(size=(ticks, 3)), axis=0)


def searched(ticks: np.ndarray, felt: np.ndarray, robot: np.ndarray, reach: int) -> float:
    """The least RMS over all lags with half of the pairs, by the definition."""
    place = {int(tick): index for index, tick in enumerate(ticks)}
    found = []
    for lag in range(-reach, reach + 1):
        pairs = [(i, place[tick - lag]) for tick, i in place.items() if tick - lag in place]
        if len(pairs) > 0.5 * len(ticks):
            ours, theirs = map(list, zip(*pairs, strict=True))
            found.append(float(np.square(felt[ours] - robot[theirs]).sum(axis=1).mean() ** 0.5))
    return min(found)


@examples(30)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 2000),
    lag=st.integers(-40, 40),
    missing=st.floats(0.0, 0.3),
    pieces=st.integers(1, 20),
)
def test_the_best_lag_is_that_of_an_exhaustive_search(
    seed: int, count: int, lag: int, missing: float, pieces: int
) -> None:
    rng = np.random.default_rng(seed)
    whole = walk(rng, count + 100)
    kept = np.flatnonzero(rng.uniform(size=count) >= missing)
    felt = whole[kept + 50] + rng.normal(scale=0.1, size=(len(kept), 3))
    robot = whole[kept + 50 + lag]
    aligned = AlignedError(TICK, 3)
    for piece in np.array_split(np.arange(len(kept)), pieces):
        aligned.add(kept[piece] + 7, felt[piece], robot[piece])
    found = aligned.best(0.4)
    assert (found is None) == (len(kept) == 0)
    if found is not None:
        reach = round((0.4 + MARGIN_S) / TICK)
        assert found[0] == pytest.approx(searched(kept, felt, robot, reach), abs=1e-3)
        assert aligned.best(0.4) == found, "to look changes nothing"
        if count > 500 and missing < 0.1:
            assert found[1] == pytest.approx(lag * TICK)


def test_a_side_that_begins_anew_and_a_long_gap_cost_nothing() -> None:
    rng = np.random.default_rng(3)
    aligned = AlignedError(TICK, 3)
    for first in (0, 1000, 10**9, 5):
        whole = walk(rng, 600)
        aligned.add(first + np.arange(580), whole[:580], whole[8:588])
    error, lag = aligned.best(0.2) or (np.nan, np.nan)
    assert (error, lag) == (pytest.approx(0.0, abs=1e-4), pytest.approx(0.08))


def test_the_summary_tells_what_is_left_without_the_delay() -> None:
    master, slave = records(3000), records(3000)
    slave["raw"] = walk(np.random.default_rng(1), 3000)
    master["output"][52:] = slave["raw"][:-52]
    master["ramping"][:52] = 1
    master["rtt_us"] = 2e3 * 52
    force = score(master, slave, pieces=3)["force"]
    assert force["error_rms"] > 5.0
    assert force["aligned_rms"] == pytest.approx(0.0, abs=1e-3)
    assert force["aligned_lag_s"] == pytest.approx(52.0 / RATE)
