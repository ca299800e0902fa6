"""Bounded work on what others send: the budget, and a socket that is flooded."""

import asyncio
import socket
import time
from collections.abc import Callable
from errno import ENETDOWN
from typing import Any

import pytest

from tests.wait import in_loop, soon
from weberlink.protocol.aio.sockets import CLASS_LOOK_S, MOST_S, SLICE_S, ReceiveQueue, WorkBudget


def test_spent_time_returns_at_the_rate_of_the_share() -> None:
    budget = WorkBudget(0.25, 0.002, 10.0)
    assert budget.left(10.0) == 0.002
    assert budget.spend(0.003, 10.0) == pytest.approx(0.004)
    assert budget.left(10.0) == pytest.approx(-0.001)
    assert budget.left(10.004) == pytest.approx(0.0, abs=1e-12)
    assert budget.left(11.0) == 0.002, "no more is saved up than the limit"
    budget.share = 0.5
    assert budget.spend(0.003, 11.0) == pytest.approx(0.002)
    assert budget.spend(0.1, 11.0) == pytest.approx(0.004), "the debt after a stall is bounded"
    assert budget.left(5.0) == -0.002, "nothing returns while the clock stands"


class Plain(socket.socket):
    def __init__(self) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)
        self.bind(("127.0.0.1", 0))
        self.setblocking(False)


def listening(
    take: Callable[[bytes], object],
    share: float,
    bound: Any = None,
    now: Callable[[], float] = time.monotonic,
    **changes: Any,
) -> ReceiveQueue:
    return ReceiveQueue(
        bound or Plain(),
        loop=asyncio.get_running_loop(),
        now=now,
        take=lambda data, _source, _ancillary, _now: take(data),  # type: ignore[arg-type, return-value]
        share=share,
        **{"is_due": lambda: False, "on_datagrams": lambda: None} | changes,
    )


@in_loop
async def test_a_queue_that_has_paused_goes_on() -> None:
    taken: list[bytes] = []
    with Plain() as sender:
        queue = listening(lambda data: (taken.append(data), time.sleep(0.02)), 0.1)
        for number in range(6):
            sender.sendto(bytes([number]), queue.socket.getsockname())
    assert queue.read()
    assert not queue.read(), "the budget is used up"
    await soon(lambda: len(taken) == 6, "the others")
    queue.close()


class Counting(Plain):
    def __init__(self) -> None:
        super().__init__()
        self.reads: list[str] = []

    def recv(self, *arguments: Any) -> Any:
        self.reads.append("recv")
        return super().recv(*arguments)

    def recvmsg(self, *arguments: Any) -> Any:
        self.reads.append("recvmsg")
        return super().recvmsg(*arguments)


@in_loop
async def test_each_datagram_is_acted_on_before_the_next_is_read_with_one_short_read() -> None:
    """What the system gives beside the datagrams of a connected socket is read now and then."""
    bound, now, acted = Counting(), 0.0, []
    with Plain() as peer:
        bound.connect(peer.getsockname())
        peer.connect(bound.getsockname())
        queue = listening(
            lambda data: bound.reads.append(data.decode()), 0.3, bound, lambda: now, source=peer.getsockname(),
            on_datagrams=lambda: (acted.append(1), bound.reads.append("acted")),
        )  # fmt: skip
        for number, now in enumerate((0.0, 0.1, 0.2, CLASS_LOOK_S, CLASS_LOOK_S + 0.1)):  # noqa: B007 - is read
            peer.send(str(number).encode())
            await soon(lambda number=number: len(acted) > number, "the datagram")
        for number in (5, 6):
            peer.send(str(number).encode())
        await soon(lambda: len(acted) == 7, "both")
        queue.close()
    kinds = ["recvmsg", "recv", "recv", "recv", "recvmsg", "recv", "recv"]
    expected = [word for number, kind in enumerate(kinds) for word in (kind, str(number), "acted")]
    assert bound.reads == expected


class Endless(Plain):
    """A socket with something to read in every case; each datagram or refusal takes 50 us on its own clock."""

    def __init__(self, *, is_broken: bool) -> None:
        super().__init__()
        self.is_broken, self.reads = is_broken, 0

    def recvmsg(self, *arguments: Any) -> Any:
        self.reads += 1
        assert self.reads < 1000, "without end"
        if self.is_broken:
            raise OSError(ENETDOWN, "Network is down")
        return b"x", [], 0, ("127.0.0.1", 1)


@pytest.mark.parametrize(("is_broken", "is_woken"), [(False, False), (True, False), (False, True)])
@in_loop
async def test_datagrams_and_errors_without_end_cost_the_budget_and_end_the_slice(
    is_broken: bool, is_woken: bool
) -> None:
    """Whether the owner asks, or the loop is woken for each."""
    bound, counts, taken = Endless(is_broken=is_broken), [], []
    # A loop that was woken counts the time from the read on, and goes on after the real time that it waits for.
    share, taking = (0.001, 1) if is_woken else (0.1, 0)
    queue = listening(taken.append, share, bound, lambda: 50e-6 * (bound.reads + taking * len(taken)))
    with Plain() as sender:
        sender.sendto(b"x", bound.getsockname())
    for _ in range(100):
        before = bound.reads
        if is_woken:
            await asyncio.sleep(0.0)
        else:
            assert queue.read() is (not is_broken and bound.reads > before)
        counts.append(bound.reads)
    queue.close()
    queue.close()
    assert len(taken) == (0 if is_broken else bound.reads)
    assert is_woken or SLICE_S <= (counts[0] - 1) * 50e-6 < SLICE_S + 100e-6
    assert counts[-1] * 50e-6 < 1.5 * MOST_S, "then it waits until there is time again"
    assert is_woken or counts[-1] == counts[-2]
    assert counts[-1] > 10


@in_loop
async def test_a_datagram_behind_an_error_is_taken() -> None:
    """The error of an earlier send, which the system reports once."""
    taken: list[bytes] = []
    with Plain() as peer:
        queue = listening(taken.append, 0.3, None, lambda: 0.0)
        queue.socket.connect(("127.0.0.1", 1))  # nobody listens there
        queue.socket.send(b"x")
        queue.socket.connect(peer.getsockname())
        peer.sendto(b"behind", queue.socket.getsockname())
        queue.read()
        queue.close()
    assert taken == [b"behind"]


@in_loop
async def test_a_datagram_waits_while_something_else_is_due_unless_it_is_asked_for() -> None:
    taken: list[bytes] = []
    is_due = True
    with Plain() as sender:
        queue = listening(taken.append, 0.3, is_due=lambda: is_due)
        sender.sendto(b"first", queue.socket.getsockname())
        for _ in range(10):
            await asyncio.sleep(0.0)
        assert not taken
        assert queue.read()
        sender.sendto(b"second", queue.socket.getsockname())
        is_due = False
        await soon(lambda: taken == [b"first", b"second"], "the second")
    queue.close()
