"""The format of recordings: starts the recorder of a live session, writes and reads files."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from signal import SIGTERM
from subprocess import PIPE
from time import monotonic
from typing import Any

from weberlink.child_process import Child, python
from weberlink.config import MASTER, SIDES, SLAVE
from weberlink.session.recorder import FINISH_LIMIT_S, recording_ended
from weberlink.telemetry.recorders import COMPLETE
from weberlink_figures.message import Origin, Rows
from weberlink_recording.configuration import BEGUN, DURING, facts_of
from weberlink_recording.marks import shortened
from weberlink_recording.reader import read_recording
from weberlink_recording.recorder import RecordingOrder
from weberlink_recording.writer import RecordingWriter


class Recorder:
    """The child process; as of `weberlink.telemetry.recorders.Recorder`."""

    def __init__(
        self, described: Mapping[str, Any], rings: Mapping[str, str], out: Path, *, since: float | None = None
    ) -> None:
        self.path = out
        told = facts_of(described) | ({} if since is None else {BEGUN: DURING})
        order = RecordingOrder(dict(rings), str(out), told, since=since)
        command = python("-m", "weberlink_recording.recorder", order.to_json())
        self._process = Child(command, stdin=PIPE, stdout=PIPE)  # ends when the rings end
        self._summary: dict[str, Any] | None = None

    @property
    def running(self) -> bool:
        return self._process.running

    def mark(self, text: str) -> str:
        text = shortened(text)
        self._process.write_line(json.dumps({"mark": text, "at": monotonic()}))
        return text

    def stop(self) -> None:
        self._process.write_line(json.dumps({"finish": True}))

    def kill(self) -> None:
        self._process.kill()

    def finish(self) -> dict[str, Any]:
        """May be repeated."""
        if self._summary is None:
            output = self._process.end(FINISH_LIMIT_S, SIGTERM)
            try:
                self._summary = json.loads(output)
            except ValueError:
                size = self.path.stat().st_size if self.path.exists() else 0
                outcome = f"recorder {self._process.how_it_ended}"
                self._summary = {"path": str(self.path), "bytes": size, "outcome": outcome}
        return dict(self._summary or {})


class VirtualRecording:
    """As of `weberlink.telemetry.recorders.VirtualRecording`."""

    def __init__(self, path: Path, described: Mapping[str, Any], tell: Callable[[str], None]) -> None:
        self._outcome, self._tell = COMPLETE, tell
        self._writer = RecordingWriter.create(path, facts_of(described, virtual=True))
        for side in SIDES:
            self._writer.add_side(Origin(side, described["system"]["rate_hz"], 0.0, 0.0))

    def add(self, master: Rows, slave: Rows) -> None:
        if self._outcome == COMPLETE:
            try:
                self._writer.write(MASTER, master)
                self._writer.write(SLAVE, slave)
                self._writer.flush()
            except OSError as error:
                self._outcome = error.strerror or str(error)
                self._tell(recording_ended(self._writer.path, self._outcome))

    def finish(self) -> dict[str, Any]:
        writer = self._writer
        try:
            writer.close()
        except OSError as error:
            self._outcome = error.strerror or str(error)
        figures = {"path": str(writer.path), "bytes": writer.size, "records": writer.records, "lost": writer.lost}
        return figures | {"outcome": self._outcome}


class McapFormat:
    """MCAP files, whose messages ROS 2 tools know; as of `weberlink.telemetry.recorders.RecordingFormat`."""

    start, create = Recorder, VirtualRecording
    read = staticmethod(read_recording)
