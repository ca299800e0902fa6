"""The daemon's end of a finder, for tests: exchanges datagrams at 1 kHz on every path that it is handed."""

import select
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from time import monotonic, sleep
from typing import NamedTuple, Self

from weberlink.anywhere.order import FinderOrder
from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import PathFound, PathLost, PathNews, PathSilent, SessionState, StunReceived
from weberlink.protocol.aio.paths import REPLACED_S

PERIOD_S = 1e-3
SILENCE_S = 0.1
PATIENCE_S = 20.0
_FORM = struct.Struct("!cqd")
_CHANNEL = struct.Struct("!HH")


class Arrived(NamedTuple):
    """A datagram of the peer: its number, the path, and when it was sent and received [s]."""

    sequence: int
    path: int
    sent_at: float
    at: float


class DaemonEnd:
    """Starts a finder, and plays the daemon to it in a thread of its own, as long as the `with` lasts.

    Args:
        order: for the finder.
        prefix: a command that runs it elsewhere.
    """

    def __init__(self, order: FinderOrder, prefix: tuple[str, ...] = ()) -> None:
        self._end, theirs = hand_over.pair()
        arguments = ["-m", "weberlink.anywhere.finder", order.to_json(), str(theirs.fileno())]
        self.started_at = monotonic()
        with theirs:
            self.process = subprocess.Popen(
                [*prefix, sys.executable, *arguments], stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()]
            )
        self._end.setblocking(False)
        self._sockets: dict[int, socket.socket] = {}
        self._replaced: list[tuple[float, int, PathFound]] = []
        self.paths: dict[int, PathFound] = {}
        self.found: list[tuple[float, PathFound]] = []
        self.lost: list[PathLost] = []
        self.news: list[PathNews] = []
        self.arrived: list[Arrived] = []
        self.stun_count = 0
        self.sent = 0
        self._heard_at = 0.0
        self._state = ""
        self._stopping = False
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping = True
        self._thread.join()
        self._end.close()
        for carried in self._sockets.values():
            carried.close()
        assert self.process.wait(PATIENCE_S) == 0, "the finder ends without a fault when its daemon does"

    def wait(self, condition: Callable[[], object]) -> None:
        deadline = monotonic() + PATIENCE_S
        while not condition():
            assert monotonic() < deadline, (self.found, self.news)
            sleep(0.002)

    def wait_for_path(self, count: int = 1) -> PathFound:
        """The newest path, once so many were found."""
        self.wait(lambda: len(self.found) >= count)
        return self.found[-1][1]

    def wait_for_datagrams(self, count: int) -> None:
        """Until so many more have arrived."""
        before = len(self.arrived)
        self.wait(lambda: len(self.arrived) >= before + count)

    def tell_silent(self, number: int) -> None:
        """Say that nothing comes on a path."""
        assert hand_over.send(self._end, PathSilent(number))

    def missed(self, first: int, last: int) -> int:
        """How many of these numbers arrived by no path."""
        return len(set(range(first, last)) - {arrived.sequence for arrived in self.arrived})

    def longest_gap(self, since: float) -> float:
        """Longest time without a datagram after `since` [s]."""
        times = [since, *(arrived.at for arrived in self.arrived if arrived.at > since)]
        return max(after - before for before, after in pairwise(times))

    def _run(self) -> None:
        due = monotonic()
        while not self._stopping:
            ready, _, _ = select.select([self._end, *self._sockets.values()], [], [], max(0.0, due - monotonic()))
            if self._end in ready and not self._take():
                return
            for number, carried in list(self._sockets.items()):
                if carried in ready:
                    self._read(number, carried)
            while monotonic() >= due:
                self._tick()
                due += PERIOD_S

    def _take(self) -> bool:
        received = hand_over.receive(self._end)
        if received is None:
            return False
        message, carried = received
        if isinstance(message, PathFound):
            assert carried is not None
            for number, path in list(self.paths.items()):
                if (path.peer, path.place) == (message.peer, message.place):
                    self._replaced.append((monotonic() + REPLACED_S, number, self.paths.pop(number)))
            self.paths[message.number], self._sockets[message.number] = message, carried
            self.found.append((monotonic(), message))
        elif isinstance(message, PathLost):
            self.lost.append(message)
            self._drop(message.number)
        elif isinstance(message, PathNews):
            self.news.append(message)
        return True

    def _drop(self, number: int) -> None:
        self.paths.pop(number, None)
        self._replaced = [entry for entry in self._replaced if entry[1] != number]
        if number in self._sockets:
            self._sockets.pop(number).close()

    @property
    def _carrying(self) -> dict[int, PathFound]:
        """Paths in use, and those that were replaced a short while ago."""
        return {number: path for _, number, path in self._replaced} | self.paths

    def _read(self, number: int, carried: socket.socket) -> None:
        channel = self._carrying[number].channel
        while True:
            try:
                data, source = carried.recvfrom(2048)
            except OSError:
                return
            inner = data[_CHANNEL.size :] if channel is not None and data[:2] == channel.to_bytes(2, "big") else data
            if hand_over.is_stun(inner):
                self.stun_count += 1
                hand_over.send(self._end, StunReceived(number, source[:2], data))
            elif len(inner) == _FORM.size:
                _, sequence, sent_at = _FORM.unpack(inner)
                self._heard_at = monotonic()
                self.arrived.append(Arrived(sequence, number, sent_at, self._heard_at))

    def _tick(self) -> None:
        now = monotonic()
        data = _FORM.pack(b"W", self.sent, now)
        for until, number, _ in self._replaced:
            if now > until:
                self._drop(number)
        for number, path in self._carrying.items():
            frame = data if path.channel is None else _CHANNEL.pack(path.channel, len(data)) + data
            with suppress(OSError):
                self._sockets[number].sendto(frame, path.remote)
        self.sent += bool(self.paths)
        state = hand_over.SILENT if now - self._heard_at > SILENCE_S else hand_over.ENGAGED
        if self._heard_at and state != self._state:
            self._state = state
            for peer in {path.peer for path in self.paths.values()}:
                hand_over.send(self._end, SessionState(peer, state))
