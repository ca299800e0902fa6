"""Signals of the study: any tick rate, groups, and which recordings are test data."""

from pathlib import Path

import numpy as np
import pytest

from weberlink.studies import recordings
from weberlink.studies.adaptive.signals import (
    FULL,
    NOISE_N,
    QUICK,
    SCENE_GROUPS,
    StudySignal,
    resampled,
    signals,
    tasks,
)
from weberlink.studies.evaluate.scenes import scene_names, scene_signal
from weberlink.studies.evaluate.synthetic import synthetic_names, synthetic_signal
from weberlink.studies.evaluate.traces import NamedTrace, read_traces

GIVEN = read_traces([Path(name) for name in ("tue_rigid_1", "tue_foam_1", "omega3_3", "stroke_iiwa_teleop_1")])


def test_a_recording_at_its_own_rate_is_itself() -> None:
    trace = recordings.load("omega3_3")
    found = resampled(trace.time_s, np.hstack((trace.force_n, trace.position_m)), 1000)
    assert found.force_n == pytest.approx(trace.force_n, abs=1e-9)
    assert found.position_m == pytest.approx(trace.position_m, abs=1e-9)


@pytest.mark.parametrize("rate", [500, 1000, 4000])
@pytest.mark.parametrize("name", ["panda_comanip_1", "stroke_iiwa_teleop_1"])
def test_a_recording_at_another_rate_has_no_gaps_and_the_same_length(name: str, rate: int) -> None:
    trace = recordings.load(name)
    found = resampled(trace.time_s, np.hstack((trace.force_n, trace.position_m)), rate)
    assert found.period_s == 1.0 / rate
    assert found.duration_s == pytest.approx(trace.duration_s, abs=2.0 / rate)
    at = np.searchsorted(trace.time_s, 3.0)
    near = round(trace.time_s[at] * rate)
    assert found.position_m[near] == pytest.approx(trace.position_m[at], abs=1e-3)


def test_noise_is_that_of_each_sample_at_every_rate() -> None:
    clean = scene_signal("plane", 1, 2.0)
    for rate in (500, 1000, 4000):
        one = StudySignal("plane", "still", "scene", "scene", "plane", 1, NOISE_N, 2.0).at(rate, 60.0)
        noise = one.force_n[:, :2]
        assert noise.std(axis=0) == pytest.approx([NOISE_N] * 2, rel=0.1)
        assert np.diff(noise, axis=0).std(axis=0) == pytest.approx([2.0**0.5 * NOISE_N] * 2, rel=0.1)
    one = StudySignal("plane", "still", "scene", "scene", "plane", 1, NOISE_N, 2.0).at(1000, 60.0)
    assert one.force_n == pytest.approx(scene_signal("plane", 1, 2.0, NOISE_N).force_n, abs=1e-9)
    assert one.position_m == pytest.approx(clean.position_m, abs=1e-12)


def test_a_synthetic_signal_is_made_at_the_rate() -> None:
    one = StudySignal("step", "synthetic", "synthetic", "synthetic", "step", 1).at(4000, 1.0)
    assert np.array_equal(one.force_n, synthetic_signal("step", 1, 1.0, 1.0 / 4000).force_n)


def test_groups_are_recordings_of_a_kind_and_every_scene_and_signal_is_in_one() -> None:
    found = signals(GIVEN, FULL)
    assert len({one.name for one in found}) == len(found)
    recorded = {one.name: one.group for one in found if one.kind == "recording"}
    assert recorded == {
        "tue_rigid_1": "tue_rigid", "tue_foam_1": "tue_foam", "omega3_3": "omega3",
        "stroke_iiwa_teleop_1": "stroke_iiwa_teleop",
    }  # fmt: skip
    assert {name for group in SCENE_GROUPS for name in group.scenes} == set(scene_names())
    assert [one.label for one in found if one.kind == "synthetic"] == list(synthetic_names())


def test_files_are_one_group() -> None:
    named = [NamedTrace(name, recordings.load("tue_rigid_1")) for name in ("mine_1", "yours")]
    assert {one.group for one in signals(named, QUICK) if one.kind == "recording"} == {"files"}


def test_fast_signals_are_fewer_and_shorter() -> None:
    work = tasks(signals(GIVEN, FULL), FULL)
    for rate in FULL.rates_hz:
        at = [task for task in work if task.rate_hz == rate]
        seeds = {task.signal.seed for task in at if task.signal.kind == "scene"}
        assert seeds == (set(FULL.seeds) if rate <= 1000 else set(FULL.seeds[:1]))
        if rate > 1000:
            assert max(len(task.signal.at(rate, task.longest_s)) for task in at[:6]) <= FULL.fast_s * rate


def test_three_sources_chose_nothing() -> None:
    assert [name for name, source in recordings.SOURCES.items() if source.chose == "none"] == [
        "ochoa_polish", "panda_comanip", "stroke_iiwa_teleop",
    ]  # fmt: skip
