"""A recording by its process: one that is not there is a failure of its session, and one that is there is a trace."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plugins.recording.tests.records import of_arms
from tests.program import PATIENT
from tests.records import TICK, phases, ticks
from tests.session.systems import configuration
from tests.wait import PATIENCE
from weberlink.config import SIDES
from weberlink.master.trace import TraceError, read_motion, read_trace
from weberlink.protocol.states import State
from weberlink.session.launcher import LiveRun
from weberlink.session.recorder import described, failure
from weberlink_figures.message import Origin
from weberlink_recording import mcap_format
from weberlink_recording.mcap_format import Recorder
from weberlink_recording.writer import RecordingWriter


@pytest.mark.realtime
def test_a_recorder_that_does_not_begin_in_time_fails_the_session_and_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_format, "python", lambda *_: [sys.executable, "-c", "import time; time.sleep(60)"])
    monkeypatch.setattr(mcap_format, "FINISH_LIMIT_S", 0.2)
    told: list[str] = []
    overrides, path = PATIENT[1::2], tmp_path / "late.mcap"
    with LiveRun(configuration(*overrides), overrides, SIDES, 0.3, record=path, tell=told.append) as session:
        status, report, _ = session.run()
    assert told == [f"the recording failed: {report['recording']['outcome']}"]
    assert (report["outcome"], status, report["verdict"]["word"]) == ("completed", 1, "failed")
    assert not path.exists()


def test_a_recorder_told_to_finish_before_there_is_telemetry_has_recorded_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_format, "FINISH_LIMIT_S", PATIENCE)
    recording = Recorder(described(configuration()), {"master": str(tmp_path / "none.ring")}, tmp_path / "none.mcap")
    recording.stop()
    assert failure(recording) == "the recording failed: no telemetry of master"
    assert not recording.path.exists()


ENGAGED = State.ENGAGED.value
AWAY = [1.0, 2.0, 3.0]


def recorded(path: Path, **sides: Any) -> Path:
    """A recording of some records of each side."""
    with RecordingWriter.create(path, {}) as writer:
        for side, records in sides.items():
            writer.add_side(Origin(side, 1000.0, 0.0, 0.0))
            writer.write(side, records)
    return path


def test_a_recording_gives_what_each_side_commanded_and_felt_while_engaged(tmp_path: Path) -> None:
    parts = [(2, {"state": ENGAGED - 1}), (3, {"state": ENGAGED}), (1, {"state": ENGAGED, "output": np.nan})]
    slave = phases(*parts, raw=[AWAY])
    slave["output"][:5, :3] = np.arange(15.0).reshape(5, 3)
    master = ticks(4, start=7.0, state=ENGAGED, position=[AWAY], output=[[0.5, 0.0, 0.0]])
    path = recorded(tmp_path / "a.mcap", slave=slave, master=master)
    led = read_trace(path)
    assert led.time_s.tolist() == pytest.approx([0.0, TICK, 2 * TICK])
    assert led.position_m.tolist() == np.arange(15.0).reshape(5, 3)[2:].tolist()
    assert led.force_n.tolist() == [AWAY] * 3
    hand = read_motion(path)
    assert (hand.position_m.tolist(), hand.force_n.tolist()) == ([AWAY] * 4, [[0.5, 0.0, 0.0]] * 4)
    alone = recorded(tmp_path / "alone.mcap", slave=slave)
    assert read_motion(alone).position_m.tolist() == led.position_m.tolist()
    unnamed = alone.rename(tmp_path / "unnamed")
    assert len(read_trace(unnamed).time_s) == 3, "known by its first bytes"


@pytest.mark.parametrize(
    ("side", "columns", "says"),
    [
        ("master", {}, "expected the slave's side of a session, found master"),
        ("slave", {"state": ENGAGED - 1}, "expected at least 2 ticks of an engaged session, found 0"),
        ("slave", {"at": 1.0}, "the time of the slave's ticks does not rise"),
    ],
)
def test_a_recording_that_is_no_trace_is_said(tmp_path: Path, side: str, columns: dict[str, Any], says: str) -> None:
    path = recorded(tmp_path / "a.mcap", **{side: ticks(3, **{"state": ENGAGED, **columns})})
    with pytest.raises(TraceError, match=says):
        read_trace(path)


def test_a_recording_of_arms_is_no_trace(tmp_path: Path) -> None:
    path = of_arms(tmp_path / "a.mcap", {"slave": ticks(3, state=ENGAGED)})
    with pytest.raises(TraceError, match="angles and torques of arms"):
        read_trace(path)
