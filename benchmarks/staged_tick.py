"""A tick in stages: the steps of a daemon's tick, in its order and on its real parts, with a clock reading after each.

Half of the ticks are staged; the others are whole ticks of the side loop, so that the two can be compared and the
session stays as in a daemon. Nothing is replaced in a class, so this also measures a compiled program.

This module is also the process that measures: either one side, woken by timer and event loop as a daemon (caches cold),
or both sides in virtual time without any pause (caches warm). A datagram waits for the next tick here; in a daemon it
wakes the event loop.
"""

import asyncio
import json
import os
import socket
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from math import inf, isnan
from pathlib import Path
from resource import RUSAGE_THREAD, getrusage
from statistics import fmean, median
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter, perf_counter_ns, process_time_ns
from typing import Any, NamedTuple

import uvloop

from benchmarks.arrangement import BenchError, Rights, child, rights_of, serve, tell
from weberlink.geometry.vector import Vector
from weberlink.protocol.aio.queue import ReceiveQueue
from weberlink.protocol.aio.sockets import PEER_SHARE
from weberlink.protocol.events import Address, UpdateLost, UpdateReceived
from weberlink.protocol.liveness import HORIZON_SHARE
from weberlink.protocol.security import Incoming, Outgoing, Protection, Security
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.ticker import Ticker
from weberlink.system.composition.link import build_security
from weberlink.system.configuration import MASTER, SLAVE, Configuration, load
from weberlink.system.configuration.model import split_address
from weberlink.system.side import Side
from weberlink.telemetry.ring import RingWriter

READ, DECRYPT, PARSE, TIMERS, DECODE = "socket read", "decrypt", "parse", "timers", "decode"
DEVICE, CONTROL, ENCODE, PACK, SEAL, SEND = "device", "control", "encode", "pack", "seal", "send"
TELEMETRY = "telemetry"
PARTS = (READ, DECRYPT, PARSE, TIMERS, DECODE, DEVICE, CONTROL, ENCODE, PACK, SEAL, SEND, TELEMETRY)
CLOCK = "clock"
"""A stage that does nothing: what it takes is the cost of the timing."""
CHUNK = 50
"""Staged ticks, and whole ones, of a mean; the median over all chunks is reported."""
SETTLE_TICKS, CONNECT_TICKS = 1000, 30_000
RING_TICKS = 10_000


class CipherWatch:
    """Run time [ns] of the ciphers of a session, and the number of datagrams that they opened and sealed."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self.open_ns = self.seal_ns = self.opened = self.sealed = 0

    def protection(self, protection: Protection) -> Protection:
        """Watch the ciphers of one session."""
        watched = _WatchedCiphers(protection, self)
        protection.seal, protection.open = watched.seal, watched.open
        return protection


class _WatchedCiphers:
    def __init__(self, protection: Protection, watch: CipherWatch) -> None:
        self._seal, self._open, self._watch = protection.seal, protection.open, watch

    def seal(self, sequence: int, clear: bytes) -> bytes:
        began = perf_counter_ns()
        sealed = self._seal(sequence, clear)
        self._watch.seal_ns += perf_counter_ns() - began
        self._watch.sealed += 1
        return sealed

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        began = perf_counter_ns()
        opened = self._open(sequence, datagram)
        self._watch.open_ns += perf_counter_ns() - began
        self._watch.opened += 1
        return opened


class WatchedSecurity:
    """A security suite whose sessions are watched.

    Args:
        suite: the suite.
        watch: told of every datagram that is opened or sealed.
    """

    def __init__(self, suite: Security, watch: CipherWatch) -> None:
        self._suite, self._watch = suite, watch
        self.tag_size, self.overhead, self.private_size = suite.tag_size, suite.overhead, suite.private_size

    def call(self, prologue: bytes, private: bytes) -> Outgoing:
        return _WatchedCall(self._suite.call(prologue, private), self._watch)

    def hear(self, prologue: bytes, message: bytes) -> Incoming | None:
        heard = self._suite.hear(prologue, message)
        return None if heard is None else _WatchedAnswer(heard, self._watch)


class _WatchedCall:
    def __init__(self, exchange: Outgoing, watch: CipherWatch) -> None:
        self._exchange, self._watch = exchange, watch

    def hello(self, payload: bytes) -> bytes:
        return self._exchange.hello(payload)

    def open(self, message: bytes) -> tuple[bytes, Protection] | None:
        opened = self._exchange.open(message)
        return None if opened is None else (opened[0], self._watch.protection(opened[1]))


class _WatchedAnswer:
    def __init__(self, exchange: Incoming, watch: CipherWatch) -> None:
        self._exchange, self._watch = exchange, watch
        self.payload = exchange.payload

    def answer(self, payload: bytes, private: bytes) -> tuple[bytes, Protection] | None:
        made = self._exchange.answer(payload, private)
        return None if made is None else (made[0], self._watch.protection(made[1]))


class Row(NamedTuple):
    """A staged tick.

    Args:
        stamps: clock before the first stage and after each [ns].
        open_ns, seal_ns: time in the ciphers [ns].
        opened, sealed: datagrams that the ciphers opened and sealed.
        received: datagrams received.
        updates: made in this tick.
        sent: datagrams sent.
    """

    stamps: list[int]
    open_ns: int
    seal_ns: int
    opened: int
    sealed: int
    received: int
    updates: int
    sent: int

    def parts(self, names: Sequence[str], empty: float) -> list[tuple[float, int]]:
        """Time of each part [ns] without the cost of timing it, and how often it ran.

        Args:
            names: part of each stage, in their order.
            empty: time of a stage that does nothing [ns].
        """
        spent: dict[str, float] = dict.fromkeys((*PARTS, CLOCK), 0.0)
        for name, before, after in zip(names, self.stamps, self.stamps[1:], strict=False):
            spent[name] += after - before - empty
        # An update is sealed in its packing; other datagrams, such as heartbeats, in the timers.
        of_updates = self.updates / self.sealed if self.sealed else 0.0
        spent[DECRYPT] = self.open_ns - self.opened * empty
        spent[SEAL] = self.seal_ns - self.sealed * empty
        spent[PARSE] -= self.open_ns + self.opened * empty
        sealing = self.seal_ns + self.sealed * empty
        spent[PACK] -= of_updates * sealing
        spent[TIMERS] -= (1.0 - of_updates) * sealing
        ran = dict.fromkeys(PARTS, 1) | {
            DECRYPT: self.opened, PARSE: self.received,
            PACK: self.updates, SEAL: self.sealed, SEND: self.sent,
        }  # fmt: skip
        return [(max(0.0, spent[part]), ran[part]) for part in PARTS]


def costs(ticks: Sequence[Sequence[tuple[float, int]]]) -> dict[str, dict[str, float | None]]:
    """By part: times of a tick, microseconds of a tick, and of each time.

    Args:
        ticks: time [ns] and number of each of the `PARTS`, for every tick.
    """
    found: dict[str, dict[str, float | None]] = {}
    for part, cells in zip(PARTS, zip(*ticks, strict=True), strict=True):
        each = [spent / ran for spent, ran in cells if ran]
        found[part] = {
            "times": sum(ran for _, ran in cells) / len(cells),
            "us": chunk_median([spent for spent, _ in cells]) * 1e-3,
            "each_us": median(each) * 1e-3 if each else None,
        }
    return found


def chunk_median(values: Sequence[float], chunk: int = CHUNK) -> float:
    """Median over the means of successive chunks: one disturbed tick changes nothing, and rare work still counts."""
    size = min(chunk, len(values))
    return median(fmean(values[start : start + size]) for start in range(0, len(values) - size + 1, size))


class StagedSide:
    """One side with its socket and ring, which ticks in stages or as a whole.

    Args:
        side: open.
        bound: its socket, not blocking.
        ring: for its telemetry.
        watch: of the ciphers of its session.
        tick_period: of both sides [s].
        horizon: how long a model is extrapolated past the last sign of the peer's encoder [s].
    """

    def __init__(
        self, side: Side, bound: socket.socket, ring: RingWriter, watch: CipherWatch, tick_period: float, horizon: float
    ) -> None:
        self.side, self._socket, self._ring, self._watch = side, bound, ring, watch
        self._index, self._deadline, self._now = 0, 0.0, 0.0
        # As the shell reads, but in the tick alone: this loop never runs. The clock stands still in a tick, so that the
        # queue never has to wait.
        self._loop = uvloop.new_event_loop()
        self._queue = ReceiveQueue(
            bound, loop=self._loop, now=self._time, take=self._found, on_datagrams=self._rest, share=PEER_SHARE
        )
        self._endpoint, self._port = side.endpoint, side.port
        self._tick_period, self._horizon = tick_period, horizon
        self._elapsed = self._peer_tick = 0.0
        self._datagrams: list[tuple[bytes, Address]] = []
        self._outbox: list[tuple[bytes, Address]] = []
        around = (PARSE, self._take), (TIMERS, self._handle_timer)
        leave = (TIMERS, self._fetch), (SEND, self._transmit), (TELEMETRY, self._record), (CLOCK, self._rest)
        sends = (CONTROL, self._account), (ENCODE, self._encode), (PACK, self._post)
        acts = (DECODE, self._decode), (CONTROL, self._actuate)
        order = ((DEVICE, self._sense), *sends, *acts) if self._port.leads else (*acts, (DEVICE, self._sense), *sends)
        stages = ((READ, self._read), *around, (DECODE, self._hear), *order, *leave)
        self.names = tuple(name for name, _ in stages)
        self._stages = tuple(stage for _, stage in stages)
        self._ticks = 0
        self._values: list[Vector | None] = []
        self.rows: list[Row] = []
        self.whole_ns: list[int] = []
        """Work of each whole tick."""
        self.outside_ns: list[int] = []
        """CPU time between two ticks."""
        self._cpu_ns = 0
        self.lengths: list[int] = []
        """Of the datagrams received."""

    @property
    def engaged(self) -> bool:
        return self.side.engaged

    def tick(self, index: int, deadline: float, now: float) -> None:
        """Run a tick, staged or whole.

        Both kinds take turns in the Thue-Morse sequence, in which no periodic work of a part meets only one of them. A
        tick in which another program took the processor does not count.
        """
        if self._cpu_ns:
            self.outside_ns.append(process_time_ns() - self._cpu_ns)
        preempted = getrusage(RUSAGE_THREAD).ru_nivcsw
        self._index, self._deadline, self._now = index, deadline, now
        self._ticks += 1
        if self._ticks.bit_count() % 2 and self.side.engaged:
            row = self._run_stages()
            if getrusage(RUSAGE_THREAD).ru_nivcsw == preempted:
                self.rows.append(row)
        else:
            whole_ns = self._run_whole()
            if getrusage(RUSAGE_THREAD).ru_nivcsw == preempted:
                self.whole_ns.append(whole_ns)
        self._cpu_ns = process_time_ns()

    def _run_stages(self) -> Row:
        side, clock = self.side, perf_counter_ns
        watch = self._watch
        side.index, side.deadline = self._index, self._deadline
        self._elapsed = side.pace.tick(self._now)
        watch.clear()
        stamps = [clock()]
        for stage in self._stages:
            stage()
            stamps.append(clock())
        self.lengths += [len(data) for data, _ in self._datagrams]
        received, sent = len(self._datagrams), len(self._outbox)
        updates = sum(channel.update is not None for channel in side.outgoing)
        return Row(stamps, watch.open_ns, watch.seal_ns, watch.opened, watch.sealed, received, updates, sent)

    def _run_whole(self) -> int:
        began = perf_counter_ns()
        self._read()
        self._take()
        self._handle_timer()
        self.side.tick(self._index, self._deadline, self._now)
        self._fetch()
        self._transmit()
        took = perf_counter_ns() - began
        self._record()
        return took

    # --- the stages

    def _read(self) -> None:
        self._datagrams = []
        self._queue.read()

    def _time(self) -> float:
        return self._now

    def _found(self, data: bytes, source: Address, _now: float) -> None:
        self._datagrams.append((data, source))

    def _take(self) -> None:
        for data, source in self._datagrams:
            self._endpoint.receive_datagram(data, source, self._now)

    def _handle_timer(self) -> None:
        self._endpoint.handle_timer(self._now)

    def _hear(self) -> None:
        """Other events need nothing here: they change nothing that a stage does."""
        side = self.side
        for channel in side.incoming:
            channel.received = 0
        while (event := self._endpoint.next_event()) is not None:
            if isinstance(event, UpdateReceived):
                side.incoming[event.stream].apply(event.update)
            elif isinstance(event, UpdateLost):
                side.outgoing[event.stream].encoder.restart()

    def _sense(self) -> None:
        reading = self._port.latest(self._now)
        for channel in self.side.outgoing:
            channel.sensor.take(reading)
        self._port.accept(reading)

    def _account(self) -> None:
        endpoint = self._endpoint
        endpoint.report_encoding(self._now, is_encoding=True)
        endpoint.credit = self._port.account(self._elapsed, self._peer_tick, encodes=True)

    def _encode(self) -> None:
        for channel in self.side.outgoing:
            channel.encode(self._index)

    def _post(self) -> None:
        for channel in self.side.outgoing:
            if channel.update is not None:
                self._endpoint.send_update(self._now, channel.update, stream=channel.stream)

    def _decode(self) -> None:
        endpoint = self._endpoint
        heard_at = endpoint.liveness.encoder_heard_at
        if heard_at > -inf:
            peer_time = endpoint.latest_receivable_peer_time(min(self._now, heard_at + self._horizon))
            if peer_time is not None:
                self._peer_tick = peer_time / self._tick_period
        self._values = [channel.decode(self._peer_tick) for channel in self.side.incoming]

    def _actuate(self) -> None:
        self._port.actuate(self._values, self._now, self._elapsed, self.side.pace.step, engaged=True)

    def _fetch(self) -> None:
        self._outbox = self._endpoint.datagrams_to_send()
        self._endpoint.next_timer()

    def _transmit(self) -> None:
        for data, address in self._outbox:
            self._socket.sendto(data, address)

    def _record(self) -> None:
        self._ring.write(self.side.values(0.0, 0.0, 0))

    def _rest(self) -> None: ...

    def close(self) -> None:
        self._queue.close()
        self._loop.close()

    # --- the result

    def clear(self) -> None:
        """Forget all ticks until now."""
        self.rows, self.whole_ns, self.outside_ns, self.lengths = [], [], [], []

    def result(self) -> dict[str, Any]:
        """The costs of all parts, of a whole tick and outside of it [us], and what a limit needs to do the same.

        Raises:
            BenchError: if nothing was staged, or the ciphers were not seen at work.
        """
        if not self.rows or not self.whole_ns:
            raise BenchError("no tick was staged: the session was not engaged, or other programs had the processor")
        empty = median(row.stamps[-1] - row.stamps[-2] for row in self.rows)
        if sum(row.received for row in self.rows) and not sum(row.opened for row in self.rows):
            raise BenchError("datagrams were received, but none was seen being opened: the ciphers are not watched")
        return {
            "parts": costs([row.parts(self.names, empty) for row in self.rows]),
            "whole_us": chunk_median(self.whole_ns) * 1e-3,
            "outside_us": chunk_median(self.outside_ns) * 1e-3,
            "ticks": len(self.rows),
            "datagram_bytes": median(self.lengths) if self.lengths else None,
            "record": [0.0 if isnan(value) else value for value in map(float, self.side.record())],
        }


class ColdRun:
    """One side woken by timer and event loop as in a daemon.

    It goes on when it has measured, until it is killed: the other side still needs it.

    Args:
        staged: the side.
        period_s: between ticks [s].
        ticks: that count.
        tell: receives the result.
    """

    def __init__(self, staged: StagedSide, period_s: float, ticks: int, tell: Callable[[dict[str, Any]], None]) -> None:
        self._staged, self._wanted, self._tell = staged, ticks, tell
        self._ticker = Ticker(period_s, self._tick, on_error=self._fail)
        self._engaged = self._alone = 0
        self._error: BaseException | None = None
        self._done = asyncio.Event()

    def _tick(self, index: int, deadline: float, now: float) -> None:
        staged = self._staged
        staged.tick(index, deadline, now)
        if not staged.engaged:
            self._alone += 1
            if self._alone == CONNECT_TICKS:
                raise BenchError("a staged tick: the two sides did not connect")
            return
        self._alone = 0
        self._engaged += 1
        if self._engaged == SETTLE_TICKS:
            staged.clear()
        elif self._engaged == SETTLE_TICKS + self._wanted:
            self._tell(staged.result())

    def _fail(self, error: BaseException) -> None:
        self._error = error
        self._done.set()

    async def _main(self) -> None:
        self._ticker.start()
        await self._done.wait()

    def run(self) -> None:
        """Run until killed.

        Raises:
            BaseException: what a tick raised.
        """
        freeze_garbage()
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(self._main())
        if self._error is not None:
            raise self._error


def build(name: str, configuration: Configuration, peer: Address, watch: CipherWatch, epoch: float) -> Side:
    """A side as in a daemon, whose ciphers are watched."""
    common: dict[str, Any] = {
        "security": WatchedSecurity(build_security(configuration), watch),
        "entropy": os.urandom,
        "epoch": epoch,
        "stopwatch": perf_counter,
    }
    # Each side imports its own parts only.
    if name == MASTER:
        from weberlink.system.composition.master import build_master  # noqa: PLC0415

        return build_master(configuration, peer=peer, **common)
    from weberlink.system.composition.slave import build_slave  # noqa: PLC0415

    return build_slave(configuration, **common)


def staged_side(
    name: str, configuration: Configuration, address: Address, epoch: float, stack: ExitStack
) -> StagedSide:
    """A side, open, with its socket and ring, which the stack closes.

    Args:
        name: of the side.
        configuration: of the system.
        address: of the slave, which its side claims.
        epoch: time of tick 0 [s].
        stack: closes all.
    """
    watch, system = CipherWatch(), configuration.system
    side = build(name, configuration, address, watch, epoch)
    bound = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    bound.bind(address if name == SLAVE else (address[0], 0))
    bound.setblocking(False)
    path = Path(stack.enter_context(TemporaryDirectory())) / name
    ring = stack.enter_context(RingWriter.create(path, side=name, rate_hz=system.rate_hz, capacity=RING_TICKS))
    side.open(epoch)
    stack.callback(side.close)
    horizon = HORIZON_SHARE * system.link.silence_ms * 1e-3
    staged = StagedSide(side, bound, ring, watch, system.tick_period, horizon)
    stack.callback(staged.close)
    return staged


def cold(order: Mapping[str, Any], configuration: Configuration) -> None:
    """Measure one side in real time, with the rights of its daemon, and print its result as a line."""
    name = order["side"]
    address = split_address(configuration.system.link.slave)
    with ExitStack() as stack:
        staged = staged_side(name, configuration, address, monotonic(), stack)
        rights_of(order).take(0 if name == MASTER else 1)
        period = configuration.system.tick_period
        ColdRun(staged, period, order["ticks"], lambda found: tell(json.dumps(found) + "\n")).run()


def warm(order: Mapping[str, Any], configuration: Configuration) -> dict[str, Any]:
    """Measure both sides in virtual time without a pause."""
    address = split_address(configuration.system.link.slave)
    rights_of(order).take(0)
    period = configuration.system.tick_period
    with ExitStack() as stack:
        sides = {name: staged_side(name, configuration, address, 0.0, stack) for name in (SLAVE, MASTER)}
        freeze_garbage()
        settled = 0
        for index in range(CONNECT_TICKS + order["ticks"]):
            for staged in sides.values():
                staged.tick(index, index * period, index * period)
            settled += all(staged.engaged for staged in sides.values())
            if settled == SETTLE_TICKS:
                for staged in sides.values():
                    staged.clear()
            if settled == SETTLE_TICKS + order["ticks"]:
                return {name: staged.result() for name, staged in sides.items()}
    raise BenchError("a staged tick: the two sides did not connect in virtual time")


def cold_sides(order: Mapping[str, Any], rights: Rights) -> dict[str, dict[str, Any]]:
    """Measure both sides in real time, each in a process of its own.

    Raises:
        BenchError: if one of them fails.
    """
    found = {}
    with ExitStack() as stack:
        running = {
            side: stack.enter_context(child("staged_tick", {**order, "side": side}, rights)) for side in (SLAVE, MASTER)
        }
        for side, process in running.items():
            assert process.stdout is not None
            line = process.stdout.readline()
            if not line:
                raise BenchError(f"the staged ticks of the {side}: the process failed")
            found[side] = json.loads(line)
    return found


def _serve(order: dict[str, Any]) -> dict[str, Any] | None:
    configuration = load(Path(order["file"]), order["overrides"])
    if "side" not in order:
        return warm(order, configuration)
    cold(order, configuration)
    return None


if __name__ == "__main__":
    sys.exit(serve(_serve))
