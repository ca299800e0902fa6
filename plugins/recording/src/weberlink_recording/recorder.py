"""The recorder process: reads the rings of a session while its daemons run, and writes one MCAP file.

It starts with a `RecordingOrder` as JSON and answers with a summary as JSON on standard output. It outlives its parent,
so that what the daemons leave in their rings is still written. It takes commands on standard input, JSON objects of one
line: `{"mark": text, "at": moment on the clock of the records [s]}`, and `{"finish": true}`.
"""

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from signal import SIG_IGN, SIGHUP, SIGINT, SIGTERM, Signals
from threading import Thread
from time import monotonic, process_time, sleep
from typing import TYPE_CHECKING, Any

import numpy as np

from weberlink.child_process import Order
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.recorders import COMPLETE
from weberlink.telemetry.ring import RingFormatError
from weberlink_figures.message import Origin, Rows
from weberlink_recording.marks import Mark, shortened
from weberlink_recording.pictures import PictureSource, RecordedPicture
from weberlink_recording.writer import RecordingWriter

if TYPE_CHECKING:
    from weberlink_recording.session_journal import SessionJournal

COMPLETED, FAILED = 0, 1
STOP_SIGNALS = (SIGINT, SIGTERM)

LOOK_S = 0.2  # time between two reads of the rings, and so the most that the death of this process can cost [s]
LOOK_FOR_S = 0.02  # the same while there is no ring
APPEAR_S = 10.0  # how long the first ring may take to appear [s]
NICENESS = 5
COMMANDS_AT_ONCE = 65_536  # bytes of commands taken at a look


@dataclass(frozen=True)
class RecordingOrder(Order):
    """What to record."""

    rings: dict[str, str]  # path by side; the files may appear later
    out: str  # path of the recording
    facts: dict[str, str]  # as of `RecordingWriter.create`
    since: float | None = None  # moment on the clock of the records from which on [s]; None for all that the rings hold


class RingSource:
    """One ring on its way into the file; arguments as of `RecordingOrder`."""

    def __init__(self, side: str, path: str, since: float | None = None) -> None:
        self.side = side
        self.path = path
        self.ring: RingReader | None = None
        self.drained = False
        self._read = 0
        self._lost = 0
        self._since = since
        self._left_out: int | None = None  # how many records were before `since`; None before the first look

    def open(self) -> bool:
        """Open the ring if it exists; returns whether it is open. Raises RingFormatError or OSError if it is there and
        cannot be read.
        """
        if self.ring is None:
            with suppress(FileNotFoundError):
                self.ring = RingReader(self.path)
        return self.ring is not None

    def move(self, writer: RecordingWriter) -> Rows | None:
        """Write the new records, and count those that were overwritten before they could be read; returns what was
        written, None without a ring and after its end. Raises OSError by the writer.
        """
        if self.ring is None or self.drained:
            return None
        alive = self.ring.alive  # before the read, which then takes all there ever is
        records, passed = self.ring.read(), self.ring.passed
        if self._left_out is None and len(records):
            self._left_out, records = self._cut(records, passed)
        self._read += len(records)
        # The ring does not count what it lost before it was opened.
        lost = max(self._lost, self.ring.overrun, passed - self._read - (self._left_out or 0))
        writer.note_lost(self.side, lost - self._lost)
        self._lost = lost
        self.drained = not alive
        writer.write(self.side, records)
        return records

    def _cut(self, records: Rows, passed: int) -> tuple[int, Rows]:
        """Leave out what was before `since`; returns how many records that are, and the others."""
        assert self.ring is not None
        if self._since is None:
            return 0, records
        first = int(np.searchsorted(records["at"], self._since))
        overwritten = passed - len(records)
        missing = int((float(records["at"][0]) - self._since) * self.ring.rate_hz) if overwritten else 0
        return first + overwritten - max(0, missing), records[first:]

    def close(self) -> None:
        if self.ring is not None:
            self.ring.close()


class CommandReader:
    """Commands on standard input, read without waiting; what is no JSON object is passed over."""

    def __init__(self) -> None:
        self._fd: int | None = sys.stdin.fileno()
        self._rest = b""
        os.set_blocking(self._fd, False)

    def read(self) -> Iterator[dict[str, Any]]:
        """The commands since the last call; none once the parent has closed its end."""
        data = b""
        if self._fd is not None:
            with suppress(BlockingIOError):
                data = os.read(self._fd, COMMANDS_AT_ONCE)
                self._fd = self._fd if data else None
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            with suppress(ValueError):
                command = json.loads(line)
                if isinstance(command, dict):
                    yield command


class RingRecorder:
    """Moves records from the rings to the file, which is created when the first ring appears."""

    def __init__(self, order: RecordingOrder) -> None:
        self._order = order
        self._sources = [RingSource(side, path, order.since) for side, path in order.rings.items()]
        self._pictures = [PictureSource(path) for path in order.rings.values()]
        self._clock: tuple[float, float] | None = None
        self._told: list[str] = []  # why to finish: outcomes
        self._commands = CommandReader()
        self._marks: list[dict[str, Any]] = []  # marks that wait for the file
        self.writer: RecordingWriter | None = None
        self._journal: SessionJournal | None = None
        self._unnoted: list[tuple[RingSource, Rows]] = []
        self._loading: Thread | None = None

    def run(self) -> str:
        """Record until every daemon has ended, or until this process is told to; returns the outcome. Raises
        RingFormatError or OSError if a ring cannot be read, or the file cannot be written.
        """
        give_up_at = monotonic() + APPEAR_S
        while True:
            self._look()
            begun = [source for source in self._sources if source.ring is not None]
            if begun and all(source.drained for source in begun):
                return self._close(COMPLETE)
            if not begun and monotonic() > give_up_at:
                return f"no telemetry within {APPEAR_S:g} s: {', '.join(self._order.rings.values())}"
            sleep(LOOK_S if begun else LOOK_FOR_S)
            if self._told:
                self._look()
                return self._close(self._told[0])

    def stop(self, number: int, _: object) -> None:
        """Finish at the next look; a signal handler."""
        self._told.append(f"stopped by {Signals(number).name}")

    def close(self, outcome: str) -> None:
        """Close the rings, and the file if it is not finished."""
        for source in self._sources:
            source.close()
        for pictures in self._pictures:
            pictures.close()
        if self.writer is not None:
            with suppress(OSError):  # what is wrong with the file is the outcome by now
                self.writer.close(outcome)

    def _look(self) -> None:
        for source in self._sources:
            if source.ring is None and source.open():
                self._announce(source)
        for command in self._commands.read():
            self._obey(command)
        if self.writer is not None:
            for source in self._sources:
                records = source.move(self.writer)
                if records is not None:
                    self._unnoted.append((source, records))
            self.writer.flush()
            self._note()
            for picture in (picture for source in self._pictures for picture in source.read()):
                if picture.at >= (self._order.since or 0.0):
                    self.writer.picture(RecordedPicture(self._wall_ns(picture.at), picture.camera, picture.jpeg))
            for mark in self._marks:
                self.writer.mark(Mark(self._wall_ns(mark["at"]), shortened(mark["mark"])))
            self._marks.clear()

    def _note(self, *, wait: bool = False) -> None:
        """Write to the journal what the records tell, once what it needs is loaded."""
        if self._loading is None or (self._loading.is_alive() and not wait) or self.writer is None:
            return
        self._loading.join()
        from weberlink_recording.session_journal import SessionJournal  # noqa: PLC0415 - loaded by now

        for source, records in self._unnoted:
            if source.ring is not None:
                self._journal = self._journal or SessionJournal(self.writer, source.ring.rate_hz)
                self._journal.add(source.side, source.path, source.ring, records)
        self._unnoted.clear()

    def _obey(self, command: dict[str, Any]) -> None:
        if "mark" in command:
            self._marks.append(command)
        elif command.get("finish"):
            self._told.append(COMPLETE)

    def _wall_ns(self, at: float) -> int:
        assert self._clock is not None
        (wall_ns,) = Origin("master", 0.0, *self._clock).log_times_ns(np.array([at]))
        return int(wall_ns)

    def _announce(self, source: RingSource) -> None:
        ring = source.ring
        assert ring is not None
        if self._clock is None:
            # All rings of this host are on one clock: let the wall clock be read once for all of them.
            self._clock = (ring.started_wall_s, ring.started_monotonic_s)
        if self.writer is None:
            os.nice(NICENESS)  # not before: a short session must not be over before it is found
            self.writer = RecordingWriter.create(self._order.out, self._order.facts)
            self._loading = Thread(target=import_module, args=["weberlink_recording.session_journal"], daemon=True)
            self._loading.start()
        self.writer.add_side(Origin(source.side, ring.rate_hz, *self._clock))

    def _close(self, outcome: str) -> str:
        self._note(wait=True)
        if self._journal is not None:
            self._journal.flush()
        if self.writer is not None:
            self.writer.close(outcome)
        elif outcome == COMPLETE:  # told to finish before there was a ring, and so a file
            return f"no telemetry of {', '.join(self._order.rings)}"
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
        # An OSError's own text begins with its number.
        outcome = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    finally:
        recording.close(outcome)
    counted: dict[str, Any] = {"bytes": 0, "records": {}, "lost": {}, "marks": 0}
    if (writer := recording.writer) is not None:
        counted = {"bytes": writer.size, "records": writer.records, "lost": writer.lost, "marks": writer.marks}
    times = {"cpu_s": process_time(), "elapsed_s": monotonic() - began}
    try:
        sys.stdout.write(json.dumps({"path": order.out, **counted, **times, "outcome": outcome}))
        sys.stdout.flush()
    except BrokenPipeError:  # of a parent that has ended; Python would try to write again, and complain, at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return COMPLETED if outcome == COMPLETE else FAILED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
