"""A recording that is not there is a failure of its session, however late its process begins."""

import sys
from pathlib import Path

import pytest

from tests.program import PATIENT
from tests.session.systems import configuration
from tests.wait import PATIENCE
from weberlink.config import SIDES
from weberlink.session.launcher import LiveRun
from weberlink.session.recorder import failure
from weberlink_recording import mcap_format
from weberlink_recording.mcap_format import Recorder


@pytest.mark.realtime
def test_a_recorder_that_does_not_begin_in_time_fails_the_session_and_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_format, "python", lambda *_: [sys.executable, "-c", "import time; time.sleep(60)"])
    monkeypatch.setattr(mcap_format, "FINISH_LIMIT_S", 0.2)
    told: list[str] = []
    overrides, path = PATIENT[1::2], tmp_path / "late.mcap"
    with LiveRun(configuration(*overrides), overrides, SIDES, 0.3, record=path, tell=told.append) as session:
        figures = session.run()
    assert figures.recording is not None and figures.verdict is not None
    assert told == [f"the recording failed: {figures.recording['outcome']}"]
    assert (figures.outcome, figures.status, figures.verdict.word) == ("completed", 1, "failed")
    assert not path.exists()


def test_a_recorder_told_to_finish_before_there_is_telemetry_has_recorded_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_format, "FINISH_LIMIT_S", PATIENCE)
    recording = Recorder({}, {"master": str(tmp_path / "none.ring")}, tmp_path / "none.mcap")
    recording.stop()
    assert failure(recording) == "the recording failed: no telemetry of master"
    assert not recording.path.exists()
