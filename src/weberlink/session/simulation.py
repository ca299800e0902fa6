"""The whole system in virtual time: both sides and an emulated link. The same seed gives the same run, bit for bit."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Protocol

import numpy as np

from weberlink.figures.session import Records
from weberlink.protocol.emulation import EmulatedLink
from weberlink.session.interruption import Interruption
from weberlink.session.side import Side
from weberlink.telemetry.record import DESCRIPTION, RECORD, Record

MASTER_ADDRESS = ("master", 1)
SLAVE_ADDRESS = ("slave", 2)
CHUNK = 1000
"""Ticks after which the observers get the records."""

Link = EmulatedLink[tuple[str, int]]


class Observer(Protocol):
    """Reads the records of a run: a score, a recorder."""

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides."""
        ...


class Simulation:
    """Two sides and a link, stepped tick by tick.

    A datagram arrives at its own time, also between ticks. In a tick the master goes first: over a link without delay a
    position is acted on in the tick in which it was sent, and the force is felt one tick later.

    Args:
        master: the operator's side; its endpoint's epoch is `epoch`.
        slave: the teleoperator's side, likewise.
        links: the faults from master to slave, and those from slave to master.
        tick_period: [s].
        epoch: time of tick 0 [s].
    """

    def __init__(
        self,
        *,
        master: Side,
        slave: Side,
        links: tuple[Link, Link],
        tick_period: float,
        epoch: float = 0.0,
    ) -> None:
        self.master = master
        self.slave = slave
        self._forward, self._backward = links
        self._tick_period = tick_period
        self._epoch = epoch
        self._index = 0
        self._opened = False

    def run(
        self, duration: float | None, observers: Sequence[Observer], interruption: Interruption | None = None
    ) -> None:
        """Run to the end of the duration [s], or of the device's motion where that comes first, or to Ctrl-C.

        Args:
            duration: None to run until the device ends.
            observers: fed with the records of both sides, piece by piece.
            interruption: notes Ctrl-C, which costs less than a piece; None to let it raise KeyboardInterrupt.
        """
        chunks: Iterable[tuple[Records, Records]] = self._chunks(duration)
        for records in chunks if interruption is None else interruption.pieces(chunks):
            for observer in observers:
                observer.add(*records)

    def _chunks(self, duration: float | None) -> Iterator[tuple[Records, Records]]:
        ticks = self._ticks(duration)
        error = None
        while error is None:
            chunk = []
            try:
                for records in islice(ticks, CHUNK):
                    chunk.append(records)  # noqa: PERF402 - those before an error count
            except Exception as raised:
                error = raised
            if not chunk:
                break
            masters, slaves = zip(*chunk, strict=True)
            yield as_array(masters), as_array(slaves)
        if error is not None:
            raise error

    def _ticks(self, duration: float | None) -> Iterator[tuple[Record, Record]]:
        last = None if duration is None else self._index + round(duration / self._tick_period)
        while True:
            if self._index == last:
                self.master.stop(self._epoch + self._index * self._tick_period, "completed")
            yield self.step()
            if self.master.stopped:
                return

    def close(self) -> None:
        """Close device and robot; may be repeated."""
        self.master.close()
        self.slave.close()

    def step(self) -> tuple[Record, Record]:
        """One tick of both sides; returns what they would write to telemetry."""
        now = self._epoch + self._index * self._tick_period
        if not self._opened:
            self._opened = True
            self.slave.open(now)
            self.master.open(now)
        self._carry(now)
        self.master.endpoint.handle_timer(now)
        self.master.tick(self._index, now, now)
        self._post(now)
        self._carry(now)
        self.slave.endpoint.handle_timer(now)
        self.slave.tick(self._index, now, now)
        self._post(now)
        self._index += 1
        return self.master.record(), self.slave.record()

    def _post(self, now: float) -> None:
        for data, address in self.master.endpoint.datagrams_to_send():
            self._forward.send(data, address, now)
        for data, address in self.slave.endpoint.datagrams_to_send():
            self._backward.send(data, address, now)

    def _carry(self, now: float) -> None:
        """Deliver all that arrives by now, each datagram at its own time."""
        while True:
            due = [at for link in (self._forward, self._backward) if (at := link.next_due()) is not None and at <= now]
            if not due:
                return
            at = min(due)
            for data, _ in self._forward.receive(at):
                self.slave.endpoint.receive_datagram(data, MASTER_ADDRESS, at)
            for data, _ in self._backward.receive(at):
                self.master.endpoint.receive_datagram(data, SLAVE_ADDRESS, at)
            self._post(at)


def as_array(records: Sequence[Record]) -> Records:
    """Records as the structured array that a telemetry reader would return."""
    return np.frombuffer(b"".join(RECORD.pack(*record) for record in records), dtype=np.dtype(DESCRIPTION))
