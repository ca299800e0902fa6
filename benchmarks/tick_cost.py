"""CPU time of a tick of each side by part: both loops in this process, in virtual time, on real sockets.

The sides are composed as in the daemons and run in the order of a daemon's tick; only waking up, and the cold caches
after it, are left out. A part is the public methods of its classes (`benchmarks.meter`), so encryption is not counted
in the protocol that calls it. `rest` is the loop itself with its safety.
"""

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, perf_counter_ns, thread_time_ns
from typing import Any, cast

import uvloop

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from benchmarks.meter import Account, Meter, Overhead, calibrate, metered
from weberlink.codec import Decoder, Encoder
from weberlink.control.tuning import Tuning
from weberlink.master.operator_port import OperatorPort
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.psk import CcmCipher
from weberlink.protocol.states import State
from weberlink.realtime.garbage import freeze_garbage, thaw_garbage
from weberlink.slave.robot_port import RobotPort
from weberlink.system.composition.link import build_security
from weberlink.system.composition.master import build_master
from weberlink.system.composition.slave import build_slave
from weberlink.system.configuration import MASTER, SLAVE, Configuration
from weberlink.system.side import Side
from weberlink.telemetry.ring import RingWriter

DEVICE, CODEC, CONTROL, PROTOCOL, SECURITY = "device", "codec", "control", "protocol", "security"
SOCKET, TELEMETRY, REST = "socket", "telemetry", "rest"
PARTS = (DEVICE, CODEC, CONTROL, PROTOCOL, SECURITY, SOCKET, TELEMETRY, REST)
CHUNK = 250
"""Ticks of a mean; the median over all chunks is reported."""
WARM_UP = 1000
CONNECT_LIMIT = 5000
TICKS, QUICK_TICKS = 20_000, 2_500
TURNS = 5
"""Alternating runs with and without a meter."""
RING = 1000
HOST = "127.0.0.1"

Chunks = dict[str, list[Account]]
"""Accounts of each chunk of ticks, by side."""


class DaemonEnd:
    """One side as in a daemon: loop, shell around its endpoint, ring.

    Args:
        name: of the side.
        loop: open.
        shell: likewise.
        ring: for its telemetry.
        meter: charged while it ticks.
    """

    def __init__(self, name: str, loop: Side, shell: UdpShell, ring: RingWriter, meter: Meter) -> None:
        self.name = name
        self.loop = loop
        self.account = Account()
        self.shell = shell
        self._ring = ring
        self._meter = meter
        self._values = meter.timed(TELEMETRY, loop.values)

    def tick(self, index: int, now: float) -> None:
        """Run one tick in the order of a daemon."""
        with self._meter.charging(self.account, REST):
            self.shell.service(now)
            self.loop.tick(index, now, now)
            self.shell.flush(now)
            self._ring.write(self._values(0.0, 0.0, 0))


class DaemonPair:
    """Both sides on sockets of this host in shared virtual time.

    Args:
        configuration: of the system.
        meter: charged by both.
        stack: closes the opened resources.
    """

    def __init__(self, configuration: Configuration, meter: Meter, stack: ExitStack) -> None:
        self.now = 0.0
        self._index = 0
        self._period = configuration.system.tick_period
        self._meter = meter
        self._stack = stack
        self._folder = Path(stack.enter_context(TemporaryDirectory()))
        self._events = uvloop.new_event_loop()
        stack.callback(self._events.close)
        common: dict[str, Any] = {
            "security": build_security(configuration),
            "entropy": os.urandom,
            "epoch": 0.0,
            "stopwatch": perf_counter,
        }
        self.slave = self._end(SLAVE, build_slave(configuration, **common))
        peer = self.slave.shell.address
        self.master = self._end(MASTER, build_master(configuration, peer=peer, **common))

    @property
    def ends(self) -> tuple[DaemonEnd, DaemonEnd]:
        return self.master, self.slave

    @property
    def engaged(self) -> bool:
        return all(end.loop.endpoint.state is State.ENGAGED for end in self.ends)

    def step(self) -> None:
        """Run one tick of both sides, the master first."""
        self.now = self._index * self._period
        for end in self.ends:
            end.tick(self._index, self.now)
        self._index += 1

    def _end(self, name: str, loop: Side) -> DaemonEnd:
        shell = UdpShell(loop.endpoint, now=lambda: self.now, listen=(HOST, 0))
        loop.open(self.now)
        self._stack.callback(loop.close)
        self._events.run_until_complete(shell.open(self._events))
        self._stack.callback(shell.close)
        ring = RingWriter.create(self._folder / name, side=name, rate_hz=1.0 / self._period, capacity=RING)
        self._stack.enter_context(ring)
        return DaemonEnd(name, loop, shell, ring, self._meter)


@dataclass(frozen=True)
class TickCost:
    """Run time of a tick of each side [us]: by part, and as a whole without a meter."""

    parts_us: Mapping[str, Mapping[str, float]]
    unmetered_us: Mapping[str, float]
    ticks: int
    overhead: Overhead

    def total_us(self, side: str) -> float:
        return sum(self.parts_us[side].values())

    def as_json(self) -> dict[str, Any]:
        return {
            "ticks": self.ticks,
            "parts_us": {side: dict(parts) for side, parts in self.parts_us.items()},
            "total_us": {side: self.total_us(side) for side in self.parts_us},
            "unmetered_us": dict(self.unmetered_us),
            "timing_us": {"inside": self.overhead.inside * 1e-3, "outside": self.overhead.outside * 1e-3},
        }


def measure(arrangement: Arrangement) -> TickCost:
    """Run both sides; needs no rights.

    Raises:
        BenchError: if they do not connect.
        ConfigurationError: if the file or an override is wrong.
    """
    configuration = arrangement.configuration(arrangement.overrides(MAIN_RATE_HZ))
    ticks = (QUICK_TICKS if arrangement.quick else TICKS) // TURNS
    meter = Meter()
    bare: Chunks = {MASTER: [], SLAVE: []}
    timed: Chunks = {MASTER: [], SLAVE: []}
    with ExitStack() as stack:
        plain = DaemonPair(configuration, meter, stack)
        parts = {kind: part for end in plain.ends for kind, part in classes(end.loop).items()}
        _connect(plain)
        with metered(meter, parts):
            watched = DaemonPair(configuration, meter, stack)
            _connect(watched)
        for _ in range(TURNS):
            _run(plain, ticks, bare)
            with metered(meter, parts):
                _run(watched, ticks, timed)
    return assemble(bare, timed, calibrate(), TURNS * ticks)


def assemble(bare: Chunks, timed: Chunks, empty: Overhead, ticks: int) -> TickCost:
    """The cost by part, corrected so that both sides together cost as much as without a meter.

    Timing a call costs more among other code than in a loop of empty calls. The empty calls tell how the cost divides
    between caller and callee; the runs with and without a meter tell how much it is.
    """
    extra = sum(_total(timed[side]) - _total(bare[side]) for side in timed)
    expected = sum(_cost(timed[side], empty) - _cost(bare[side], empty) for side in timed)
    factor = max(0.0, extra / expected)
    overhead = Overhead(factor * empty.inside, factor * empty.outside)
    parts = {side: _medians([overhead.corrected(account) for account in each]) for side, each in timed.items()}
    return TickCost(parts, {side: _total(each) for side, each in bare.items()}, ticks, overhead)


def _total(chunks: Sequence[Account]) -> float:
    return sum(_medians([account.spent for account in chunks]).values())


def _cost(chunks: Sequence[Account], overhead: Overhead) -> float:
    """Cost of timing in the median chunk: microseconds of a tick."""
    return median(overhead.cost(account) for account in chunks) * 1e-3 / CHUNK


def _medians(chunks: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Median of each part over the chunks: microseconds of a tick."""
    return {part: median(chunk.get(part, 0.0) for chunk in chunks) * 1e-3 / CHUNK for part in PARTS}


def classes(loop: Side) -> dict[type, str]:
    """The part of each class of a side."""
    port = loop.port
    device = port.device if isinstance(port, OperatorPort) else cast(RobotPort, port).robot
    own = {type(device): DEVICE, type(port.control): CONTROL, Tuning: CONTROL}
    return own | {
        Encoder: CODEC,
        Decoder: CODEC,
        Endpoint: PROTOCOL,
        CcmCipher: SECURITY,
        UdpShell: SOCKET,
        RingWriter: TELEMETRY,
    }


def _connect(pair: DaemonPair) -> None:
    """Run until both sides are engaged and warm."""
    for _ in range(CONNECT_LIMIT):
        if pair.engaged:
            break
        pair.step()
    else:
        raise BenchError("the two sides did not connect in virtual time")
    for _ in range(WARM_UP):
        pair.step()


def _run(pair: DaemonPair, ticks: int, chunks: Chunks) -> None:
    """Collect the accounts of each chunk of ticks, without the time that other processes had the processor."""
    freeze_garbage()
    try:
        for _ in range(max(1, ticks // CHUNK)):
            for end in pair.ends:
                end.account = Account()
            began, ran = perf_counter_ns(), thread_time_ns()
            for _ in range(CHUNK):
                pair.step()
            own = (thread_time_ns() - ran) / (perf_counter_ns() - began)
            for end in pair.ends:
                chunks[end.name].append(end.account.scaled(own))
    finally:
        thaw_garbage()
