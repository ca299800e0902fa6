"""The work-precision study of the codec."""

import json
from math import sqrt
from pathlib import Path

import pytest

from tests.studies.evaluate.signals import trace, wall
from weberlink.studies.precision.coding import (
    RECOMMENDED,
    CodingRow,
    CodingStudy,
    felt_errors,
    shipped_channel,
    study,
)

STEP = trace([0.0] * 10 + [2.0] * 10, [0.0] * 20)


def row(predictor: str, packets_per_s: float, error: float, *, weber: float = 0.10) -> CodingRow:
    return CodingRow(
        trace="made",
        predictor=predictor,
        weber=weber,
        samples=1000,
        duration_s=1.0,
        packets=round(packets_per_s),
        packets_per_s=packets_per_s,
        reduction=1.0 - packets_per_s / 1000.0,
        coding_rms_n=error,
        error_rms_n=error,
        error_max_n=error,
        error_rms_deadbands=error,
        violation_fraction=0.0,
        violation_longest_ticks=0,
        tick_us=2.0,
    )


def test_an_update_is_felt_after_the_latency() -> None:
    errors, bounds = felt_errors(STEP, shipped_channel("zoh", 0.10), latency_ticks=3)
    assert errors.tolist() == [0.0] * 10 + [2.0] * 3 + [0.0] * 7
    assert bounds.tolist() == pytest.approx([0.02] * 10 + [0.2] * 10)


def test_figures_of_a_step_match_the_formulas() -> None:
    (found,) = study({"step": STEP}, ["zoh"], [0.10], latency_ticks=3).rows
    assert (found.trace, found.predictor, found.weber) == ("step", "zoh", 0.10)
    assert (found.samples, found.packets, found.duration_s) == (20, 1, pytest.approx(0.02))
    assert (found.packets_per_s, found.reduction) == (pytest.approx(50.0), 0.95)
    assert found.coding_rms_n == 0.0
    assert found.error_rms_n == pytest.approx(2.0 * sqrt(3.0 / 20.0))
    assert found.error_max_n == 2.0
    assert found.error_rms_deadbands == pytest.approx(10.0 * sqrt(3.0 / 20.0))
    assert (found.violation_fraction, found.violation_longest_ticks) == (0.15, 3)
    assert found.tick_us > 0.0


def test_without_latency_felt_is_coding_error() -> None:
    for found in study({"wall": wall()}, webers=(0.05, 0.20), latency_ticks=0).rows:
        assert found.error_rms_n == pytest.approx(found.coding_rms_n)
        assert found.violation_fraction == 0.0
        assert found.error_rms_deadbands <= 1.0


def test_traces_are_pooled_by_their_samples() -> None:
    result = study({"long": wall(900), "short": wall(300, stiffness=900.0)}, ["zoh", "plane"], [0.05, 0.20])
    combinations = [(p, k) for p in ("zoh", "plane") for k in (0.05, 0.20)]
    assert [(r.trace, r.predictor, r.weber) for r in result.rows] == [
        (t, *c) for t in ("long", "short") for c in combinations
    ]
    for pooled, a, b in zip(result.pooled, result.rows[:4], result.rows[4:], strict=True):
        assert (pooled.trace, pooled.predictor, pooled.weber) == ("all", a.predictor, a.weber)
        assert pooled.packets == a.packets + b.packets
        assert pooled.packets_per_s == pytest.approx(pooled.packets / 1.2)
        assert pooled.error_rms_n == pytest.approx(sqrt(0.75 * a.error_rms_n**2 + 0.25 * b.error_rms_n**2))
        assert pooled.violation_fraction == pytest.approx(0.75 * a.violation_fraction + 0.25 * b.violation_fraction)


def test_front_marks_count_all_and_equal_factors() -> None:
    result = study({"wall": wall()}, ["zoh", "plane"], [0.10, 0.30])
    for found in result.rows:
        better = [r for r in result.rows if r.packets <= found.packets and r.error_rms_n < found.error_rms_n]
        assert found.pareto == (not better)
        assert found.pareto_at_weber == (not [r for r in better if r.weber == found.weber])
    assert {r.predictor for r in result.rows if r.pareto_at_weber} == {"plane"}


def test_the_verdict_names_dominating_predictors() -> None:
    rows = (
        row("zoh", 40.0, 0.05),
        row("plane", 9.0, 0.08),
        row("hybrid", 10.0, 0.10),
        row("hybrid", 1.0, 0.01, weber=0.3),
    )
    (verdict, pooled) = CodingStudy(rows, rows, 1).verdicts()
    assert verdict == pooled
    assert (verdict.on_front, verdict.dominated_by) == (False, ("plane",))
    assert verdict.excess == pytest.approx(0.1)


def test_an_undominated_choice_is_on_the_front() -> None:
    rows = (row("zoh", 40.0, 0.05), row("hybrid", 10.0, 0.10), row("plane", 0.0, 0.11))
    (verdict, _) = CodingStudy(rows, rows, 1).verdicts()
    assert (verdict.on_front, verdict.dominated_by, verdict.excess) == (True, (), 0.0)
    assert CodingStudy(rows[:1], rows[:1], 1).verdicts() == []


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        study({})
    with pytest.raises(ValueError, match="latency_ticks"):
        study({"step": STEP}, latency_ticks=-1)
    with pytest.raises(ValueError, match=r"trace far: position reaches 0\.07 m"):
        study({"far": trace([0.0, 1.0], [0.0, 0.07])})
    with pytest.raises(ValueError, match="trace hard: force reaches 40 N"):
        study({"hard": trace([0.0, 40.0], [0.0, 0.0])})


def test_the_document_is_json() -> None:
    result = study({"wall": wall(200)}, ["plane", "hybrid"], [0.10])
    document = json.loads(json.dumps(result.as_json()))
    assert document["latency_ticks"] == 1
    assert [r["predictor"] for r in document["rows"]] == ["plane", "hybrid"]
    assert (document["recommended"]["predictor"], document["recommended"]["weber"]) == RECOMMENDED
    assert [verdict["trace"] for verdict in document["recommended"]["verdicts"]] == ["wall", "all"]


@pytest.mark.parametrize("predictors", [["zoh", "hybrid"], ["linear"]])
def test_the_figure_is_drawn(tmp_path: Path, predictors: list[str]) -> None:
    pytest.importorskip("matplotlib")
    from weberlink.studies.precision.figures import coding_figure  # noqa: PLC0415

    path = tmp_path / "coding.png"
    coding_figure(study({"wall": wall(200)}, predictors, [0.05, 0.10]), path, "made by a test")
    header = path.read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert (int.from_bytes(header[16:20]), int.from_bytes(header[20:24])) == (2200, 1200)
