"""Messages between the process that finds paths and the daemon, over a real Unix socket."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import example, given, strategies as st

from weberlink_anywhere import hand_over
from weberlink_anywhere.hand_over import (
    LONGEST_MESSAGE,
    LONGEST_TEXT,
    PathFound,
    PathLost,
    PathNews,
    PathSilent,
    SessionState,
    StunReceived,
)

REMOTE = ("192.0.2.7", 40_001)
DESCRIPTORS = Path("/proc/self/fd")
FOUND = PathFound(1, 0, "robot", REMOTE)
STUN = StunReceived(4, REMOTE, bytes(range(256)))
TEXT = st.text(st.characters(exclude_categories=["C", "Z"]), max_size=LONGEST_TEXT)
NUMBER, UINT16 = st.integers(0, 2**32 - 1), st.integers(0, 2**16 - 1)
ADDRESS = st.tuples(st.ip_addresses().map(str), UINT16)
ANY_MESSAGE: st.SearchStrategy[hand_over.Message] = st.one_of(
    st.builds(PathFound, NUMBER, NUMBER, TEXT, ADDRESS, st.none() | UINT16, TEXT, TEXT, TEXT),
    st.builds(PathLost, NUMBER),
    st.builds(PathNews, TEXT, TEXT, st.booleans()),
    st.builds(StunReceived, NUMBER, ADDRESS, st.binary(max_size=1500)),
    st.builds(SessionState, TEXT, TEXT),
    st.builds(PathSilent, NUMBER),
)
ANY_VALUE: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=9) | st.dictionaries(st.text() | st.binary(), inner, max_size=3),
)
NO_MESSAGES = [
    *([], 3, "robot", [-1, 3], [6, 3], [1], [1, 3, 3], [1, "3"], [1, 2**32], [2, "robot", 3, False], [4, "robot", b""]),
    [2, "robot", "x" * (LONGEST_TEXT + 1), False],
    [2, "robot", "one\ntwo", False],
    *([0, 1, 0, "robot", remote, None, "", "", ""] for remote in [("host", 1), ("192.0.2.7", 2**16), 7, ("::1",)]),
    [0, 1, 0, "robot", REMOTE, 2**16, "", "", ""],
]


@contextmanager
def channel(bound: int = 0) -> Iterator[Any]:
    with ExitStack() as stack:
        pair = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(bound)]
        yield [stack.enter_context(each) for each in (*pair, *sockets)]


def open_descriptors() -> int:
    return len(list(DESCRIPTORS.iterdir()))


def passed(message: hand_over.Message) -> hand_over.Message:
    with channel(1) as (ours, theirs, bound):
        assert hand_over.send(ours, message, bound if isinstance(message, PathFound) else None)
        received = hand_over.receive(theirs)
    assert received is not None and (received[1] is None) != isinstance(message, PathFound)
    if received[1] is not None:
        received[1].close()
    return received[0]


@given(ANY_MESSAGE)
@example(PathFound(2**31, 1, "Röbot", ("2001:db8::1", 1), 0x4001, "relayed", "relay.example", "wlan0"))
def test_messages_arrive_as_they_were_sent(message: hand_over.Message) -> None:
    assert passed(message) == message


@given(st.text(), st.booleans())
@example("the mailbox server refuses: " + "x" * 5000, True)
@example("\x1b[2J\n" * 1000, False)
def test_news_of_any_text_arrive_as_one_printable_line(text: str, is_final: bool) -> None:
    news = passed(PathNews.of("robot", text, is_final))
    assert isinstance(news, PathNews) and (news.peer, news.is_final) == ("robot", is_final)
    assert news.text.isprintable() and len(news.text) <= LONGEST_TEXT
    if text.isprintable() and len(text) <= LONGEST_TEXT:
        assert news.text.split() == text.split()


@given(st.one_of(st.binary(max_size=LONGEST_MESSAGE + 9), ANY_VALUE.map(msgpack.packb)), st.booleans())
@example(b"", False)
@example(b"\x81\x80\x01", False)  # a map with a map as its key
@example(b"\x91" * 3000, False)  # nested too deep
@example(bytes(LONGEST_MESSAGE + 1), False)
@example(msgpack.packb([1, 3]) + bytes(LONGEST_MESSAGE), True)
def test_any_bytes_are_a_message_or_refused(data: bytes, carries: bool) -> None:
    with channel(1) as (ours, theirs, bound):
        before = open_descriptors()
        socket.send_fds(ours, [data], [bound.fileno()] if carries else [])
        try:
            received = hand_over.receive(theirs)
        except ValueError:
            received = None
        if received is not None:
            message, carried = received
            assert hand_over.send(ours, message, carried)  # so each of its values is of its kind
            assert (carried is None) != isinstance(message, PathFound)
            if carried is not None:
                carried.close()
            again = hand_over.receive(theirs)
            assert again is not None and again[0] == message
            if again[1] is not None:
                again[1].close()
        assert open_descriptors() == before


@pytest.mark.parametrize("content", NO_MESSAGES, ids=repr)
def test_what_is_no_message_is_refused_at_both_ends(content: Any) -> None:
    with channel(1) as (ours, theirs, bound):
        socket.send_fds(ours, [msgpack.packb(content)], [bound.fileno()])
        with pytest.raises(ValueError, match=r"message|no "):
            hand_over.receive(theirs)


@pytest.mark.parametrize(
    "message",
    [
        PathNews("robot", "x" * 5000),
        PathNews("robot", "one\ntwo"),
        StunReceived(1, REMOTE, bytes(LONGEST_MESSAGE)),
        PathLost(-1),
        PathFound(1, 0, "robot", ("host.example", 1)),
    ],
    ids=lambda message: type(message).__name__,
)
def test_message_that_would_be_refused_is_not_sent(message: hand_over.Message) -> None:
    with channel() as (ours, theirs):
        with pytest.raises(ValueError, match="does not fit"):
            hand_over.send(ours, message)
        theirs.setblocking(False)
        with pytest.raises(BlockingIOError):
            hand_over.receive(theirs)


@pytest.mark.parametrize("kind", ["stream", "unix", "file", "none"])
def test_path_without_a_udp_socket_is_refused(kind: str) -> None:
    data = msgpack.packb([0, *FOUND])
    with (
        channel() as (ours, theirs),
        socket.socket(socket.AF_INET, socket.SOCK_STREAM) as stream,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as unix,
        Path(__file__).open("rb") as file,
    ):
        carried = {"stream": [stream.fileno()], "unix": [unix.fileno()], "file": [file.fileno()], "none": []}[kind]
        before = open_descriptors()
        socket.send_fds(ours, [data], carried)
        with pytest.raises(ValueError, match="socket"):
            hand_over.receive(theirs)
        assert open_descriptors() == before


def test_a_socket_is_handed_over_and_lives_on() -> None:
    with channel() as (ours, theirs):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
            bound.bind(("127.0.0.1", 0))
            address = bound.getsockname()
            assert hand_over.send(ours, FOUND, bound)
        received = hand_over.receive(theirs)
        assert received is not None
        message, carried = received
        assert message == FOUND and carried is not None
        with carried:
            assert (carried.family, carried.type) == (socket.AF_INET, socket.SOCK_DGRAM)
            assert carried.getsockname() == address


def test_a_closed_end_is_no_message_and_a_full_one_refuses_and_does_not_wait() -> None:
    with channel() as (ours, theirs):
        ours.setblocking(False)
        theirs.setblocking(False)
        sent = 0
        while hand_over.send(ours, STUN):
            sent += 1
        assert sent > 10
        for _ in range(sent):
            assert hand_over.receive(theirs) == (STUN, None)
        with pytest.raises(BlockingIOError):
            hand_over.receive(theirs)
        ours.close()
        assert hand_over.receive(theirs) is None
        assert not hand_over.send(theirs, STUN)
