"""The journal of a session that is recorded: what its records and its daemons tell, as lines in the recording.

A module of its own because it imports much: the recorder begins without it, and loads it in a thread.
"""

from datetime import datetime
from typing import Any

from weberlink.protocol.paths import paths_of
from weberlink.session import description
from weberlink.telemetry.reader import RingReader
from weberlink_figures.journal import Journal
from weberlink_figures.message import Rows
from weberlink_recording.writer import RecordingWriter


class SessionJournal:
    """Writes the journal into a recording."""

    def __init__(self, writer: RecordingWriter, rate_hz: float) -> None:
        self._writer = writer
        self._journal = Journal(self._write, rate_hz)
        self.flush = self._journal.flush

    def add(self, side: str, path: str, ring: RingReader, records: Rows) -> None:
        """Take the next records of a side, and what its daemon says beside its ring at `path`."""
        described = description.read(path) or {}
        self._journal.add(side, records, ring.started_wall_s - ring.started_monotonic_s)
        self._journal.add_peer(side, described.get("peer"))
        self._journal.add_paths(side, paths_of(described))

    def _write(self, document: dict[str, Any]) -> None:
        self._writer.journal(round(datetime.fromisoformat(document["time"]).timestamp() * 1e9), document)
