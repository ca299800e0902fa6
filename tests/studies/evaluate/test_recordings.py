"""The codec on recorded signals: against the table of an independent implementation, and on a trace of our own."""

import re
from functools import cache
from math import inf
from pathlib import Path

import pytest

from weberlink.codec import force_channel
from weberlink.codec.predictors import Trust
from weberlink.master.trace import read_trace
from weberlink.studies.evaluate.replay import Signal, replay, signal_of
from weberlink.studies.evaluate.study import Recording, Study

ROOT = Path(__file__).parents[3]
RECORDED = ROOT.parent / "shared" / "traces"
OWN = ROOT / "configs" / "traces" / "operator.csv"
PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")
EXACT = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}

needs_recordings = pytest.mark.skipif(
    not RECORDED.is_dir(), reason="recordings of people lie in ../shared/traces, which is not here"
)


@cache
def table() -> dict[tuple[str, str], float]:
    """Packets per second of the independent implementation: k = 0.10, floor 0.05 N, no quantization."""
    rows = re.findall(r"^\| (\w+_\d+) \|" + r" ([\d.]+) \|" * 5 + "$", (RECORDED / "README.md").read_text(), re.M)
    return {(row[0], name): float(rate) for row in rows for name, rate in zip(PREDICTORS, row[1:], strict=True)}


@cache
def recording(name: str) -> Signal:
    return signal_of(read_trace(RECORDED / f"{name}.csv"))


NAMES = sorted({path.stem for path in RECORDED.glob("*.csv")}) if RECORDED.is_dir() else ["none"]


def packets_per_s(name: str, predictor: str, trust: Trust | None = None) -> float:
    channel = force_channel(predictor=predictor, weber=0.10, floor=0.05, trust=trust, **EXACT)  # type: ignore[arg-type]
    signal = recording(name)
    return len(replay(signal, channel).updates) / signal.duration_s


@needs_recordings
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("predictor", ["zoh", "linear"])
def test_signal_predictors_agree_with_the_table_within_3_percent(name: str, predictor: str) -> None:
    assert packets_per_s(name, predictor) == pytest.approx(table()[name, predictor], rel=0.03)


@needs_recordings
@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("tue")])
@pytest.mark.parametrize("predictor", ["plane", "hybrid"])
def test_geometry_predictors_agree_on_contacts_within_10_percent(name: str, predictor: str) -> None:
    assert packets_per_s(name, predictor) == pytest.approx(table()[name, predictor], rel=0.10)


@needs_recordings
@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("omega3")])
def test_the_sphere_differs_from_the_table_by_what_it_believes(name: str) -> None:
    """Believing any fit gives the table's counts; not believing a wild radius or a misfit sends less."""
    credulous = Trust(radius=(1e-9, 1e9), stiffness=(1e-6, 1e12), least_angle_sine=1e-12, misfit=inf)
    rate = packets_per_s(name, "sphere", credulous)
    assert rate == pytest.approx(table()[name, "sphere"], rel=0.03)
    assert packets_per_s(name, "sphere") < rate


def test_rows_on_the_wire_keep_within_one_jnd_and_half_a_step() -> None:
    trace = read_trace(OWN)
    rows = list(Study(webers=(0.05, 0.20)).rows(Recording("own", trace)))
    assert [(row.predictor, row.weber) for row in rows] == [(p, k) for p in PREDICTORS for k in (0.05, 0.20)]
    for row in rows:
        assert row.samples == len(trace.time_s)
        assert row.reduction == pytest.approx(1.0 - row.packets / row.samples)
        assert row.jnd_max <= 1.0
        assert row.packets > 0
        assert (row.selected is not None) == (row.predictor == "hybrid")
        assert row.selected is None or sum(row.selected.values()) == row.packets


def test_a_larger_weber_factor_sends_less_on_a_trace_of_contact() -> None:
    trace = read_trace(OWN)
    for predictor in PREDICTORS:
        fine, coarse = Study((predictor,), (0.025, 0.30)).rows(Recording("own", trace))
        assert coarse.packets < fine.packets
