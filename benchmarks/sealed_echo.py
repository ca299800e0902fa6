"""One end of an exchange of sealed datagrams between two bare Python processes: the limit of a sealed update.

Both ends wake at the rate of the daemons from a timerfd, do about as much Python work as little as a tick can, and wait
with epoll for timer and socket in a plain loop. An end sends in given ticks; the answering one may instead answer each
datagram at once. A moment is read before sealing and after opening and unpacking. Cipher, nonce, tag and clear bytes
are those of `weberlink.protocol.psk`.
"""

import gc
import os
import select
import socket
import sys
from collections import deque
from collections.abc import Iterable, Mapping
from math import inf
from struct import Struct
from time import monotonic_ns
from typing import Any

from cryptography.hazmat.primitives.ciphers.aead import AESCCM

from benchmarks.arrangement import rights_of, serve, tell
from benchmarks.latency import ASK, CAME, HOST, SENT, SIZE, Moments
from weberlink.protocol.wire import CLEAR_BYTES
from weberlink.realtime import timerfd

TAG_BYTES, SALT = 8, bytes(5)
"""Length of the tag, and the part of the nonce beside the 8 bytes of the number of a datagram."""
KEYS = bytes(16), bytes(range(16))  # of the questions and of the answers
BODY = Struct(f"<Q{SIZE - CLEAR_BYTES - TAG_BYTES - 8}s")
FILLING = bytes(SIZE)
WORK_US = 10.0  # python work in a tick, with warm caches [us]
LAST_TICKS = 200  # in which the last datagrams arrive


def seal(cipher: AESCCM, number: int) -> bytes:
    """The datagram of this number: clear bytes, and the number sealed with what fills it up to `SIZE`."""
    head = number.to_bytes(8, "little")[:CLEAR_BYTES]
    return head + cipher.encrypt(SALT + number.to_bytes(8, "little"), BODY.pack(number, FILLING), head)


def unseal(cipher: AESCCM, number: int, datagram: bytes) -> int:
    """The number in a datagram.

    Raises:
        InvalidTag: if it is not the one of this number.
    """
    nonce = SALT + number.to_bytes(8, "little")
    opened: int = BODY.unpack(cipher.decrypt(nonce, datagram[CLEAR_BYTES:], datagram[:CLEAR_BYTES]))[0]
    return opened


def expand(low: int, newest: int) -> int:
    """The number with these low bits (of `CLEAR_BYTES`) that is nearest to the newest one."""
    span = 1 << 8 * CLEAR_BYTES
    return max(0, newest + (low - newest + span // 2) % span - span // 2)


class BareEnd:
    """One end.

    Args:
        bound: its socket; that of the asking end is connected.
        asks: whether it is the asking end, which ends the exchange.
        ticks: in which it sends, ascending.
        count: of ticks.
        answers: whether it answers each datagram at once.
    """

    def __init__(self, bound: socket.socket, ticks: Iterable[int], count: int, *, asks: bool, answers: bool) -> None:
        bound.setblocking(False)
        self._socket = bound
        ciphers = [AESCCM(key, tag_length=TAG_BYTES) for key in KEYS]
        self._out, self._in = ciphers if asks else ciphers[::-1]
        self._due = deque(ticks)
        self._last = count + LAST_TICKS if asks else inf
        self._answers = answers
        self._tick = self._newest = 0
        self._peer: Any = bound.getpeername() if asks else None
        self._steps = range(steps_of(WORK_US))
        self.moments: Moments = {SENT: {}, CAME: {}}
        self.done = False

    def tick(self) -> None:
        """Do some work, then send what is due."""
        work(self._steps)
        if self._peer is None:  # the answering end hears first where to send
            return
        if self._due and self._due[0] <= self._tick:
            self._due.popleft()
            self._send(self._tick)
        self._tick += 1
        if self._tick > self._last:
            self.done = True
            self._socket.send(b"")

    def _send(self, number: int) -> None:
        began = monotonic_ns()
        self._socket.sendto(seal(self._out, number), self._peer)
        self.moments[SENT][number] = began

    def receive(self) -> None:
        """Open all datagrams that wait; an empty one ends the exchange."""
        while True:
            try:
                datagram, self._peer = self._socket.recvfrom(SIZE + 1)
            except BlockingIOError:
                return
            if not datagram:
                self.done = True
                return
            self._newest = expand(int.from_bytes(datagram[:CLEAR_BYTES], "little"), self._newest)
            number = unseal(self._in, self._newest, datagram)
            self.moments[CAME][number] = monotonic_ns()
            if self._answers:
                self._send(number)

    def run(self, rate_hz: float) -> Moments:
        """Tick and receive to the end of the echo; returns the moments."""
        period = round(1e9 / rate_hz)
        timer = timerfd.create()
        try:
            with select.epoll() as waiting:
                waiting.register(timer, select.EPOLLIN)
                waiting.register(self._socket, select.EPOLLIN)
                timerfd.arm(timer, monotonic_ns() + period, period)
                while not self.done:
                    for ready, _ in waiting.poll():
                        if ready == timer:
                            timerfd.expirations(timer)
                            self.tick()
                        else:
                            self.receive()
        finally:
            os.close(timer)
        return self.moments


def work(steps: range) -> float:
    """Some arithmetic, as a tick does it."""
    total = 0.0
    for step in steps:
        total = 0.5 * total + step
    return total


def steps_of(duration_us: float) -> int:
    """Steps of `work` that take so long with warm caches."""
    tried = range(1000)
    times = []
    for _ in range(21):
        began = monotonic_ns()
        work(tried)
        times.append(monotonic_ns() - began)
    return max(1, round(len(tried) * duration_us * 1e3 / min(times)))


def _sealed(order: Mapping[str, Any]) -> Moments:
    asks = order["end"] == ASK
    answers = order["every"] and not asks
    ticks, count = [] if answers else order["ticks"][0 if asks else 1], order["count"]
    rights_of(order).take(0 if asks else 1)
    gc.disable()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        if asks:
            bound.connect((HOST, order["port"]))
        else:
            bound.bind((HOST, 0))
            tell(f"{bound.getsockname()[1]}\n")
        return BareEnd(bound, ticks, count, asks=asks, answers=answers).run(order["rate_hz"])


if __name__ == "__main__":
    sys.exit(serve(_sealed))
