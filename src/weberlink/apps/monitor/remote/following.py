"""The looking end: calls the host that shares, again and again, and turns what arrives into sessions."""

import asyncio
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic

from weberlink.apps.monitor.feed import RingFeed
from weberlink.apps.monitor.hello import hello
from weberlink.apps.monitor.remote import handshake
from weberlink.apps.monitor.remote.channel import LONGEST_FRAME, Channel, StreamError
from weberlink.apps.monitor.remote.joining import counterpart, join
from weberlink.apps.monitor.remote.messages import Begin, Message, read_begin, read_end, read_records
from weberlink.apps.monitor.remote.source import RemoteSource, Tap
from weberlink.apps.monitor.remote.wire import close, read_frame, write_frame
from weberlink.apps.monitor.session import Session
from weberlink.apps.monitor.watch import Watch
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import LONGEST_DATAGRAM
from weberlink.telemetry.ring import RingFormatError

NAME = "remote"
CONNECT_S = 5.0
SILENCE_S = 5.0
"""Until a link that says nothing is given up; the other end says something every second."""
ALIVE_S = 1.0
RETRY_S = 1.0
LONGEST_RETRY_S = 8.0
ARRANGE_S = 0.5
BEGIN_S = 2.0
"""For a host that was called again to say that the session goes on."""


class Following:
    """Follows one host.

    Args:
        security: as of `handshake.suite`.
        address: host and port.
        watch: shows the sessions.
        where: folder of the rings of this host, for the other side of a session; None for those of this user.
        tell: told in a line what the link does.
    """

    def __init__(
        self,
        security: PresharedKey,
        address: tuple[str, int],
        watch: Watch,
        where: Path | None,
        tell: Callable[[str], None],
    ) -> None:
        self._security = security
        self._host, self._port = address
        self._watch = watch
        self._where = where
        self._tell = tell
        self._said = ""
        self._sources: dict[str, RemoteSource] = {}
        self._taps: list[Tap] = []
        self._is_joined = False
        self._count = 0
        self._greeted: set[str] = set()
        """Sides that were introduced on this connection."""

    async def run(self) -> None:
        """Call, follow, and call again, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._arrange_often())
            tasks.create_task(self._call_often())

    async def _call_often(self) -> None:
        wait = RETRY_S
        while True:
            began = monotonic()
            self._say(await self._attempt())
            wait = RETRY_S if monotonic() - began > LONGEST_RETRY_S else min(2.0 * wait, LONGEST_RETRY_S)
            await asyncio.sleep(wait)

    async def _attempt(self) -> str:
        """One call, to its end; returns why it ended."""
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_connection(self._host, self._port)
        except TimeoutError:
            return "does not answer; see that the address is right and that no firewall is in the way"
        except OSError as error:
            why = error.strerror or str(error)
            return f"cannot be reached ({why}); start there: weberlink monitor --share ADDRESS:PORT --key-file KEY"
        try:
            channel = await self._open(reader, writer)
            self._say("connected")
            await self._follow(channel, reader, writer)
        except (handshake.RefusedError, StreamError) as error:
            return str(error)
        except OSError:  # a silence too long is one
            pass
        finally:
            await close(writer)
        return "the link is lost; calling again"

    async def _open(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Channel:
        call = handshake.Call(self._security, os.urandom)
        await write_frame(writer, call.hello(), CONNECT_S)
        try:
            frame = await read_frame(reader, LONGEST_DATAGRAM, CONNECT_S)
        except (OSError, TimeoutError):
            raise handshake.RefusedError(
                "it hangs up without an answer, as it does on a wrong key; --key-file must be a copy of the one there"
            ) from None
        channel = call.answered(frame)
        await write_frame(writer, channel.seal(Message.READY, b""), CONNECT_S)
        return channel

    async def _follow(self, channel: Channel, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._greeted.clear()
        loop = asyncio.get_running_loop()
        giving_up = loop.call_later(BEGIN_S, self._forget_unheard)
        living = asyncio.ensure_future(_live(channel, writer))
        try:
            while True:
                self._take(*channel.open(await read_frame(reader, LONGEST_FRAME, SILENCE_S)))
        finally:
            giving_up.cancel()
            living.cancel()
            await asyncio.gather(living, return_exceptions=True)

    def _take(self, kind: int, payload: bytes) -> None:
        if kind == Message.BEGIN:
            self._begin(read_begin(payload))
        elif kind == Message.RECORDS:
            piece = read_records(payload)
            if piece.side not in self._greeted or piece.side not in self._sources:
                raise StreamError("it sends records of a side that it did not introduce")
            self._sources[piece.side].push(piece)
        elif kind == Message.END:
            source = self._sources.get(read_end(payload))
            if source is not None:
                source.end()
        elif kind != Message.ALIVE:
            raise StreamError("it sends messages of an unknown kind")

    def _begin(self, begin: Begin) -> None:
        _check_description(begin)
        self._greeted.add(begin.side)
        known = self._sources.get(begin.side)
        if known is not None and (known.begin.session, known.begin.began) == (begin.session, begin.began):
            return  # after a connection that was lost
        if known is not None or any(source.begin.session != begin.session for source in self._sources.values()):
            self._drop()
        self._sources[begin.side] = RemoteSource(begin)
        if self._is_joined:  # it was not the whole of it
            self._cut()
            for source in self._sources.values():
                self._show(source)
        else:
            self._show(self._sources[begin.side])

    def _show(self, source: RemoteSource) -> None:
        """Add a side to the session that is shown, or begin one with it."""
        tap = source.tap()
        session = self._watch.sessions.get(self._name) if self._taps else None
        if session is None or session.ended:
            self._watch.put(Session(self._next_name(), tap, remote=True))
        else:
            self._watch.admit(self._name, tap)
        self._taps.append(tap)

    async def _arrange_often(self) -> None:
        while True:
            with suppress(RingFormatError, OSError):
                self._arrange()
            await asyncio.sleep(ARRANGE_S)

    def _arrange(self) -> None:
        """Join a side that is alone with its counterpart on this host, once it is known."""
        if len(self._sources) != 1:
            return
        (source,) = self._sources.values()
        if source.ended or (self._is_joined and not self._watch.sessions[self._name].ended):
            return
        path = counterpart(self._where, source)
        if path is None:
            return
        local = RingFeed(path)
        self._cut()
        tap = source.tap()
        master, slave = join(local, tap)
        session = Session(self._next_name(), master, remote=True)
        session.admit(slave)
        self._taps.append(tap)
        self._is_joined = True
        self._watch.put(session)
        self._tell(f"the {source.begin.side} of {self._host} and the {local.side} of this host are one session")

    @property
    def _name(self) -> str:
        return NAME if self._count < 2 else f"{NAME}-{self._count}"

    def _next_name(self) -> str:
        self._count += 1
        return self._name

    def _cut(self) -> None:
        """End what is shown; its sources go on."""
        for tap in self._taps:
            tap.cut()
        self._taps = []
        self._is_joined = False

    def _drop(self) -> None:
        for source in self._sources.values():
            source.end()
        self._sources = {}
        self._taps = []
        self._is_joined = False

    def _forget_unheard(self) -> None:
        """Called again, the host did not say that the session goes on: it is over."""
        if self._sources and not self._greeted:
            self._drop()

    def _say(self, what: str) -> None:
        """Once, until something else is to be said."""
        if what != self._said:
            self._said = what
            self._tell(f"{self._host}:{self._port}: {what}")


def _check_description(begin: Begin) -> None:
    """See that a page can be told what a side says of itself.

    Raises:
        StreamError: it cannot.
    """
    if begin.description is None:
        return
    try:
        hello(begin.session, {begin.side: begin.description}, remote=True)
        names = (*begin.description.get("bank", ()), *begin.description.get("torque_bank", ()))
        ok = all(isinstance(name, str) for name in names)
    except (AttributeError, LookupError, TypeError, ValueError):
        ok = False
    if not ok:
        raise StreamError("its description of the session cannot be read; use the same release on both hosts")


async def _live(channel: Channel, writer: asyncio.StreamWriter) -> None:
    while True:
        await asyncio.sleep(ALIVE_S)
        await write_frame(writer, channel.seal(Message.ALIVE, b""), SILENCE_S)
