"""Readings of the paper: equal where they must be, different where they say so, and counted as a plain run counts."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.studies.evaluate.signals import wall
from weberlink.codec import Encoder
from weberlink.codec.predictors import HYBRID, PREDICTORS, FitLimits
from weberlink.codec.sample import Sample
from weberlink.studies.evaluate.replay import replay, signal_of
from weberlink.studies.evaluate.study import EvaluationStudy
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.paper.claims import WEBER
from weberlink.studies.paper.deviations import READINGS, packets_of, results

STUDY = EvaluationStudy()
LIMITS = FitLimits()
PLANES = [reading.predictor for reading in READINGS if reading.part == "plane" and reading.predictor is not None]
(CONVEX,) = [reading.predictor for reading in READINGS if reading.part == "sphere" and reading.predictor is not None]
coordinates = st.floats(-0.05, 0.05)
positions = st.tuples(coordinates, coordinates, coordinates)


def sample(tick, value, position):
    return Sample(tick, tuple(map(float, value)), tuple(map(float, position)))


@examples(50)
@given(st.floats(0.1, 5.0), st.floats(0.1, 5.0), positions, positions)
def test_for_forces_of_one_direction_all_readings_of_the_plane_are_one(one, other, place, before) -> None:
    direction = np.array([0.6, 0.0, 0.8])
    newest, previous = sample(9, one * direction, place), sample(3, other * direction, before)
    expected = PREDICTORS["plane"].fit(newest, previous, LIMITS)
    for predictor in PLANES:
        found = predictor.fit(newest, previous, LIMITS)
        if expected is None or found is None:
            # Rounding decides on the edge of the accepted stiffness, and for equal forces.
            continue
        assert found.normal == expected.normal
        assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-6)


def test_readings_of_the_plane_differ_where_the_force_turns() -> None:
    newest, previous = sample(9, (0.0, 0.0, 2.0), (0.0, 0.0, -0.004)), sample(3, (0.6, 0.0, 0.8), (0.03, 0.0, -0.002))
    along, own = PLANES
    # Heights -4 and -2 mm at 2 N, and: 1 N (the code), 0.8 N along the normal; 16.4 mm by the sample's own normal.
    assert PREDICTORS["plane"].fit(newest, previous, LIMITS).stiffness == pytest.approx(500.0)
    assert along.fit(newest, previous, LIMITS).stiffness == pytest.approx(600.0)
    assert own.fit(newest, previous, LIMITS).stiffness == pytest.approx(1.0 / 0.0204)


@pytest.mark.parametrize("radius", [0.05, -0.05])
def test_the_convex_sphere_is_the_code_s_on_convex_walls_only(radius: float) -> None:
    def touch(tick, angle, force):
        direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
        return sample(tick, force * direction, (radius - force / 500.0) * direction)

    newest, previous = touch(9, 0.3, 2.0), touch(3, 0.1, 1.5)
    expected = PREDICTORS["sphere"].fit(newest, previous, LIMITS)
    assert expected is not None
    assert expected.radius == pytest.approx(radius)
    assert CONVEX.fit(newest, previous, LIMITS) == (expected if radius > 0.0 else None)


def test_a_reading_changes_one_thing_of_the_channel() -> None:
    for reading in READINGS:
        ours, other = STUDY.channel(reading.base, WEBER), reading.channel(STUDY)
        same = {"value_quantizer", "position_quantizer"}  # compared by their steps
        assert ours.grid.size == other.grid.size
        assert ours.value_quantizer.step == other.value_quantizer.step
        names = [one.name for one in fields(ours) if one.name not in same]
        changed = [name for name in names if getattr(ours, name) != getattr(other, name)]
        assert len(changed) + (other.predictors != ours.predictors) == 1


def test_ratios_are_those_of_packets() -> None:
    traces = [NamedTrace("wall", wall(400)), NamedTrace("again", wall(300))]
    packets = [packets_of((STUDY, one)) for one in traces]
    for trace, mine in zip(traces, packets, strict=True):
        for reading, (other, here) in zip(READINGS, mine, strict=True):
            signal = signal_of(trace.trace)
            assert here == len(replay(signal, STUDY.channel(reading.base, WEBER)).updates)
            encoder = Encoder(reading.channel(STUDY))
            sent = [encoder.encode(tick, *each) for tick, each in enumerate(signal.samples)]
            assert other == sum(update is not None for update in sent)
    (found,) = [one for one in results(["wall", "again"], packets) if one.reading.floor == 0.0]
    assert found.reading.base == HYBRID
    ratios = [other / here for other, here in (mine[READINGS.index(found.reading)] for mine in packets)]
    assert list(found.ratios.values()) == ratios
    assert found.band is not None
    assert found.band.mean == pytest.approx((ratios[0] * ratios[1]) ** 0.5)
