"""Latency of an update between two processes, beside limits with the same bytes and rights.

The limits are plain sockets, bare Python processes that seal and open (`sealed_echo`), and sockperf. All are measured
in turn, the limits before and after, with one question at a time.

This module is also a process: one end of an echo over plain blocking sockets. `coded_echo` is the echo through codec,
endpoint and event loop. An answering process prints its port and, at its end, its moments; an asking one prints its
moments. All moments are of the monotonic clock of this host [ns].
"""

import gc
import os
import socket
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from struct import Struct
from time import monotonic, monotonic_ns
from typing import Any

import numpy as np

from benchmarks import programs
from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError, Rights, answers, child, rights_of, serve, tell
from benchmarks.percentiles import Series, Summary, ratios, summary
from weberlink.realtime import timerfd

WAYS = ("position", "force", "round_trip")  # master to slave, slave to master, and both
ONE_WAY = WAYS[:2]
CODED_SHARE, LIMIT_SHARE = 0.25, 0.125  # shares of the duration for the coded echo, and for each half of each limit
WARM_UP_S = 0.3  # questions that do not count
PATIENCE_S = 60.0
ASK, ANSWER = "ask", "answer"
HOST = "127.0.0.1"
SIZE = 48  # A force update with history and tag, the longest of three axes [B]
NUMBER = Struct("<Q")
ANSWER_S = 1.0  # longest wait for an answer of a plain socket

Moments = dict[int, tuple[int, int]]  # two moments [ns] of each question, by its number


@dataclass(frozen=True)
class Trips:
    """Trip times of each answered question: there, back, and both [us]."""

    there_us: Series
    back_us: Series
    round_us: Series

    def of(self, way: str) -> Series:
        """The times of one of the `WAYS`."""
        return {"position": self.there_us, "force": self.back_us, "round_trip": self.round_us}[way]


@dataclass(frozen=True)
class Latency:
    """Trips of updates, of the same bytes plain and sealed between bare processes, and of sockperf if it is there."""

    coded: Trips
    plain: Trips
    sealed: Trips
    sockperf: Series | None
    sockperf_version: str | None

    def one_way_us(self, name: str) -> float:
        """A percentile of the slower way [us]."""
        return max(value for way in ONE_WAY if (value := summary(self.coded.of(way))[name]) is not None)

    def worst_ratio(self, name: str) -> float | None:
        """A percentile of a way over that of a sealed exchange between bare processes, of the worse way."""
        found = [ratios(summary(self.coded.of(way)), summary(self.sealed.of(way)))[name] for way in ONE_WAY]
        return max((value for value in found if value is not None), default=None)

    def as_json(self) -> dict[str, Any]:
        coded, plain, sealed = (_summaries(trips) for trips in (self.coded, self.plain, self.sealed))
        fast = None if self.sockperf is None else summary(self.sockperf)
        return {
            "rate_hz": MAIN_RATE_HZ,
            "size_bytes": SIZE,
            "updates": len(self.coded.round_us),
            "weberlink_us": coded,
            "plain_socket_us": plain,
            "sealed_socket_us": sealed,
            "sockperf": None
            if fast is None or self.sockperf is None
            else {"version": self.sockperf_version, "questions": len(self.sockperf), "round_trip_us": fast},
            "ratio_to_plain": {way: ratios(coded[way], plain[way]) for way in WAYS},
            "ratio_to_sealed": {way: ratios(coded[way], sealed[way]) for way in WAYS},
            "ratio_to_sockperf": None if fast is None else {"round_trip": ratios(coded["round_trip"], fast)},
        }


def measure(arrangement: Arrangement, rights: Rights) -> Latency:
    """Measure the limits, the updates, and the limits again."""
    version = programs.sockperf_version()
    half_s = LIMIT_SHARE * arrangement.duration_s
    order = {"file": str(arrangement.file), "overrides": arrangement.overrides(MAIN_RATE_HZ)}
    fast, plain, sealed = [], [], []
    for turn in range(2):
        if version is not None:
            fast.append(programs.sockperf(SIZE, half_s, rights))
        plain.append(echo("latency", {}, MAIN_RATE_HZ, half_s, rights))
        sealed.append(echo("sealed_echo", {}, MAIN_RATE_HZ, half_s, rights))
        if turn == 0:
            coded = echo("coded_echo", order, MAIN_RATE_HZ, CODED_SHARE * arrangement.duration_s, rights)
    return Latency(coded, _joined(plain), _joined(sealed), np.concatenate(fast) if fast else None, version)


def _joined(halves: Sequence[Trips]) -> Trips:
    return Trips(*(np.concatenate(both) for both in zip(*(vars(part).values() for part in halves), strict=True)))


def _summaries(trips: Trips) -> Mapping[str, Summary]:
    return {way: summary(trips.of(way)) for way in WAYS}


def echo(module: str, order: Mapping[str, Any], rate_hz: float, duration_s: float, rights: Rights) -> Trips:
    """Run an asking and an answering process.

    Args:
        module: of both processes.
        order: further entries of their order.
        rate_hz: of questions [Hz].
        duration_s: of those that count [s].
        rights: of both processes; those of the master for the asking one.
    """
    common = dict(order) | {
        "rate_hz": rate_hz,
        "questions": max(1, round(rate_hz * duration_s)),
        "warm_up": round(rate_hz * WARM_UP_S),
        "epoch": monotonic(),
    }
    with ExitStack() as stack:
        answering = stack.enter_context(child(module, common | {"end": ANSWER}, rights))
        assert answering.stdout is not None
        port = answering.stdout.readline().strip()
        if not port.isdigit():
            raise BenchError(f"{module}: the answering process did not start")
        asking = stack.enter_context(child(module, common | {"end": ASK, "port": int(port)}, rights))
        asked, answered = answers([asking, answering], 2.0 * duration_s + PATIENCE_S, module)
    return join(asked, answered, common["warm_up"])


def join(asked: Mapping[str, list[int]], answered: Mapping[str, list[int]], warm_up: int) -> Trips:
    """The trips of the questions that both ends know.

    Args:
        asked: by number of the question, when it began and when its answer arrived [ns].
        answered: by number, when it arrived and when its answer began [ns].
        warm_up: first numbers that do not count.
    """
    first = min(map(int, asked), default=0) + warm_up
    numbers = [number for number in sorted(asked.keys() & answered.keys(), key=int) if int(number) >= first]
    if not numbers:
        raise BenchError("echo: no question was answered")
    moments = np.array([[*asked[number], *answered[number]] for number in numbers], dtype=np.float64)
    began, ended, there, back = moments.T * 1e-3
    return Trips(there - began, ended - back, ended - began)


def ask(port: int, rate_hz: float, count: int) -> Moments:
    """Send a question at every deadline and wait for its answer; then send an empty datagram."""
    moments: Moments = {}
    period = round(1e9 / rate_hz)
    fd = timerfd.create()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        plain.connect((HOST, port))
        # The kernel's timeout: with one of Python's the socket would poll.
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, Struct("ll").pack(int(ANSWER_S), 0))
        try:
            os.set_blocking(fd, True)
            timerfd.arm(fd, monotonic_ns() + period, period)
            for number in range(count):
                timerfd.expirations(fd)
                question = NUMBER.pack(number).ljust(SIZE, b"\0")
                began = monotonic_ns()
                plain.send(question)
                try:
                    answer = plain.recv(SIZE + 1)
                except BlockingIOError:  # lost
                    continue
                ended = monotonic_ns()
                if answer == question:
                    moments[number] = began, ended
        finally:
            os.close(fd)
            plain.send(b"")
    return moments


def answer(plain: socket.socket) -> Moments:
    """Send back every datagram until an empty one comes."""
    moments: Moments = {}
    while True:
        question, source = plain.recvfrom(SIZE + 1)
        there = monotonic_ns()
        if not question:
            return moments
        back = monotonic_ns()
        plain.sendto(question, source)
        moments[NUMBER.unpack_from(question)[0]] = there, back


def _plain(order: Mapping[str, Any]) -> Moments:
    asks = order["end"] == ASK
    rights_of(order).take(0 if asks else 1)
    gc.disable()
    if asks:
        return ask(order["port"], order["rate_hz"], order["warm_up"] + order["questions"])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        plain.bind((HOST, 0))
        tell(f"{plain.getsockname()[1]}\n")
        return answer(plain)


if __name__ == "__main__":
    sys.exit(serve(_plain))
