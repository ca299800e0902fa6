"""Attempts to find a path between two ends in this process, and calls that bring no session."""

import asyncio
from functools import partial
from socket import AF_INET
from types import SimpleNamespace
from typing import Any

import pytest
from aioice import stun

from tests.anywhere.meetings import in_loop
from weberlink.anywhere import ice
from weberlink.anywhere.calling import SESSION_S, Calling
from weberlink.anywhere.order import FinderOrder
from weberlink.anywhere.peers import Peer
from weberlink.anywhere.signalling import Answer, Description
from weberlink.anywhere.sockets import Binding, SocketLoop
from weberlink.protocol.aio.hand_over import ENGAGED, SessionState
from weberlink.protocol.keys import KEY_BYTES

TWO_WAYS = {"127.0.0.1": "lo", "::1": "lo"}
LOST = 3
"""Answers: to the check, to its repetition at once, and to the first repetition by time."""
in_socket_loop = partial(in_loop, loop_factory=SocketLoop)


class LosesAnswers(asyncio.DatagramProtocol):
    """Stands before a protocol of ICE, and drops the first answers to checks."""

    def __init__(self, protocol: Any) -> None:
        self._protocol = protocol
        self.lost = 0

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if self.lost < LOST and stun.parse_message(data).message_class == stun.Class.RESPONSE:
            self.lost += 1
        else:
            self._protocol.datagram_received(data, addr)

    def connection_lost(self, exc: Exception | None) -> None:
        self._protocol.connection_lost(exc)


@pytest.mark.parametrize("losing", [0, 1], ids=["master", "slave"])
@in_socket_loop
async def test_lost_answers_leave_both_ends_on_one_pair(losing: int) -> None:
    bindings = [Binding(TWO_WAYS, frozenset(), 0) for _ in range(2)]
    ends = [ice.PathAttempt(bindings[i], ice.Servers(), controlling=i == 0) for i in range(2)]
    try:
        described = [await end.gather() for end in ends]
        (carrier,) = (each for each in bindings[losing].sockets if each.socket.family == AF_INET)
        carrier.protocol = losing_one = LosesAnswers(carrier.protocol)
        found = await asyncio.gather(*(ends[i].connect(described[1 - i], 5.0) for i in range(2)))
        assert losing_one.lost > 0
        for i in range(2):
            assert found[i].remote == found[1 - i].socket.socket.getsockname()[:2]
    finally:
        for end in ends:
            await end.close()


class StandIn:
    """Plays mailbox and paths to a caller: every call is answered, and every attempt succeeds."""

    def __init__(self) -> None:
        self.calls = 0
        self.sessions: dict[str, str] = {}
        self.servers = SimpleNamespace(asked="")
        self.held = 1

    async def call(self, offered: list[Description], take_over: bool, timeout: float) -> Answer:
        self.calls += 1
        return Answer(tuple(offered))

    async def prepare(self, count: int, *, controlling: bool, patience: float) -> list[Any]:
        return [SimpleNamespace(description=Description("u", "p", ()))] * count

    async def use(self, *_: object) -> None: ...

    async def drop(self, _: object) -> None: ...

    def count(self, _: str) -> int:
        return self.held


@pytest.mark.realtime
@in_socket_loop
async def test_path_without_session_is_followed_by_another_call() -> None:
    stand_in: Any = StandIn()
    peer = Peer("robot", "robot", "anna", "slave", bytes(KEY_BYTES))
    calling = Calling(FinderOrder("master", ("robot",), "", ""), peer, stand_in, stand_in)
    task = asyncio.create_task(calling.run())
    await asyncio.sleep(0.5 * SESSION_S)
    assert stand_in.calls == 1
    await asyncio.sleep(SESSION_S)
    assert stand_in.calls == 2
    calling.hear(SessionState("robot", ENGAGED))
    await asyncio.sleep(0)
    task.cancel()
