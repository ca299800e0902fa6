"""The felt error: in the measure of the deadband, beside the same computed tick by tick, and without the delay."""

from dataclasses import asdict
from itertools import groupby
from math import inf, log, nan, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from plugins.figures.tests.test_session import RATE, records, score
from tests.examples import examples
from tests.records import ticks
from tests.session.kinds import HAND, run
from tests.session.systems import configuration
from weberlink.codec.deadband import DEADBANDS
from weberlink.protocol.states import State
from weberlink.session.composition.channels import force_deadband
from weberlink.session.tuning import LiveSettings
from weberlink.telemetry.record import FORCE, RELEASED
from weberlink_figures.channel import in_session, measures_in
from weberlink_figures.distribution import RESOLUTION, Distribution
from weberlink_figures.felt import MARGIN_S, AlignedError, JumpsOfRecords, QualityStatistics, Threshold
from weberlink_figures.session import score_of
from weberlink_figures.tree import Median, Spread

WEBERS = (0.25, 0.05)


@pytest.mark.parametrize("shape", [name for name, kind in DEADBANDS.items() if not kind.is_ball])
def test_what_the_peer_holds_is_within_the_deadband_of_its_shape_and_factor(shape: str) -> None:
    """Also once k falls to a fifth."""
    overrides = (
        f"codec.force.deadband={{shape: {shape}}}", f"codec.force.weber={WEBERS[0]}", "codec.force.predictor=zoh",
        "slave.scene=[{shape: sphere, radius_m: 0.1, center_m: [0, 0, -0.1], stiffness_n_m: 500}]",
    )  # fmt: skip
    system = configuration(*overrides).system
    ran = run(HAND, 3.0, *overrides, acts={1.5: lambda each: each.master.propose({"weber": WEBERS[1]}, 1.5)})
    assert ran.simulation.slave.tuning.settings == LiveSettings(WEBERS[1], "zoh")
    scored = score_of(system)
    scored.add(ran.master, ran.slave)
    assert scored.figures().to_json()["force"]["coding"]["violation_fraction"] == 0.0

    def error(record: Any, weber: float) -> float:
        deadband = force_deadband(system.codec.force, system.tick_period, weber)
        return deadband.error(tuple(record["decoded"][FORCE].tolist()), tuple(record["raw"][FORCE].tolist()))

    counted = ran.slave[in_session(ran.slave)]
    assert set(counted["weber"]) == set(WEBERS)
    assert all(error(one, float(one["weber"])) <= one["bound"] for one in counted)
    assert (np.linalg.norm(counted["decoded"] - counted["raw"], axis=1) > counted["bound"]).any(), "a ball would not do"
    assert any(error(one, WEBERS[0]) > one["bound"] for one in counted), "nor the file's k"


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


TICK = 0.01  # long, so that a second is few ticks [s]


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
    slave = records(3000, raw=walk(np.random.default_rng(1), 3000))
    master = records(3000, rtt_us=2e3 * 52, ramping=np.arange(3000) < 52)
    master["output"][52:] = slave["raw"][:-52]
    force = score(master, slave, pieces=3)["force"]
    assert force["error_rms"] > 5.0
    assert force["aligned_rms"] == pytest.approx(0.0, abs=1e-3)
    assert force["aligned_lag_s"] == pytest.approx(52.0 / RATE)


magnitudes = st.just(0.0) | st.floats(1e-9, 30.0)
thresholds = st.builds(Threshold, st.floats(0.02, 0.5), st.floats(1e-3, 1.0))


@pytest.mark.parametrize(
    ("jnd", "floor"), [(0.0, 0.02), (-0.1, 0.02), (0.1, 0.0), (0.1, -0.02), (inf, 0.1), (0.1, inf)]
)
def test_a_threshold_out_of_range_is_refused(jnd: float, floor: float) -> None:
    with pytest.raises(ValueError, match="jnd and floor_n must be > 0"):
        Threshold(jnd, floor)


def log_error(threshold: Threshold, displayed: float, measured: float) -> float:
    return float(threshold.log_error(np.array([displayed]), np.array([measured]))[0])


@given(thresholds, magnitudes, magnitudes, magnitudes)
def test_log_errors_add_up_and_do_not_depend_on_the_order(
    threshold: Threshold, one: float, other: float, third: float
) -> None:
    """It counts JNDs one upon the other, so those from a to b and from b to c are those from a to c."""
    low, middle, high = sorted((one, other, third))
    steps = log_error(threshold, low, middle) + log_error(threshold, middle, high)
    assert log_error(threshold, low, high) == pytest.approx(steps, abs=1e-9)
    assert log_error(threshold, one, other) == pytest.approx(log_error(threshold, other, one))
    assert log_error(Threshold(0.10, 0.04), 0.04, 0.0) == pytest.approx(1.0), "the absolute threshold"


def summary(threshold: Threshold, ticks: list[tuple[float, float]]) -> dict[str, Any]:
    """Of displayed and measured forces along one axis."""
    statistics, (displayed, measured) = QualityStatistics(1e-3, threshold), np.array(ticks).T
    statistics.add(np.abs(displayed - measured), displayed, measured)
    return asdict(statistics.figures())


def test_measures_worked_out_by_hand() -> None:
    threshold = Threshold(0.10, 0.10)
    found = summary(threshold, [(1.0, 1.0), (1.2, 1.0), (0.7, 1.0), (0.1, 0.0), (2.4, 2.0), (3.6, 4.0)])
    assert found["error_rms_jnd"] == pytest.approx(sqrt((0 + 4 + 9 + 1 + 4 + 1) / 6))
    assert found["error_max_jnd"] == pytest.approx(3.0)
    # 0.1 against 0.1 is on the threshold, not beyond it.
    assert found["noticeable_fraction"] == pytest.approx(3 / 6)
    assert found["noticeable_longest_s"] == pytest.approx(2e-3)
    logs = [log(2.2 / 2.0), log(2.0 / 1.7), log(1.1), log(3.4 / 3.0), log(5.0 / 4.6)]
    assert found["log_error_rms_jnd"] == pytest.approx(sqrt(sum(x * x for x in logs) / 6) / log(1.1))
    assert found["log_error_max_jnd"] == pytest.approx(log(2.0 / 1.7) / log(1.1))


@given(thresholds, st.lists(st.tuples(magnitudes, magnitudes), min_size=1, max_size=30))
def test_what_is_noticeable_is_beyond_the_threshold(threshold: Threshold, ticks: list[tuple[float, float]]) -> None:
    whole = summary(threshold, ticks)
    runs = [
        len(list(group))
        for is_set, group in groupby(abs(d - f) > max(threshold.jnd * f, threshold.floor_n) for d, f in ticks)
        if is_set
    ]
    assert whole["noticeable_longest_s"] == pytest.approx(1e-3 * max(runs, default=0))
    assert whole["noticeable_fraction"] == pytest.approx(sum(runs) / len(ticks))
    assert whole["error_rms_jnd"] <= whole["error_max_jnd"] * (1.0 + 1e-12)


def test_jumps_are_in_jnds_of_the_force_before() -> None:
    statistics = QualityStatistics(1e-3, Threshold(0.10, 0.04))
    statistics.add_jumps(np.array([0.04, 1.0, 3.0]), np.array([0.0, 5.0, 10.0]))
    found = asdict(statistics.figures())
    assert found["jump_max_jnd"] == pytest.approx(3.0)
    assert found["jump_median_jnd"] == pytest.approx(2.0, rel=0.006)


def test_jumps_are_changes_in_ticks_with_an_update() -> None:
    master = ticks(12, tick=np.arange(12), state=State.ENGAGED.value, received=[0, 1, 0, 2, 0, 1, 1, 0, 1, 1, 1, 0])
    master["output"][:, 2] = [0.0, 1.0, 1.5, 3.5, 3.5, 3.0, 3.0, 9.0, 1.0, 2.0, 4.0, 9.0]
    master["ramping"][5] = 1
    master["ramping"][6] = RELEASED
    master["tick"][8:] += 1  # a tick was lost before
    master["state"][10] = State.SILENT.value
    jumps, before = JumpsOfRecords().of(master)
    assert (jumps.tolist(), before.tolist()) == ([1.0, 2.0, 1.0], [0.0, 1.5, 1.0])
