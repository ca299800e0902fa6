"""Where the records of one side come from, as a session sees it; and the feed that is a ring of this host."""

from pathlib import Path
from typing import Any, Protocol

from weberlink.system.description import read as read_description
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import RingReader


class Feed(Protocol):
    """The records of one side, oldest first, until it ends."""

    side: str
    rate_hz: float
    began: float
    """When its writer began, on the clock of its records [s]."""
    description: dict[str, Any] | None
    """As of `weberlink.system.description`; None if it is not known."""
    ring: Path | None
    """Of a daemon on this host, which can be asked for changes."""

    @property
    def written(self) -> int:
        """Records of this side so far, seen or not."""

    @property
    def lost(self) -> int:
        """Records that were never seen."""

    @property
    def drained(self) -> bool:
        """Whether the last read took all that there will ever be."""

    def read(self) -> Records:
        """What has come since the last call."""

    def close(self) -> None: ...


class RingFeed:
    """A ring of this host.

    Args:
        path: of the ring.

    Raises:
        FileNotFoundError: it is gone.
        RingFormatError: it is not a ring that this release can read.
    """

    def __init__(self, path: Path) -> None:
        self._reader = RingReader(path)
        self.side = self._reader.side
        self.rate_hz = self._reader.rate_hz
        self.began = self._reader.started_monotonic_s
        self.description = read_description(path)
        self.ring: Path | None = path
        self.started_wall_s = self._reader.started_wall_s
        self.drained = False
        self.written = 0
        self.lost = 0
        self._read = 0

    @property
    def alive(self) -> bool:
        """Whether its writer still writes."""
        return self._reader.alive

    def read(self) -> Records:
        if self.drained:
            return self._reader.read()[:0]
        alive, self.written = self._reader.alive, self._reader.written  # before the read, which then takes all of it
        records = self._reader.read()
        self._read += len(records)
        # The ring does not count what it lost before it was opened.
        self.lost = max(self.lost, self._reader.overrun, self.written - self._read)
        self.written = max(self.written, self._read)
        self.drained = not alive
        return records

    def close(self) -> None:
        self._reader.close()
