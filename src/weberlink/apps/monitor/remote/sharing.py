"""The sharing end: serves the telemetry of this host to callers who prove the key.

Each connection reads the rings itself, as fast as its link allows; the rings are the queue.
"""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any

from weberlink.apps.monitor.access import Admission, origin
from weberlink.apps.monitor.remote.messages import (
    RECORDS_AT_ONCE,
    LinkMessage,
    RecordBlock,
    SideIntroduction,
    pack_end,
    pack_introduction,
    pack_records,
)
from weberlink.apps.monitor.remote.stream import MessageStream, accept, close
from weberlink.apps.monitor.rings import RingFeed, RingFile, RingOpener, find_rings
from weberlink.apps.tasks import first_result
from weberlink.protocol.sealed_stream import StreamError, StreamTerms

LOOK_S = 0.05
FIND_S = 0.25
ALIVE_S = 1.0
HANDSHAKE_S = 3.0
"""How long a caller may take to prove the key."""
SILENCE_S = 10.0
"""How long a caller may send nothing, or take nothing."""
MOST_CALLERS = 16
"""Callers at a time that have proved the key."""
MOST_UNPROVEN = 64
MOST_UNPROVEN_OF_ORIGIN = 16
"""Callers at a time that have not; a newcomer replaces the oldest."""

Messages = Iterator[tuple[LinkMessage, bytes]]


class Sharing:
    """The server.

    Args:
        terms: see `stream.telemetry_terms`.
        where: folder of the rings; None for those of this user.
        only: name of the session to share; None for the newest.
        tell: called with lines for the user.
        handshake_s: how long a caller may take to prove the key.
    """

    def __init__(
        self,
        terms: StreamTerms,
        where: Path | None,
        only: str | None,
        tell: Callable[[str], None],
        handshake_s: float = HANDSHAKE_S,
    ) -> None:
        self._terms = terms
        self._where = where
        self._only = only
        self._tell = tell
        self._handshake_s = handshake_s
        self._tasks: set[asyncio.Task[None]] = set()
        self._unproven: Admission[asyncio.Task[None]] = Admission(MOST_UNPROVEN, MOST_UNPROVEN_OF_ORIGIN)
        self._viewers = 0
        self._server: asyncio.Server | None = None

    async def open(self, host: str, port: int) -> tuple[str, int]:
        """Listen; returns the address. Raises OSError if that is not possible."""
        self._server = await asyncio.start_server(self._called, host, port)
        name = self._server.sockets[0].getsockname()
        return str(name[0]), int(name[1])

    async def close(self) -> None:
        """Stop listening and close all connections."""
        if self._server is not None:
            self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _called(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        peer = writer.get_extra_info("peername")[0]
        try:
            stream = await self._admitted(task, peer, reader, writer)
            if stream is not None and self._viewers < MOST_CALLERS:
                await self._serve(stream, peer)
        except (OSError, StreamError, asyncio.CancelledError):
            pass  # the caller is gone, or proved nothing
        finally:
            await close(writer)
            self._tasks.discard(task)

    async def _admitted(
        self, task: asyncio.Task[None], peer: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> MessageStream | None:
        """Let a caller prove the key; it may expel another one that has not yet."""
        expelled = self._unproven.admit(task, origin(peer))
        if expelled is not None:
            expelled.cancel()
        try:
            async with asyncio.timeout(self._handshake_s):
                stream = await accept(reader, writer, self._terms, self._handshake_s)
                if stream is None:
                    return None
                kind, _ = await stream.receive(self._handshake_s)
                return stream if kind == LinkMessage.READY else None
        finally:
            self._unproven.leave(task)

    async def _serve(self, stream: MessageStream, peer: str) -> None:
        self._viewers += 1
        self._tell(f"{peer} connected")
        outlet = RingMessages(self._where, self._only)
        try:
            await first_result([_send(outlet, stream), _listen(stream)])
        finally:
            outlet.close()
            self._viewers -= 1
            self._tell(f"{peer} disconnected")


async def _send(outlet: "RingMessages", stream: MessageStream) -> None:
    alive_at = 0.0
    while True:
        now = monotonic()
        for kind, payload in outlet.look(now):
            await stream.send(kind, payload, SILENCE_S)
            alive_at = monotonic() + ALIVE_S
        if now >= alive_at:
            await stream.send(LinkMessage.ALIVE, b"", SILENCE_S)
            alive_at = now + ALIVE_S
        await asyncio.sleep(LOOK_S)


async def _listen(stream: MessageStream) -> None:
    """Check that the caller is alive and sends nothing else."""
    while True:
        kind, payload = await stream.receive(SILENCE_S)
        if kind != LinkMessage.ALIVE or payload:
            raise StreamError("a caller may only view")


class RingMessages:
    """The messages to one caller: the newest session until it ends, then the next.

    Args:
        where, only: see `Sharing`.
    """

    def __init__(self, where: Path | None, only: str | None) -> None:
        self._where = where
        self._only = only
        self._feeds: dict[str, RingFeed] = {}
        self._described: dict[str, dict[str, Any] | None] = {}
        """By side, as it was introduced."""
        self._session: str | None = None
        self._opener = RingOpener()
        self._find_at = 0.0

    def close(self) -> None:
        for feed in self._feeds.values():
            feed.close()

    def look(self, now: float) -> Messages:
        """The messages to send now."""
        if now >= self._find_at:
            self._find_at = now + FIND_S
            yield from self._find()
        for side, feed in self._feeds.items():
            if not feed.drained:
                yield from self._read(side, feed)

    def _read(self, side: str, feed: RingFeed) -> Messages:
        records = feed.read()
        if feed.description is not self._described.get(side):
            yield self._introduce(feed)
        for at in range(0, len(records), RECORDS_AT_ONCE):
            block = RecordBlock(side, feed.written, feed.lost, records[at : at + RECORDS_AT_ONCE])
            yield LinkMessage.RECORDS, pack_records(block)
        if feed.drained:
            yield LinkMessage.END, pack_end(side)

    def _find(self) -> Messages:
        found = find_rings(self._where)
        if self._feeds and all(feed.drained for feed in self._feeds.values()):
            self.close()
            self._feeds, self._session = {}, None
        for name in [self._session] if self._session is not None else list(reversed(found)):
            if self._only in (None, name):
                for ring in found.get(name, {}).values():
                    yield from self._open(ring)
            if self._feeds:
                break

    def _open(self, ring: RingFile) -> Messages:
        feed = None if ring.side in self._feeds else self._opener.open(ring)
        if feed is not None:
            self._feeds[ring.side] = feed
            self._session = ring.session
            yield self._introduce(feed)

    def _introduce(self, feed: RingFeed) -> tuple[LinkMessage, bytes]:
        """Introduce a side, or what its description says now."""
        assert self._session is not None
        self._described[feed.side] = feed.description
        introduction = SideIntroduction(self._session, feed.side, feed.rate_hz, feed.began, feed.description)
        return LinkMessage.BEGIN, pack_introduction(introduction)
