"""Messages of the telemetry link over TCP: frames of a sealed stream, each after two bytes of length, little endian."""

import asyncio
import os
from hmac import digest

from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.sealed_stream import (
    LONGEST_FRAME,
    RefusedError,
    SealedStream,
    StreamCall,
    StreamTerms,
    answer_call,
)
from weberlink.telemetry.record import RECORD
from weberlink.telemetry.ring import SCHEMA

VERSION = 3
LENGTH_BYTES = 2
CLOSE_S = 1.0


def telemetry_terms(key: bytes) -> StreamTerms:
    """The terms of the link, under a key derived from that of the daemons: no message of theirs is valid in it."""
    return StreamTerms(
        PresharedKey(digest(key, b"weberlink telemetry link", "sha256")),
        VERSION,
        {"records": SCHEMA, "record_bytes": RECORD.size},
        "the two hosts have different releases of weberlink; use the same one on both",
    )


class MessageStream:
    """One end of an open connection; made by `connect` and `accept`."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, sealed: SealedStream) -> None:
        self._reader = reader
        self._writer = writer
        self._sealed = sealed

    async def send(self, kind: int, payload: bytes, limit_s: float) -> None:
        """Send a message of a kind from 0 to 255. Raises ValueError if it is too long, else as `write_frame`."""
        await write_frame(self._writer, self._sealed.seal(kind, payload), limit_s)

    async def receive(self, limit_s: float) -> tuple[int, bytes]:
        """Kind and payload of the next message.

        Raises:
            StreamError: it is not the next message of the other end.
            OSError: the stream ended, or nothing came within the limit [s].
        """
        return self._sealed.open(await read_frame(self._reader, limit_s))


async def connect(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, terms: StreamTerms, limit_s: float
) -> MessageStream:
    """Open a connection as the caller. Raises RefusedError if the other end does not prove the key, or refuses."""
    call = StreamCall(terms, os.urandom)
    await write_frame(writer, call.hello(), limit_s)
    try:
        answer = await read_frame(reader, limit_s)
    except OSError:
        raise RefusedError(
            "hangs up without an answer, as it does on a wrong key; --key-file must be a copy of the one there"
        ) from None
    return MessageStream(reader, writer, call.answered(answer))


async def accept(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, terms: StreamTerms, limit_s: float
) -> MessageStream | None:
    """Open a connection as the one called; None for a caller without the key (gets no answer) or of another release.

    The first message may be a recording. Wait for a message before sending anything: only a live caller can make one.
    """
    answered = answer_call(await read_frame(reader, limit_s), terms, os.urandom)
    if answered is None:
        return None
    reply, sealed = answered
    await write_frame(writer, reply, limit_s)
    return None if sealed is None else MessageStream(reader, writer, sealed)


async def read_frame(reader: asyncio.StreamReader, limit_s: float) -> bytes:
    """The next frame. Raises OSError if the stream ended, the frame is too long, or it took longer than the limit."""
    async with asyncio.timeout(limit_s):
        try:
            length = int.from_bytes(await reader.readexactly(LENGTH_BYTES), "little")
            if length > LONGEST_FRAME:
                raise ConnectionError(f"a frame of {length} bytes, more than {LONGEST_FRAME}")
            return await reader.readexactly(length)
        except asyncio.IncompleteReadError:
            raise ConnectionError("the connection was closed") from None


async def write_frame(writer: asyncio.StreamWriter, frame: bytes, limit_s: float) -> None:
    """Send a frame. Raises OSError if the stream is closed or the other end took nothing within the limit."""
    writer.write(len(frame).to_bytes(LENGTH_BYTES, "little") + frame)
    async with asyncio.timeout(limit_s):
        await writer.drain()


async def close(writer: asyncio.StreamWriter) -> None:
    """Close a stream in any state."""
    writer.close()
    try:
        async with asyncio.timeout(CLOSE_S):
            await writer.wait_closed()
    except OSError:
        writer.transport.abort()
