"""Attempts to find a path between two ends in this process, and calls that bring no session."""

import asyncio
from functools import partial
from socket import AF_INET
from typing import Any

import pytest
from aioice import stun

from plugins.anywhere.tests.meetings import in_loop
from weberlink_anywhere import ice
from weberlink_anywhere.sockets import Binding, SocketLoop

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
