"""The secure stream: no answer without the key, and the very next message, unchanged, or an error."""

import asyncio
import os
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.apps.monitor.remote.stream import VERSION, MessageStream, accept, connect, telemetry_terms
from weberlink.protocol.dialer import Dialer
from weberlink.protocol.events import DropReason
from weberlink.protocol.handshake import INSTANCE_BYTES, LocalEnd, pack_agreement
from weberlink.protocol.listener import Listener
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.sealed_stream import LONGEST_FRAME, LONGEST_PAYLOAD, RefusedError, StreamCall, StreamError

KEY = bytes(range(32))
LIMIT_S = 5.0


class Pipe:
    """One direction of a connection: the writer of one end and the reader of the other."""

    def __init__(self) -> None:
        self.reader = asyncio.StreamReader(limit=1 << 20)
        self.sent: list[bytes] = []
        self.holds = False
        """Whether what is written is kept from the reader."""

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        if not self.holds:
            self.reader.feed_data(data)

    async def drain(self) -> None:
        pass


def run(test: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(test, 10 * LIMIT_S))


def caller(there: Pipe, back: Pipe, key: bytes = KEY) -> Coroutine[Any, Any, MessageStream]:
    return connect(back.reader, there, telemetry_terms(key), LIMIT_S)  # type: ignore[arg-type]


def called(there: Pipe, back: Pipe, key: bytes = KEY) -> Coroutine[Any, Any, MessageStream | None]:
    return accept(there.reader, back, telemetry_terms(key), LIMIT_S)  # type: ignore[arg-type]


async def opened() -> tuple[MessageStream, MessageStream, Pipe, Pipe]:
    """Both ends of a connection, and its two directions."""
    there, back = Pipe(), Pipe()
    one, other = await asyncio.gather(caller(there, back), called(there, back))
    assert other is not None
    return one, other, there, back


def hello(key: bytes = KEY) -> bytes:
    """The first frame of a caller."""
    message = StreamCall(telemetry_terms(key), os.urandom).hello()
    return len(message).to_bytes(2, "little") + message


async def answered(data: bytes) -> list[bytes]:
    there, back = Pipe(), Pipe()
    there.reader.feed_data(data)
    there.reader.feed_eof()
    with suppress(OSError):
        assert await called(there, back) is None
    return back.sent


@examples(20)
@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=200)), max_size=20))
def test_messages_arrive_in_order_both_ways(messages: list[tuple[int, bytes]]) -> None:
    async def test() -> None:
        one, other, *_ = await opened()
        for sender, receiver in ((one, other), (other, one)):
            for kind, payload in messages:
                await sender.send(kind, payload, LIMIT_S)
            assert [await receiver.receive(LIMIT_S) for _ in messages] == messages

    run(test())


def test_longest_payload_is_the_limit() -> None:
    async def test() -> None:
        one, other, there, _ = await opened()
        await one.send(1, bytes(LONGEST_PAYLOAD), LIMIT_S)
        assert len(there.sent[-1]) <= LONGEST_FRAME + 2 < 65_536
        assert (await other.receive(LIMIT_S))[1] == bytes(LONGEST_PAYLOAD)
        with pytest.raises(ValueError, match="at most"):
            await one.send(1, bytes(LONGEST_PAYLOAD + 1), LIMIT_S)

    run(test())


@examples(30)
@given(st.binary(max_size=300), st.integers(0, 511), st.integers(1, 255))
def test_caller_without_the_key_gets_no_answer(noise: bytes, place: int, bits: int) -> None:
    async def test() -> None:
        changed = bytearray(hello())
        changed[2 + place] ^= bits
        for data in (noise, bytes(changed), hello(bytes(32)), b"GET / HTTP/1.1\r\n\r\n"):
            assert await answered(data) == []

    run(test())


def test_answer_without_the_key_is_refused() -> None:
    async def test() -> None:
        _, _, _, back = await opened()
        for answer in (back.sent[0], back.sent[0][:-1] + bytes((back.sent[0][-1] ^ 1,))):  # of another connection
            there, fake = Pipe(), Pipe()
            fake.reader.feed_data(answer)
            with pytest.raises(RefusedError, match="--key-file"):
                await caller(there, fake)
        there, closed = Pipe(), Pipe()
        closed.reader.feed_eof()
        with pytest.raises(RefusedError, match="--key-file"):
            await caller(there, closed)

    run(test())


def test_replayed_caller_opens_nothing() -> None:
    async def test() -> None:
        one, _, recorded, _ = await opened()
        await one.send(1, b"", LIMIT_S)
        there, back = Pipe(), Pipe()
        there.reader.feed_data(b"".join(recorded.sent))
        again = await called(there, back)
        assert again is not None
        with pytest.raises(StreamError):
            await again.receive(LIMIT_S)

    run(test())


@pytest.mark.parametrize("change", [{"version": VERSION + 1}, {"agreement": {"records": 1}}])
def test_other_release_is_refused_with_the_reason(change: dict[str, Any]) -> None:
    async def test() -> None:
        there, back = Pipe(), Pipe()
        terms = telemetry_terms(KEY)._replace(**change)
        one = asyncio.ensure_future(caller(there, back))
        assert await accept(there.reader, back, terms, LIMIT_S) is None  # type: ignore[arg-type]
        assert len(back.sent[0]) < len(there.sent[0])
        with pytest.raises(RefusedError, match="the same one on both"):
            await one

    run(test())


def test_changed_or_shortened_message_ends_the_connection() -> None:
    async def test() -> None:
        one, other, there, _ = await opened()
        there.holds = True
        await one.send(3, b"telemetry", LIMIT_S)
        frame = there.sent[-1][2:]
        broken = [frame[:place] + bytes((frame[place] ^ 1,)) + frame[place + 1 :] for place in range(1, len(frame))]
        broken += [frame[:length] for length in range(len(frame))]
        for each in broken:
            there.reader.feed_data(len(each).to_bytes(2, "little") + each)
            with pytest.raises(StreamError):
                await other.receive(LIMIT_S)
        there.reader.feed_data(there.sent[-1])
        assert await other.receive(LIMIT_S) == (3, b"telemetry")

    run(test())


def test_repeated_missing_or_reflected_message_ends_the_connection() -> None:
    async def test() -> None:
        one, other, there, back = await opened()
        there.holds = True
        for number in range(3):
            await one.send(1, bytes((number,)), LIMIT_S)
        first, second, third = there.sent[-3:]

        async def fails(frame: bytes, why: str) -> None:
            there.reader.feed_data(frame)
            with pytest.raises(StreamError, match=why):
                await other.receive(LIMIT_S)

        await fails(second, "out of order")
        there.reader.feed_data(first)
        await other.receive(LIMIT_S)
        await fails(first, "out of order")
        await fails(third, "out of order")
        await fails(third[:3] + second[3:6] + third[6:], "changed")
        back.reader.feed_data(first)
        with pytest.raises(StreamError, match="changed"):
            await one.receive(LIMIT_S)
        foreign, _, elsewhere, _ = await opened()
        for _ in range(2):
            await foreign.send(1, b"", LIMIT_S)
        await fails(elsewhere.sent[-1], "changed")

    run(test())


def test_no_message_is_valid_in_the_daemons_protocol() -> None:
    """The daemons prove the same key."""
    daemons = PresharedKey(KEY)
    end = LocalEnd(daemons, os.urandom, pack_agreement({"rate_hz": 1000}), 2, 0.0, "master", "", 0.4)
    dialer = Dialer(end, bytes(INSTANCE_BYTES), stamp=lambda now: 1)
    dialer.start(0.0)
    theirs = dialer.hello(0.0)

    async def test() -> None:
        assert await answered(len(theirs).to_bytes(2, "little") + theirs) == []
        ours = hello()[2:]
        listener = Listener(end._replace(name="slave"), lambda *_: None)  # type: ignore[arg-type,return-value]
        assert isinstance(listener.receive(ours, ("192.0.2.1", 1), 0.0), DropReason)

    run(test())
