"""The felt error: its measures beside the same computed tick by tick, percentiles, and the error without the delay."""

from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.figures.test_session import RATE, records, score
from tests.session.systems import configuration, steps
from weberlink.config import Configuration
from weberlink.control.tuning import LiveSettings
from weberlink.figures.channel import in_session
from weberlink.figures.distribution import RESOLUTION, Distribution
from weberlink.figures.felt import MARGIN_S, AlignedError
from weberlink.figures.session import Records, score_of
from weberlink.figures.tree import Median, Spread
from weberlink.session.composition.channels import force_deadband, measures_in
from weberlink.session.simulation import as_array, build_simulation

WEBERS = (0.25, 0.05)
SHAPES = ("cone", "level_crossing")


def session(shape: str) -> tuple[Configuration, Records, Records]:
    """The records of both sides of a session in which k falls to a fifth: within its deadband but for delays."""
    loaded = configuration(
        f"codec.force.deadband={{shape: {shape}}}", f"codec.force.weber={WEBERS[0]}", "codec.force.predictor=zoh",
        "slave.scene=[{shape: sphere, radius_m: 0.1, center_m: [0, 0, -0.1], stiffness_n_m: 500}]",
    )  # fmt: skip
    simulation = build_simulation(loaded)
    seen = list(steps(simulation, 1.5))
    assert simulation.master.propose({"weber": WEBERS[1]}, 1.5) is None
    seen += steps(simulation, 1.5)
    assert simulation.slave.tuning.settings == LiveSettings(WEBERS[1], "zoh")
    return loaded, as_array([step.master for step in seen]), as_array([step.slave for step in seen])


def error(loaded: Configuration, slave: Any, displayed: Any, weber: float | None = None) -> float:
    """Of a displayed force [N], in the measure of the deadband at the tick of a record."""
    deadband = force_deadband(loaded.system, float(slave["weber"]) if weber is None else weber)
    return deadband.error(tuple(displayed.tolist()), tuple(slave["raw"].tolist()))


@pytest.fixture(scope="module", params=SHAPES)
def scored(request: pytest.FixtureRequest) -> tuple[Configuration, Records, Records, dict]:
    """With the figures of the launcher."""
    loaded, master, slave = session(request.param)
    score = score_of(loaded.system)
    score.add(master, slave)
    return loaded, master, slave, score.figures().to_json()["force"]


def test_what_the_peer_holds_is_within_the_deadband_of_its_shape_and_factor(scored) -> None:
    loaded, _, slave, figures = scored
    assert figures["coding"]["violation_fraction"] == 0.0
    counted = slave[in_session(slave)]
    assert set(counted["weber"]) == set(WEBERS)
    assert all(error(loaded, one, one["decoded"]) <= one["bound"] for one in counted)
    assert (np.linalg.norm(counted["decoded"] - counted["raw"], axis=1) > counted["bound"]).any(), "a ball would not do"
    assert any(error(loaded, one, one["decoded"], WEBERS[0]) > one["bound"] for one in counted), "nor the file's k"


def test_a_recording_of_an_unknown_deadband_is_refused() -> None:
    dump = configuration().system.model_dump(mode="json")
    dump["codec"]["force"]["deadband"] = {"shape": "wedge"}
    with pytest.raises(ValueError, match="wedge"):
        measures_in(dump)
    with pytest.raises(ValueError, match="deadband"):
        measures_in({})


@given(st.lists(st.floats(0.0, 5e8), min_size=1, max_size=200), st.sampled_from([0.0, 50.0, 99.0, 99.9, 100.0]))
def test_percentiles_agree_with_nearest_rank_to_the_resolution(values: list[float], p: float) -> None:
    distribution = Distribution()
    for piece in np.array_split(np.array(values), 3):
        distribution.add(piece)
    exact = float(np.percentile(values, p, method="inverted_cdf"))
    assert distribution.count == len(values)
    assert distribution.max == max(values)
    assert distribution.percentile(p) == pytest.approx(exact, rel=RESOLUTION, abs=1.0)


def test_of_nothing_there_is_nothing_to_say() -> None:
    empty = Distribution()
    empty.add([nan, inf])
    assert empty.count == 0
    assert empty.spread() == Spread() and empty.median() == Median()


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
