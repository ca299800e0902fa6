"""A live session whose daemon reports another path: the log, the recording and the report say it."""

import json
from pathlib import Path
from signal import SIGINT

import pytest

from tests.program import PATIENT, Program, document
from tests.wait import until
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.system import description
from weberlink.telemetry.recording.reader import read_recording

pytestmark = pytest.mark.realtime

RELAYED = PathFacts(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 1)


def report_path(ring: Path, path: PathFacts) -> None:
    """Replace the description as the daemon does, with another path; again if the daemon has replaced it since."""
    described = description.read(ring)
    assert described is not None
    if described["paths"] == [path._asdict()]:
        return
    draft = description.path_beside(ring).with_suffix(".draft")
    draft.write_text(json.dumps(described | {"paths": [path._asdict()]}), encoding="utf-8")
    draft.replace(description.path_beside(ring))


def test_changed_path_is_in_log_and_recording(tmp_path: Path) -> None:
    log, recording, report = tmp_path / "log", tmp_path / "touch.mcap", tmp_path / "report.json"

    def told() -> list[dict[str, object]]:
        report_path(ring, RELAYED)
        lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
        return [line for line in lines if line["event"] == "path" and line["via"] == RELAYED.via]

    with Program("loopback", *PATIENT, "--log", log, "--record", recording, "--json", report) as session:
        session.engaged("master")
        session.engaged("slave")
        ring = next(ring for ring in session.rings() if "master" in ring.name)
        (line,) = until(told, "the event")
        session.send(SIGINT)
        status, _, _ = session.finish()
    text = "path: relayed by relay.example over wlan0, 1 change"
    assert (status, line["side"], line["level"], line["text"]) == (0, "master", "warn", text)
    assert f"master: {text}" in [mark.text for mark in read_recording(recording).marks]
    ways = document(report.read_text(encoding="utf-8"))["ways"]
    assert 0.0 < ways["to_slave"]["one_way_us"]["p50"] < 1e5
    assert ways["to_master"]["loss"] == 0.0
