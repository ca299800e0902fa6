"""Figures by source: geometric means that no source dominates, and the comparison with the best single predictor."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.studies.evaluate.signals import walk
from weberlink.studies import recordings
from weberlink.studies.evaluate.by_source import EVERY, SINGLES, SourceFigures, by_source, loses
from weberlink.studies.evaluate.study import EvaluationRow, EvaluationStudy
from weberlink.studies.evaluate.traces import NamedTrace, read_traces
from weberlink.system.configuration import ConfigurationError

(ROW,) = EvaluationStudy(("zoh",)).rows(NamedTrace("walk", walk(1000, 1)))


def row(trace: str, source: str, predictor: str, packets: int) -> EvaluationRow:
    return replace(
        ROW, trace=trace, source=source, predictor=predictor, packets=packets, packets_per_s=packets / ROW.duration_s
    )


def figures(packets: dict[tuple[str, str], dict[str, int]]) -> dict[tuple[str, str], SourceFigures]:
    rows = [
        row(trace, source, name, count) for (trace, source), each in packets.items() for name, count in each.items()
    ]
    return {(one.source, one.predictor): one for one in by_source(rows)}


def test_a_source_counts_once_however_many_recordings_it_has() -> None:
    many = {(f"a{number}", "a"): {"hybrid": 100, "adaptive": 50} for number in range(9)}
    found = figures({**many, ("b1", "b"): {"hybrid": 100, "adaptive": 200}})
    assert found["a", "adaptive"].over_hybrid == pytest.approx(0.5)
    assert found["b", "adaptive"].over_hybrid == pytest.approx(2.0)
    assert found[EVERY, "adaptive"].over_hybrid == pytest.approx(1.0)
    assert found[EVERY, "adaptive"].recordings == 10


def test_the_best_single_is_that_of_each_recording() -> None:
    singles = dict.fromkeys(SINGLES, 100)
    found = figures({
        ("a1", "a"): {**singles, "zoh": 50, "hybrid": 100},
        ("a2", "a"): {**singles, "sphere": 25, "hybrid": 25},
    })  # fmt: skip
    assert found["a", "hybrid"].over_best == pytest.approx(2.0**0.5)
    assert found["a", "hybrid"].above == 0.5
    assert found["a", "zoh"].above == 0.5
    assert (EVERY, "hybrid") not in found


def test_what_was_not_evaluated_is_unknown() -> None:
    found = figures({("a1", "a"): {"zoh": 10, "linear": 20}})
    assert (found["a", "zoh"].over_hybrid, found["a", "zoh"].over_best, found["a", "zoh"].above) == (None, None, None)


def test_a_recording_without_packets_has_a_ratio() -> None:
    found = figures({("a1", "a"): {"hybrid": 0, "adaptive": 2}})
    assert found["a", "adaptive"].over_hybrid == pytest.approx(2.0)


@pytest.mark.parametrize(("rate", "best", "lost"), [(1.9, 1.0, False), (2.1, 1.0, True), (105.0, 100.0, False)])
def test_a_loss_is_a_share_and_a_packet_a_second(rate: float, best: float, lost: bool) -> None:
    assert loses(rate, best) is lost


# --- shipped recordings as arguments


def test_a_source_stands_for_its_recordings(tmp_path: Path) -> None:
    named = read_traces([Path("panda_comanip"), Path("tue_rigid_1")])
    assert [(one.name, one.source) for one in named] == [
        ("panda_comanip_1", "panda_comanip"), ("panda_comanip_3", "panda_comanip"), ("tue_rigid_1", "tue"),
    ]  # fmt: skip
    assert len(read_traces([Path("recordings")])) == len(recordings.names())


def test_a_recording_is_listed_once() -> None:
    with pytest.raises(ConfigurationError, match="tue_rigid_1: listed twice"):
        read_traces([Path("tue"), Path("tue_rigid_1")])


def test_a_file_comes_before_a_recording_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["t,px,py,pz,fx,fy,fz", *(f"{tick * 1e-3},0,0,0,0,0,{tick}" for tick in range(5))]
    (tmp_path / "tue").write_text("\n".join(lines))
    monkeypatch.chdir(tmp_path)
    named = read_traces([Path("tue"), Path("omega3_1")])
    assert [(one.name, one.source) for one in named] == [("tue", "files"), ("omega3_1", "omega3")]


def test_a_file_that_is_not_there_is_told_with_what_is_shipped() -> None:
    with pytest.raises(ConfigurationError, match="absent: not found; shipped recordings: recordings, tue, "):
        read_traces([Path("absent")])
