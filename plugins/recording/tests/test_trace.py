"""Recordings as traces: what each side commanded and felt while it was engaged."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.records import TICK, phases, ticks
from weberlink.master.trace import TraceError, read_motion, read_trace
from weberlink.protocol.states import State
from weberlink.telemetry.message import Origin
from weberlink_recording.writer import RecordingWriter

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
    slave["output"][:5] = np.arange(15.0).reshape(5, 3)
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
        ("slave", {"joint_output": 1.0}, "holds the angles and torques of arms"),
        ("slave", {"state": ENGAGED - 1}, "expected at least 2 ticks of an engaged session, found 0"),
        ("slave", {"at": 1.0}, "the time of the slave's ticks does not rise"),
    ],
)
def test_a_recording_that_is_no_trace_is_said(tmp_path: Path, side: str, columns: dict[str, Any], says: str) -> None:
    path = recorded(tmp_path / "a.mcap", **{side: ticks(3, **{"state": ENGAGED, **columns})})
    with pytest.raises(TraceError, match=says):
        read_trace(path)
