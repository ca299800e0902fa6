"""The sharing end: serves the telemetry of this host to those who prove the key.

Every connection reads the rings by itself, as fast as its link takes it; the ring is the queue.
"""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from time import monotonic

from weberlink.apps.monitor.admission import Admission, origin
from weberlink.apps.monitor.feed import RingFeed
from weberlink.apps.monitor.finding import Found, find
from weberlink.apps.monitor.remote import handshake
from weberlink.apps.monitor.remote.channel import LONGEST_FRAME, Channel, StreamError
from weberlink.apps.monitor.remote.messages import (
    RECORDS_AT_ONCE,
    Begin,
    Message,
    Piece,
    pack_begin,
    pack_end,
    pack_records,
)
from weberlink.apps.monitor.remote.wire import close, read_frame, write_frame
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import LONGEST_DATAGRAM
from weberlink.telemetry.ring import RingFormatError

LOOK_S = 0.05
FIND_S = 0.25
ALIVE_S = 1.0
HANDSHAKE_S = 3.0
"""For a caller to prove the key, from the first byte to the last."""
SILENCE_S = 10.0
"""Until a caller that says nothing, or takes nothing, is given up."""
MOST_CALLERS = 16
"""Who have proved the key, at a time."""
MOST_UNPROVEN = 64
MOST_UNPROVEN_OF_ORIGIN = 16
"""Callers who have not yet, at a time; one more takes the place of the oldest."""


class Sharing:
    """The server.

    Args:
        security: as of `handshake.suite`.
        where: folder of the rings; None for those of this user.
        only: name of the one session to share; None for the newest.
        tell: told in a line who comes and goes.
        handshake_s: how long a caller may take to prove the key.
    """

    def __init__(
        self,
        security: PresharedKey,
        where: Path | None,
        only: str | None,
        tell: Callable[[str], None],
        handshake_s: float = HANDSHAKE_S,
    ) -> None:
        self._handshake_s = handshake_s
        self._security = security
        self._where = where
        self._only = only
        self._tell = tell
        self._callers: set[asyncio.Task[None]] = set()
        self._unproven: Admission[asyncio.Task[None]] = Admission(MOST_UNPROVEN, MOST_UNPROVEN_OF_ORIGIN)
        self._lookers = 0
        self._server: asyncio.Server | None = None

    async def open(self, host: str, port: int) -> tuple[str, int]:
        """Listen; returns the address. Raises OSError where that is not possible."""
        self._server = await asyncio.start_server(self._called, host, port)
        name = self._server.sockets[0].getsockname()
        return str(name[0]), int(name[1])

    async def close(self) -> None:
        """Stop listening and hang up on everybody."""
        if self._server is not None:
            self._server.close()
        for task in list(self._callers):
            task.cancel()
        await asyncio.gather(*self._callers, return_exceptions=True)

    async def _called(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._callers.add(task)
        peer = writer.get_extra_info("peername")[0]
        try:
            channel = await self._admitted(task, peer, reader, writer)
            if channel is not None and self._lookers < MOST_CALLERS:
                await self._serve(channel, peer, reader, writer)
        except (OSError, TimeoutError, StreamError, asyncio.CancelledError):
            pass  # whoever it was is gone, or is nobody
        finally:
            await close(writer)
            self._callers.discard(task)

    async def _admitted(
        self, task: asyncio.Task[None], peer: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> Channel | None:
        """Let a caller prove the key, at the cost of the oldest one who has not where there are too many."""
        expelled = self._unproven.admit(task, origin(peer))
        if expelled is not None:
            expelled.cancel()
        try:
            async with asyncio.timeout(self._handshake_s):
                return await self._prove(reader, writer)
        finally:
            self._unproven.leave(task)

    async def _prove(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Channel | None:
        """The connection of a caller who holds the key; None for one who does not, or who is refused."""
        first = await read_frame(reader, LONGEST_DATAGRAM, self._handshake_s)
        reply = handshake.answer(first, self._security, os.urandom)
        if reply is None:
            return None
        welcome, channel = reply
        await write_frame(writer, welcome, self._handshake_s)
        if channel is None:
            return None
        kind, _ = channel.open(await read_frame(reader, LONGEST_FRAME, self._handshake_s))
        return channel if kind == Message.READY else None

    async def _serve(
        self, channel: Channel, peer: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._lookers += 1
        self._tell(f"{peer} looks on")
        outlet = Outlet(self._where, self._only)
        sending = asyncio.ensure_future(self._send(outlet, channel, writer))
        try:
            listening = asyncio.ensure_future(_listen(reader, channel))
            try:
                await asyncio.wait({sending, listening}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for half in (sending, listening):
                    half.cancel()
                await asyncio.gather(sending, listening, return_exceptions=True)
        finally:
            outlet.close()
            self._lookers -= 1
            self._tell(f"{peer} has left")

    async def _send(self, outlet: "Outlet", channel: Channel, writer: asyncio.StreamWriter) -> None:
        alive_at = 0.0
        while True:
            now = monotonic()
            for kind, payload in outlet.look(now):
                await write_frame(writer, channel.seal(kind, payload), SILENCE_S)
                alive_at = monotonic() + ALIVE_S
            if now >= alive_at:
                await write_frame(writer, channel.seal(Message.ALIVE, b""), SILENCE_S)
                alive_at = now + ALIVE_S
            await asyncio.sleep(LOOK_S)


async def _listen(reader: asyncio.StreamReader, channel: Channel) -> None:
    """Hear that the caller is there, and nothing else."""
    while True:
        kind, payload = channel.open(await read_frame(reader, LONGEST_FRAME, SILENCE_S))
        if kind != Message.ALIVE or payload:
            raise StreamError("a caller can only look")


class Outlet:
    """What one caller is sent: the newest session, until it ends, and then the next.

    Args:
        where, only: as of `Sharing`.
    """

    def __init__(self, where: Path | None, only: str | None) -> None:
        self._where = where
        self._only = only
        self._feeds: dict[str, RingFeed] = {}
        self._session: str | None = None
        self._known: set[tuple[str, int]] = set()
        self._find_at = 0.0

    def close(self) -> None:
        for feed in self._feeds.values():
            feed.close()

    def look(self, now: float) -> "list[tuple[Message, bytes]]":
        """What is to be sent now, as kinds and payloads."""
        messages: list[tuple[Message, bytes]] = []
        if now >= self._find_at:
            self._find_at = now + FIND_S
            messages += self._find()
        for side, feed in self._feeds.items():
            if not feed.drained:
                messages += self._read(side, feed)
        return messages

    def _read(self, side: str, feed: RingFeed) -> "list[tuple[Message, bytes]]":
        records = feed.read()
        pieces = [records[at : at + RECORDS_AT_ONCE] for at in range(0, len(records), RECORDS_AT_ONCE)]
        messages = [(Message.RECORDS, pack_records(Piece(side, feed.written, feed.lost, piece))) for piece in pieces]
        return [*messages, (Message.END, pack_end(side))] if feed.drained else messages

    def _find(self) -> "list[tuple[Message, bytes]]":
        found = find(self._where)
        if self._feeds and all(feed.drained for feed in self._feeds.values()):
            self.close()
            self._feeds, self._session = {}, None
        names = [self._session] if self._session is not None else list(reversed(found))
        messages: list[tuple[Message, bytes]] = []
        for name in names:
            if self._only in (None, name):
                messages += [message for ring in found.get(name, {}).values() for message in self._open(ring)]
            if self._feeds:
                break
        return messages

    def _open(self, found: Found) -> "list[tuple[Message, bytes]]":
        key = (str(found.path), found.number)
        if key in self._known or found.side in self._feeds:
            return []
        self._known.add(key)
        try:
            feed = RingFeed(found.path)
        except (RingFormatError, OSError):
            return []
        if not feed.alive:
            feed.close()
            return []
        self._feeds[found.side] = feed
        self._session = found.session
        begin = Begin(found.session, found.side, feed.rate_hz, feed.began, feed.description)
        return [(Message.BEGIN, pack_begin(begin))]
