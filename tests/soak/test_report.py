"""Growth is found where there is some, and what a report calls a failure."""

import json
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.soak.processes import Footprint
from tests.soak.report import BOUNDS_PER_HOUR, WARM_UP_S, Report, fit
from tests.soak.watch import Samples


def life(
    per_hour: float, *, seconds: int = 900, level: float = 4e4, noise: float = 0.0, seed: int = 1
) -> list[tuple[float, float]]:
    random = Random(seed)
    return [(float(t), level + per_hour / 3600.0 * t + noise * random.gauss(0.0, 1.0)) for t in range(seconds)]


@given(slope=st.floats(-1e5, 1e5), level=st.floats(0.0, 1e6))
def test_an_exact_line_is_found_exactly(slope: float, level: float) -> None:
    grown = fit([life(slope, level=level)])
    assert grown is not None
    assert grown.per_hour == pytest.approx(slope, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize(
    ("lives", "slope"),
    [
        ([life(500.0, level=1e4, seconds=300), life(500.0, level=9e4, seconds=300)], 500.0),
        ([life(0.0, level=1e4 * n, seconds=300) for n in range(1, 6)], 0.0),
        ([[(float(t), 1e4 if t < WARM_UP_S else 2e4) for t in range(900)]], 0.0),
    ],
)
def test_neither_restarts_nor_warm_up_are_growth(lives: list[list[tuple[float, float]]], slope: float) -> None:
    grown = fit(lives)
    assert grown is not None
    assert grown.per_hour == pytest.approx(slope, abs=1e-6)


def test_noise_alone_accuses_nobody() -> None:
    fits = [fit([life(0.0, noise=200.0, seed=seed)]) for seed in range(50)]
    assert sum(grown is None or grown.exceeds(0.0) for grown in fits) <= 5  # two standard deviations, on one side
    leak = fit([life(20_000.0, noise=200.0)])
    assert leak is not None and leak.exceeds(1024.0) and not leak.exceeds(30_000.0)


def test_too_few_samples_are_not_judged() -> None:
    assert fit([]) is fit([[]]) is fit([life(1e6, seconds=60)]) is fit([life(1e6, seconds=30)] * 20) is None


def samples(name: str, per_hour: float) -> Samples:
    held = [Footprint(round(rss), 20_000, 10_000, 10, 3) for _, rss in life(per_hour, seconds=1200)]
    return Samples(name, [(float(t), each) for t, each in enumerate(held)])


def test_growth_of_a_daemon_and_broken_laws_are_failures() -> None:
    report = Report(1, 60.0)
    beyond = 3.0 * BOUNDS_PER_HOUR["rss_kib"]
    report.measure([samples("master", beyond), samples("slave", 0.0), samples("relay", beyond)])
    report.kind("noise").violations.append("output moved")
    grown, moved = report.failures()
    assert grown.startswith("master: rss_kib grew by 307")
    assert moved == "noise: output moved"
    assert f"VIOLATED {grown}" in report.lines()
    assert json.loads(json.dumps(report.to_dict()))["failures"] == [grown, moved]
