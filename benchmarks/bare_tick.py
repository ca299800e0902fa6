"""The floor of each part of a tick: the same work with nothing around it, in a process that wakes at the same rate.

A bare process waits with epoll for a timer, then receives, opens, seals and sends a datagram of the same length and
packs a record of the same values: after a sleep (caches cold) and without a pause (caches warm). Bare event loops tell
what waking up costs: epoll, uvloop with a reader on the timer, and the ticker of the daemons with and without its lead.
"""

import asyncio
import gc
import os
import select
import socket
import sys
from collections.abc import Callable, Coroutine, Mapping, Sequence
from itertools import pairwise
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from time import monotonic_ns, perf_counter_ns, process_time_ns
from typing import Any

import uvloop
from cryptography.hazmat.primitives.ciphers.aead import AESCCM

from benchmarks import programs
from benchmarks.arrangement import Rights, rights_of, serve
from benchmarks.sealed_echo import KEYS, SALT, TAG_BYTES
from benchmarks.staged_tick import DECRYPT, READ, SEAL, SEND, TELEMETRY
from weberlink.protocol.wire import CLEAR_BYTES
from weberlink.realtime import timerfd
from weberlink.realtime.ticker import Ticker
from weberlink.telemetry.record import RECORD

STAGES = (READ, DECRYPT, TELEMETRY, SEAL, SEND)
EPOLL, UVLOOP, TICKER, LEADING = "epoll", "uvloop", "ticker", "leading"
SETTLE, CHUNK = 100, 50
"""Wake-ups that do not count, as the lead of a ticker is set after 50; and those of a piece of CPU time."""
TURNS = 5
"""The loops take turns, so that other load of the machine affects all alike."""
SHORT_S, LONG_S = 0.2, 1.2
"""Two runs of cyclictest, of which the difference does not contain its start."""


class BareTick:
    """The bare work of a tick on a socket that sends to itself.

    Args:
        bound: the socket, not yet bound.
        size: of a datagram [bytes].
        record: values of a telemetry record.
    """

    def __init__(self, bound: socket.socket, size: int, record: Sequence[float]) -> None:
        bound.bind(("127.0.0.1", 0))
        self._socket, self._address = bound, bound.getsockname()
        self._cipher = AESCCM(KEYS[0], tag_length=TAG_BYTES)
        self._nonce = SALT + bytes(8)
        self._head, self._body = bytes(CLEAR_BYTES), bytes(max(0, size - CLEAR_BYTES - TAG_BYTES))
        self._record = [
            int(value) if letter in "QB" else value for letter, value in zip(letters(), record, strict=True)
        ]
        self._memory = bytearray(RECORD.size)
        self.rows: list[list[int]] = []
        sealed = self._cipher.encrypt(self._nonce, self._body, self._head)
        self._socket.sendto(self._head + sealed, self._address)

    def tick(self) -> None:
        clock, cipher, nonce, head = perf_counter_ns, self._cipher, self._nonce, self._head
        t0 = clock()
        datagram = self._socket.recv(2048)
        t1 = clock()
        cipher.decrypt(nonce, datagram[CLEAR_BYTES:], head)
        t2 = clock()
        RECORD.pack_into(self._memory, 0, *self._record)
        t3 = clock()
        sealed = cipher.encrypt(nonce, self._body, head)
        t4 = clock()
        self._socket.sendto(head + sealed, self._address)
        t5 = clock()
        t6 = clock()
        self.rows.append([t0, t1, t2, t3, t4, t5, t6])

    def result(self) -> dict[str, float]:
        """Median of each stage without the cost of the clock [us]."""
        rows = self.rows[SETTLE:]
        empty = median(row[-1] - row[-2] for row in rows)
        return {
            stage: max(0.0, median(row[place + 1] - row[place] for row in rows) - empty) * 1e-3
            for place, stage in enumerate(STAGES)
        }


def letters() -> str:
    """One letter per value of a record."""
    letters, count = "", ""
    for letter in RECORD.format.lstrip("<=@"):
        if letter.isdigit():
            count += letter
            continue
        letters += letter * int(count or 1)
        count = ""
    return letters


class WakeCost:
    """Counts wake-ups and the CPU time between them.

    Args:
        count: wake-ups that count, at least two pieces.
    """

    def __init__(self, count: int) -> None:
        self._left = max(2 * CHUNK, count) + SETTLE
        self._marks: list[int] = []
        self.done = False

    def wake(self, *_: object) -> None:
        self._left -= 1
        if self._left % CHUNK == 0:
            self._marks.append(process_time_ns())
            self.done = self._left <= 0

    @property
    def us(self) -> float:
        """CPU time of a wake-up [us]."""
        pieces = [later - sooner for sooner, later in pairwise(self._marks[SETTLE // CHUNK :])]
        return median(pieces) * 1e-3 / CHUNK


def on_epoll(rate_hz: float, cost: WakeCost, tick: Callable[[], None] | None = None) -> float:
    """Wake at a rate in a bare epoll loop, and run `tick`; the CPU time of a wake-up with it [us]."""
    period, timer = round(1e9 / rate_hz), timerfd.create()
    try:
        with select.epoll() as waiting:
            waiting.register(timer, select.EPOLLIN)
            timerfd.arm(timer, monotonic_ns() + period, period)
            while not cost.done:
                waiting.poll()
                timerfd.expirations(timer)
                if tick is not None:
                    tick()
                cost.wake()
    finally:
        os.close(timer)
    return cost.us


def on_uvloop(rate_hz: float, cost: WakeCost) -> float:
    """The same with a reader in uvloop."""
    period, timer = round(1e9 / rate_hz), timerfd.create()

    async def main() -> None:
        done = asyncio.Event()

        def readable() -> None:
            timerfd.expirations(timer)
            cost.wake()
            if cost.done:
                done.set()

        loop = asyncio.get_running_loop()
        loop.add_reader(timer, readable)
        timerfd.arm(timer, monotonic_ns() + period, period)
        await done.wait()
        loop.remove_reader(timer)

    try:
        _run(main)
    finally:
        os.close(timer)
    return cost.us


def on_ticker(rate_hz: float, cost: WakeCost, *, leads: bool) -> float:
    """The same with the ticker of a daemon, woken before its deadline or not."""

    async def main() -> None:
        done = asyncio.Event()

        def tick(*_: object) -> None:
            cost.wake()
            if cost.done:
                done.set()

        with Ticker(1.0 / rate_hz, tick, leads=leads):
            await done.wait()

    _run(main)
    return cost.us


def _run(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(main())


def cyclictest_us(rate_hz: float, rights: Rights) -> float | None:
    """CPU time of a wake-up of a thread of cyclictest [us]; None where it is not installed."""
    if programs.cyclictest_version() is None:
        return None
    spent, cycles = [], []
    for duration_s in (SHORT_S, LONG_S):
        before = _children_s()
        line = programs.cyclictest_line(rate_hz, duration_s, rights, threads=1)
        cycles.append(len(programs.cyclictest(line, duration_s).latencies_us))
        spent.append(_children_s() - before)
    return max(0.0, 1e6 * (spent[1] - spent[0]) / (cycles[1] - cycles[0]))


def _children_s() -> float:
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _bare(order: Mapping[str, Any]) -> dict[str, Any]:
    rate_hz, count = order["rate_hz"], order["ticks"]
    rights = rights_of(order)
    made = cyclictest_us(rate_hz, rights)  # before this process takes the rights, which its children would inherit
    rights.take(0)
    gc.disable()
    loops: dict[str, Callable[[WakeCost], float]] = {
        EPOLL: lambda cost: on_epoll(rate_hz, cost),
        UVLOOP: lambda cost: on_uvloop(rate_hz, cost),
        TICKER: lambda cost: on_ticker(rate_hz, cost, leads=False),
        LEADING: lambda cost: on_ticker(rate_hz, cost, leads=True),
    }
    turns = [{name: loop(WakeCost(count // TURNS)) for name, loop in loops.items()} for _ in range(TURNS)]
    wakes = {name: median(turn[name] for turn in turns) for name in loops}
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        cold, warm = (BareTick(bound, order["size"], order["record"]) for bound in (one, other))
        on_epoll(rate_hz, WakeCost(count), cold.tick)
        for _ in range(count + SETTLE):
            warm.tick()
    return {"wakes_us": wakes, "cyclictest_us": made, "cold_us": cold.result(), "warm_us": warm.result()}


if __name__ == "__main__":
    sys.exit(serve(_bare))
