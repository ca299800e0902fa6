"""Sockets that aioice opens and another process takes over, and attempts to find a path over them, on loopback."""

import asyncio
import socket
import struct
from functools import partial
from random import Random
from socket import AF_INET
from typing import Any

import pytest
from aioice import stun

from tests.wait import in_loop
from weberlink_anywhere import ice
from weberlink_anywhere.sockets import BINDING, HOLD_S, Binding, OwnSocket, SocketLoop

STUN = bytes.fromhex("000100002112a442") + bytes(12)
IN_CHANNEL = b"\x40\x00" + len(STUN).to_bytes(2, "big") + STUN
OF_SESSION = b"a datagram of a session"
EF = 46
in_socket_loop = partial(in_loop, loop_factory=SocketLoop)


class Heard(asyncio.DatagramProtocol):
    """Keeps what arrives."""

    def __init__(self) -> None:
        self.data: list[bytes] = []

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.data.append(data)


async def opened(host: str = "127.0.0.1", bound: frozenset[str] = frozenset()) -> tuple[OwnSocket, Heard]:
    BINDING.set(Binding({host: "lo"}, bound, EF))
    transport, heard = await asyncio.get_running_loop().create_datagram_endpoint(Heard, local_addr=(host, 0))
    assert isinstance(transport, OwnSocket)
    return transport, heard


def send(transport: OwnSocket, *datagrams: bytes) -> None:
    with socket.socket(transport.socket.family, socket.SOCK_DGRAM) as peer:
        for data in datagrams:
            peer.sendto(data, transport.socket.getsockname())


@in_socket_loop
async def test_datagram_of_session_waits_for_the_taker_of_the_socket() -> None:
    transport, heard = await opened()
    held = asyncio.Event()
    transport.held = held.set
    send(transport, STUN, IN_CHANNEL, OF_SESSION, STUN)
    await held.wait()
    assert heard.data == [STUN, IN_CHANNEL]
    taken = transport.hand_over()
    assert [taken.recv(100), taken.recv(100)] == [OF_SESSION, STUN]
    await asyncio.sleep(1.5 * HOLD_S)
    send(transport, STUN)
    await asyncio.sleep(0.02)
    assert len(heard.data) == 2, "the wait ended with the hand-over, and nothing is read here any more"
    assert taken.recv(100) == STUN
    transport.deliver(STUN, ("127.0.0.1", 9))
    assert heard.data == [STUN, IN_CHANNEL, STUN]
    transport.close()


@pytest.mark.parametrize(
    ("host", "level", "option"),
    [("127.0.0.1", socket.IPPROTO_IP, socket.IP_TOS), ("::1", socket.IPPROTO_IPV6, socket.IPV6_TCLASS)],
)
@in_socket_loop
async def test_socket_has_class_and_interface(host: str, level: int, option: int) -> None:
    transport, _ = await opened(host, frozenset({"lo"}))
    assert transport.socket.getsockopt(level, option) == EF << 2
    name = transport.socket.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
    assert name.rstrip(b"\0") in (b"lo", b""), "nameless before Linux 5.7 without rights"
    assert transport.interface == "lo"
    transport.close()


@in_socket_loop
async def test_socket_for_server_hears_only_the_server() -> None:
    BINDING.set(Binding({"127.0.0.1": "lo"}, frozenset(), 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        transport, heard = await asyncio.get_running_loop().create_datagram_endpoint(
            Heard, remote_addr=server.getsockname()
        )
        assert isinstance(transport, OwnSocket)
        transport.sendto(STUN)
        data, source = server.recvfrom(100)
        assert data == STUN
        send(transport, STUN)
        server.sendto(IN_CHANNEL, source)
        while not heard.data:
            await asyncio.sleep(0.01)
        assert heard.data == [IN_CHANNEL]
        transport.close()


TWO_WAYS = {"127.0.0.1": "lo", "::1": "lo"}
LOST = 3  # Answers: to the check, to its repetition at once, and to the first repetition by time


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


@in_socket_loop
async def test_rubbish_from_anywhere_makes_no_traceback(caplog: pytest.LogCaptureFixture) -> None:
    """Messages of each class that are changed, or have attributes of any length."""
    random, addressed = Random(1), ("127.0.0.1", 9)
    binding = Binding({"127.0.0.1": "lo"}, frozenset(), EF)
    attempt = ice.PathAttempt(binding, ice.Servers(), controlling=True)
    await attempt.gather()
    (transport,) = binding.sockets
    for _ in range(4000):
        kind, length = random.choice([*stun.ATTRIBUTES_BY_TYPE]), random.randrange(12)
        body = struct.pack("!HH", kind, length) + random.randbytes(length + -length % 4)
        head = struct.pack("!HHI12s", random.choice([0x1, 0x11, 0x101, 0x111]), len(body), stun.COOKIE, bytes(12))
        transport.deliver(head + body, addressed)
    assert caplog.records == []
    await attempt.close()
