"""Messages between the process that finds paths and the daemon, over a real Unix socket."""

import socket
from pathlib import Path

import pytest

from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import PathFound, PathLost, PathNews, SessionState, StunReceived

REMOTE = ("192.0.2.7", 40_001)
DESCRIPTORS = Path("/proc/self/fd")
MESSAGES = [
    PathFound(1, 0, "robot", REMOTE),
    PathFound(2**31, 1, "Röbot", ("2001:db8::1", 1), 0x4001, "relayed", "relay.example", "wlan0"),
    PathLost(3),
    PathNews("robot", "no path: UDP is blocked", is_final=True),
    StunReceived(4, REMOTE, bytes(range(256))),
    SessionState("robot", hand_over.SILENT),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_messages_arrive_as_they_were_sent(message: hand_over.Message) -> None:
    ours, theirs = hand_over.pair()
    with ours, theirs:
        assert hand_over.send(ours, message)
        assert hand_over.receive(theirs) == (message, None)


def test_a_socket_is_handed_over_and_lives_on() -> None:
    ours, theirs = hand_over.pair()
    with ours, theirs:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
            bound.bind(("127.0.0.1", 0))
            address = bound.getsockname()
            assert hand_over.send(ours, MESSAGES[0], bound)
        received = hand_over.receive(theirs)
        assert received is not None
        message, carried = received
        assert message == MESSAGES[0] and carried is not None
        with carried:
            assert (carried.family, carried.type) == (socket.AF_INET, socket.SOCK_DGRAM)
            assert carried.getsockname() == address


def test_a_closed_end_is_no_message() -> None:
    ours, theirs = hand_over.pair()
    with theirs:
        ours.close()
        assert hand_over.receive(theirs) is None
        assert not hand_over.send(theirs, MESSAGES[0])


def test_a_full_socket_refuses_and_does_not_wait() -> None:
    ours, theirs = hand_over.pair()
    with ours, theirs:
        ours.setblocking(False)
        sent = 0
        while hand_over.send(ours, MESSAGES[4]):
            sent += 1
        assert sent > 10
        for _ in range(sent):
            assert hand_over.receive(theirs) == (MESSAGES[4], None)
        theirs.setblocking(False)
        with pytest.raises(BlockingIOError):
            hand_over.receive(theirs)


def test_no_descriptor_stays_open() -> None:
    before = len(list(DESCRIPTORS.iterdir()))
    ours, theirs = hand_over.pair()
    with ours, theirs, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        hand_over.send(ours, MESSAGES[0], bound)
        received = hand_over.receive(theirs)
        assert received is not None and received[1] is not None
        received[1].close()
    assert len(list(DESCRIPTORS.iterdir())) == before
