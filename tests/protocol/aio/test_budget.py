"""Bounded work on what others send: the budget, and a socket that is flooded."""

import asyncio
import socket
import time
from errno import ENETDOWN
from typing import Any

import pytest

from weberlink.protocol.aio.queue import MOST_S, SLICE_S, ReceiveQueue, WorkBudget
from weberlink.protocol.events import Address


def test_spent_time_returns_at_the_rate_of_the_share() -> None:
    budget = WorkBudget(0.25, 0.002, 10.0)
    assert budget.left(10.0) == 0.002
    budget.spend(0.003, 10.0)
    assert budget.left(10.0) == pytest.approx(-0.001)
    assert budget.wait() == pytest.approx(0.004)
    assert budget.left(10.004) == pytest.approx(0.0, abs=1e-12)
    assert budget.left(11.0) == 0.002, "no more is saved up than the limit"
    budget.limit(0.5)
    budget.spend(0.003, 11.0)
    assert budget.wait() == pytest.approx(0.002)


def test_debt_after_a_stall_is_bounded() -> None:
    budget = WorkBudget(0.3, 0.002, 0.0)
    budget.spend(0.1, 0.0)
    assert budget.wait() == pytest.approx(0.002 / 0.3), "far below any limit of silence"


def test_budget_does_not_grow_while_the_clock_stands() -> None:
    budget = WorkBudget(0.5, 1.0, 5.0)
    budget.spend(1.0, 5.0)
    assert budget.left(4.0) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_flooded_socket_costs_its_share_only(share: float) -> None:
    """Every datagram costs at least 50 us, so their number is bounded by the share and by what was saved up."""

    async def flooded() -> tuple[float, int]:
        loop = asyncio.get_running_loop()
        bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        bound.bind(("127.0.0.1", 0))
        bound.setblocking(False)
        taken = 0

        def take(data: bytes, source: Address, now: float) -> None:
            nonlocal taken
            began = time.monotonic()
            while time.monotonic() - began < 50e-6:
                pass
            taken += 1

        queue = ReceiveQueue(bound, loop=loop, now=time.monotonic, take=take, on_datagrams=lambda: None, share=share)
        began = time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.connect(bound.getsockname())
            while time.monotonic() - began < 0.5:
                for _ in range(50):
                    sender.send(b"flood")
                await asyncio.sleep(0)
        elapsed = time.monotonic() - began
        queue.close()
        queue.close()
        return elapsed, taken

    elapsed, taken = asyncio.run(flooded())
    assert taken > 10
    assert taken * 50e-6 < share * elapsed + 0.01


def test_a_queue_that_has_paused_goes_on() -> None:
    async def scenario() -> int:
        loop = asyncio.get_running_loop()
        bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        bound.bind(("127.0.0.1", 0))
        bound.setblocking(False)
        taken: list[bytes] = []
        done = asyncio.Event()

        def take(data: bytes, source: Address, now: float) -> None:
            taken.append(data)
            time.sleep(0.02)
            if len(taken) == 6:
                done.set()

        queue = ReceiveQueue(bound, loop=loop, now=time.monotonic, take=take, on_datagrams=lambda: None, share=0.1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(6):
                sender.sendto(bytes([number]), bound.getsockname())
        assert queue.read()
        assert not queue.read(), "the budget is used up"
        await asyncio.wait_for(done.wait(), 30.0)
        queue.close()
        return len(taken)

    assert asyncio.run(scenario()) == 6


def nobody(data: bytes, source: Address, now: float) -> None:
    raise AssertionError(data)


class Broken(socket.socket):
    """A socket with something to read, which the system refuses to give; each refusal takes 50 us on its own clock."""

    def __init__(self) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)
        self.refusals = 0

    def recvfrom(self, *arguments: Any) -> Any:
        self.refusals += 1
        assert self.refusals < 1000, "without end"
        raise OSError(ENETDOWN, "Network is down")

    def now(self) -> float:
        return 50e-6 * self.refusals


def test_errors_without_end_cost_the_budget_and_end_the_slice() -> None:
    async def scenario() -> list[int]:
        bound = Broken()
        bound.bind(("127.0.0.1", 0))
        bound.setblocking(False)
        queue = ReceiveQueue(
            bound, loop=asyncio.get_running_loop(), now=bound.now, take=nobody, on_datagrams=lambda: None, share=0.1
        )
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"x", bound.getsockname())
        counts = []
        for _ in range(100):
            assert not queue.read(), "nothing was received"
            counts.append(bound.refusals)
        queue.close()
        return counts

    counts = asyncio.run(scenario())
    assert 0 < counts[0] * 50e-6 < 2 * SLICE_S
    assert counts[-1] * 50e-6 < 1.5 * MOST_S, "then it waits until there is time again"
    assert counts[-1] == counts[-2]


def test_a_datagram_behind_an_error_is_taken() -> None:
    """The error of an earlier send, which the system reports once."""

    async def scenario() -> list[bytes]:
        taken: list[bytes] = []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
            peer.bind(("127.0.0.1", 0))
            bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            bound.bind(("127.0.0.1", 0))
            bound.connect(("127.0.0.1", 1))  # nobody listens there
            bound.send(b"x")
            bound.connect(peer.getsockname())
            bound.setblocking(False)
            peer.sendto(b"behind", bound.getsockname())
            queue = ReceiveQueue(
                bound,
                loop=asyncio.get_running_loop(),
                now=time.monotonic,
                take=lambda data, _source, _now: taken.append(data),
                on_datagrams=lambda: None,
                share=0.3,
            )
            queue.read()
            queue.close()
        return taken

    assert asyncio.run(scenario()) == [b"behind"]
