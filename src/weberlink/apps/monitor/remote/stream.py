"""Authenticated, encrypted stream of messages over TCP.

The handshake is that of the daemons (`weberlink.protocol.psk`), with a key derived from theirs, so that no message of
one protocol is valid in the other. A frame is two bytes of length (little endian) and a datagram of that suite: kind
u8, message number u24, encrypted payload. Changed, repeated, missing or reordered messages end the connection.
"""

import asyncio
import os
import struct
from hmac import digest

from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Protection
from weberlink.telemetry.record import RECORD
from weberlink.telemetry.ring import SCHEMA

LONGEST_PAYLOAD = 60_000
"""AES-CCM with a nonce of 13 bytes takes up to 65,535 bytes."""
LONGEST_FRAME = LONGEST_PAYLOAD + 64
LENGTH_BYTES = 2
CLEAR_BYTES = 4
CLOSE_S = 1.0
RELEASE = struct.pack("<4sQI", b"WBT3", SCHEMA, RECORD.size)
"""Sent in clear by both ends and authenticated: hosts with different releases cannot connect."""


class StreamError(ConnectionError):
    """The other end did not send this, or not in this order; the connection is useless."""


class RefusedError(ConnectionError):
    """The other end does not hold the key or has another release; the message says what to do."""


def telemetry_key(key: bytes) -> PresharedKey:
    """The key of the link, derived from that of the daemons."""
    return PresharedKey(digest(key, b"weberlink telemetry link", "sha256"))


class SecureStream:
    """One end of an open connection; made by `connect` and `accept`."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, protection: Protection) -> None:
        self._reader = reader
        self._writer = writer
        self._protection = protection
        self._sent = 0
        self._received = 0

    async def send(self, kind: int, payload: bytes, limit_s: float) -> None:
        """Send a message of a kind from 0 to 255.

        Raises:
            ValueError: the payload is too long.
            OSError: the stream is closed, or the other end took nothing within the limit [s].
        """
        if len(payload) > LONGEST_PAYLOAD:
            raise ValueError(f"a message has at most {LONGEST_PAYLOAD} bytes, not {len(payload)}")
        sealed = self._protection.seal(self._sent, _head(kind, self._sent) + payload)
        self._sent += 1
        await write_frame(self._writer, sealed, limit_s)

    async def receive(self, limit_s: float) -> tuple[int, bytes]:
        """Kind and payload of the next message.

        Raises:
            StreamError: it is not the next message of the other end.
            OSError: the stream ended, or nothing came within the limit [s].
        """
        frame = await read_frame(self._reader, limit_s)
        number = self._received
        if len(frame) < CLEAR_BYTES or frame[1:CLEAR_BYTES] != _head(0, number)[1:]:
            raise StreamError("a message is out of order")
        payload = self._protection.open(number, frame)
        if payload is None:
            raise StreamError("a message was changed on its way")
        self._received += 1
        return frame[0], payload


def _head(kind: int, number: int) -> bytes:
    return bytes((kind,)) + (number & 0xFF_FFFF).to_bytes(3, "little")


async def connect(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, key: PresharedKey, limit_s: float
) -> SecureStream:
    """Open a connection as the caller.

    Raises:
        RefusedError: the other end does not prove the key, or has another release.
    """
    exchange = key.call(RELEASE, os.urandom(key.private_size))
    await write_frame(writer, RELEASE + exchange.hello(b""), limit_s)
    try:
        answer = await read_frame(reader, limit_s)
    except OSError:
        raise RefusedError(
            "hangs up without an answer, as it does on a wrong key; --key-file must be a copy of the one there"
        ) from None
    opened = exchange.open(answer[len(RELEASE) :])
    if opened is None:
        raise RefusedError("does not prove the key; --key-file must be a copy of the one there")
    if answer[: len(RELEASE)] != RELEASE:
        raise RefusedError("has another release of weberlink; use the same one on both hosts")
    return SecureStream(reader, writer, opened[1])


async def accept(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, key: PresharedKey, limit_s: float
) -> SecureStream | None:
    """Open a connection as the one called; None for a caller without the key (gets no answer) or of another release.

    The first message may be a recording. Wait for a message before sending anything: only a live caller can make one.
    """
    hello = await read_frame(reader, limit_s)
    release = hello[: len(RELEASE)]
    exchange = key.hear(release, hello[len(RELEASE) :])
    answered = None if exchange is None else exchange.answer(b"", os.urandom(key.private_size))
    if answered is None:
        return None
    await write_frame(writer, RELEASE + answered[0], limit_s)
    return SecureStream(reader, writer, answered[1]) if release == RELEASE else None


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
