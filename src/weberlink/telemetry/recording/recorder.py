"""The recorder process: reads the rings of a session while its daemons run, and writes one MCAP file.

It starts with a `RecordingOrder` as JSON and answers with a summary as JSON on standard output. It outlives its parent,
so that what the daemons leave in their rings is still written.
"""

import json
import os
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from signal import SIG_IGN, SIGHUP, SIGINT, SIGTERM, Signals
from time import monotonic, process_time, sleep
from typing import Any

from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.recording.message import COMPLETE, Origin
from weberlink.telemetry.recording.writer import RecordingWriter
from weberlink.telemetry.ring import RingFormatError

COMPLETED, FAILED = 0, 1
STOP_SIGNALS = (SIGINT, SIGTERM)

LOOK_S = 0.2
"""Time between two reads of the rings, and so the most that the death of this process can cost [s]."""
LOOK_FOR_S = 0.02
"""The same while there is no ring."""
APPEAR_S = 10.0
"""How long the first ring may take to appear [s]."""
NICENESS = 10


@dataclass(frozen=True)
class RecordingOrder:
    """What to record.

    Args:
        rings: path by side; the files may appear later.
        out: path of the recording.
        facts: as of `RecordingWriter.create`.
    """

    rings: dict[str, str]
    out: str
    facts: dict[str, str]

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "RecordingOrder":
        return cls(**json.loads(text))


class RingSource:
    """One ring on its way into the file.

    Args:
        side: whose records they are.
        path: of the ring.
    """

    def __init__(self, side: str, path: str) -> None:
        self.side = side
        self.path = path
        self.ring: RingReader | None = None
        self.drained = False
        self._read = 0
        self._lost = 0

    def open(self) -> bool:
        """Open the ring if it exists; returns whether it is open.

        Raises:
            RingFormatError, OSError: it is there and cannot be read.
        """
        if self.ring is None:
            with suppress(FileNotFoundError):
                self.ring = RingReader(self.path)
        return self.ring is not None

    def move(self, writer: RecordingWriter) -> None:
        """Write the new records, and count those that were overwritten before they could be read.

        Raises:
            OSError: by the writer.
        """
        if self.ring is None or self.drained:
            return
        alive, written = self.ring.alive, self.ring.written  # before the read, which then takes all there ever is
        records = self.ring.read()
        self._read += len(records)
        # The ring does not count what it lost before it was opened.
        lost = max(self._lost, self.ring.overrun, written - self._read)
        writer.note_lost(self.side, lost - self._lost)
        self._lost = lost
        self.drained = not alive
        writer.write(self.side, records)

    def close(self) -> None:
        if self.ring is not None:
            self.ring.close()


class RingRecorder:
    """Moves records from the rings to the file, which is created when the first ring appears.

    Args:
        order: what to record.
    """

    def __init__(self, order: RecordingOrder) -> None:
        self._order = order
        self._sources = [RingSource(side, path) for side, path in order.rings.items()]
        self._clock: tuple[float, float] | None = None
        self._told: list[Signals] = []
        self.writer: RecordingWriter | None = None

    def run(self) -> str:
        """Record until every daemon has ended, or until this process is told to; returns the outcome.

        Raises:
            RingFormatError, OSError: a ring cannot be read, or the file cannot be written.
        """
        give_up_at = monotonic() + APPEAR_S
        while True:
            self._look()
            begun = [source for source in self._sources if source.ring is not None]
            if begun and all(source.drained for source in begun):
                return self._close(self._whole())
            if not begun and monotonic() > give_up_at:
                return f"no telemetry within {APPEAR_S:g} s: {', '.join(self._order.rings.values())}"
            sleep(LOOK_S if begun else LOOK_FOR_S)
            if self._told:
                self._look()
                return self._close(f"stopped by {self._told[0].name}")

    def stop(self, number: int, _: object) -> None:
        """Finish at the next look; a signal handler."""
        self._told.append(Signals(number))

    def close(self, outcome: str) -> None:
        """Close the rings, and the file if it is not finished."""
        for source in self._sources:
            source.close()
        if self.writer is not None:
            with suppress(OSError):  # what is wrong with the file is the outcome by now
                self.writer.close(outcome)

    def _look(self) -> None:
        for source in self._sources:
            if source.ring is None and source.open():
                self._announce(source)
        if self.writer is not None:
            for source in self._sources:
                source.move(self.writer)
            self.writer.flush()

    def _announce(self, source: RingSource) -> None:
        ring = source.ring
        assert ring is not None
        if self._clock is None:
            # All rings of this host are on one clock: let the wall clock be read once for all of them.
            self._clock = (ring.started_wall_s, ring.started_monotonic_s)
        if self.writer is None:
            os.nice(NICENESS)  # not before: a short session must not be over before it is found
            self.writer = RecordingWriter.create(self._order.out, self._order.facts)
        self.writer.add_side(Origin(source.side, ring.rate_hz, *self._clock))

    def _whole(self) -> str:
        missing = [source.side for source in self._sources if source.ring is None]
        return f"the {missing[0]} never began" if missing else COMPLETE

    def _close(self, outcome: str) -> str:
        if self.writer is not None:
            self.writer.close(outcome)
        return outcome


def main(text: str) -> int:
    """Run an order; returns the exit status."""
    began = monotonic()
    order = RecordingOrder.from_json(text)
    recording = RingRecorder(order)
    signal.signal(SIGHUP, SIG_IGN)
    for number in STOP_SIGNALS:
        signal.signal(number, recording.stop)
    outcome = "failed"
    try:
        outcome = recording.run()
    except (RingFormatError, OSError) as error:
        outcome = _words(error)
    finally:
        recording.close(outcome)
    _tell(_summary(order, recording.writer, outcome, began))
    return COMPLETED if outcome == COMPLETE else FAILED


def _words(error: Exception) -> str:
    """An OSError's own text begins with its number."""
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


def _summary(order: RecordingOrder, writer: RecordingWriter | None, outcome: str, began: float) -> Mapping[str, Any]:
    return {
        "path": order.out,
        "bytes": 0 if writer is None else writer.size,
        "records": {} if writer is None else writer.records,
        "lost": {} if writer is None else writer.lost,
        "cpu_s": process_time(),
        "elapsed_s": monotonic() - began,
        "outcome": outcome,
    }


def _tell(summary: Mapping[str, Any]) -> None:
    """Print the summary for the parent, if it still runs."""
    try:
        sys.stdout.write(json.dumps(summary))
        sys.stdout.flush()
    except BrokenPipeError:
        # Or Python would try to write again, and complain, at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
