"""The viewing end: connects to the sharing host, reconnects, and turns what arrives into sessions."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic

from weberlink.apps.monitor.hello import hello
from weberlink.apps.monitor.remote.feeds import RemoteSide
from weberlink.apps.monitor.remote.joining import counterpart, join
from weberlink.apps.monitor.remote.messages import (
    LinkMessage,
    SideIntroduction,
    read_end,
    read_introduction,
    read_records,
)
from weberlink.apps.monitor.remote.stream import MessageStream, close, connect
from weberlink.apps.monitor.rings import RingFeed
from weberlink.apps.monitor.session import WatchedSession
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.apps.tasks import first_result
from weberlink.protocol.sealed_stream import RefusedError, StreamError, StreamTerms
from weberlink.telemetry.ring import RingFormatError

NAME = "remote"
CONNECT_S = 5.0
SILENCE_S = 5.0
"""Silence that ends a connection; the other end sends at least once a second."""
ALIVE_S = 1.0
RETRY_S = 1.0
LONGEST_RETRY_S = 8.0
ARRANGE_S = 0.5
INTRODUCE_S = 2.0
"""How long after a reconnection the host may take to say that the session goes on."""


class Following:
    """Follows the sessions of one host.

    Args:
        terms: see `stream.telemetry_terms`.
        address: host and port.
        watch: shows the sessions.
        where: folder of this host's rings, for the other side of a session; None for those of this user.
        tell: called with lines for the user.
    """

    def __init__(
        self,
        terms: StreamTerms,
        address: tuple[str, int],
        watch: SessionWatcher,
        where: Path | None,
        tell: Callable[[str], None],
    ) -> None:
        self._terms = terms
        self._host, self._port = address
        self._watch = watch
        self._where = where
        self._tell = tell
        self._said = ""
        self._sides: dict[str, RemoteSide] = {}
        self._session: WatchedSession | None = None
        """The session that the sides are shown in."""
        self._is_joined = False
        """Whether that session has a side of this host."""
        self._count = 0
        self._introduced: set[str] = set()
        """Sides that were introduced on this connection."""

    async def run(self) -> None:
        """Connect and reconnect until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._arrange_often())
            tasks.create_task(self._connect_often())

    async def _connect_often(self) -> None:
        wait = RETRY_S
        while True:
            began = monotonic()
            self._say(await self._connection())
            wait = RETRY_S if monotonic() - began > LONGEST_RETRY_S else min(2.0 * wait, LONGEST_RETRY_S)
            await asyncio.sleep(wait)

    async def _connection(self) -> str:
        """One connection, to its end; returns why it ended."""
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_connection(self._host, self._port)
        except TimeoutError:
            return "does not answer; check the address and that no firewall blocks it"
        except OSError as error:
            why = error.strerror or str(error)
            return f"cannot be reached ({why}); start there: weberlink monitor --share ADDRESS:PORT --key-file KEY"
        try:
            stream = await connect(reader, writer, self._terms, CONNECT_S)
            await stream.send(LinkMessage.READY, b"", CONNECT_S)
            self._say("connected")
            await self._follow(stream)
        except (RefusedError, StreamError) as error:
            return str(error)
        except OSError:  # also a silence that is too long
            pass
        finally:
            await close(writer)
        return "connection lost; reconnecting"

    async def _follow(self, stream: MessageStream) -> None:
        self._introduced.clear()
        giving_up = asyncio.get_running_loop().call_later(INTRODUCE_S, self._drop_unless_introduced)
        try:
            await first_result([self._receive(stream), _send_alive(stream)])
        finally:
            giving_up.cancel()

    async def _receive(self, stream: MessageStream) -> None:
        while True:
            self._take(*await stream.receive(SILENCE_S))

    def _take(self, kind: int, payload: bytes) -> None:
        if kind == LinkMessage.BEGIN:
            self._begin(read_introduction(payload))
        elif kind == LinkMessage.RECORDS:
            block = read_records(payload)
            if block.side not in self._introduced or block.side not in self._sides:
                raise StreamError("it sends records of a side that it did not introduce")
            self._sides[block.side].push(block)
        elif kind == LinkMessage.END:
            side = self._sides.get(read_end(payload))
            if side is not None:
                side.ended = True
        elif kind != LinkMessage.ALIVE:
            raise StreamError("it sends messages of an unknown kind")

    def _begin(self, new: SideIntroduction) -> None:
        _check_description(new)
        self._introduced.add(new.side)
        known = self._sides.get(new.side)
        if known is not None and (known.introduction.session, known.introduction.began) == (new.session, new.began):
            known.introduction = new  # after a reconnection, or with news in the description
            return
        if known is not None or any(side.introduction.session != new.session for side in self._sides.values()):
            self._drop()
        self._sides[new.side] = RemoteSide(new)
        if self._is_joined:  # the other side is on that host too
            self._session, self._is_joined = None, False
            for side in self._sides.values():
                self._show(side)
        else:
            self._show(self._sides[new.side])

    def _show(self, side: RemoteSide) -> None:
        """Add a side to the session that is shown, or begin one with it."""
        feed = side.feed()
        if self._session is None or self._session.ended:
            self._session = WatchedSession(self._next_name(), feed, remote=True)
            self._watch.put(self._session)
        else:
            self._watch.admit(self._session.name, feed)

    async def _arrange_often(self) -> None:
        while True:
            with suppress(RingFormatError, OSError):
                self._arrange()
            await asyncio.sleep(ARRANGE_S)

    def _arrange(self) -> None:
        """Join a single side with its counterpart on this host, once that is known."""
        if len(self._sides) != 1:
            return
        (side,) = self._sides.values()
        if side.ended or (self._is_joined and self._session is not None and not self._session.ended):
            return
        path = counterpart(self._where, side)
        if path is None:
            return
        local = RingFeed(path)
        master, slave = join(local, side.feed())
        self._session = WatchedSession(self._next_name(), master, remote=True)
        self._session.admit(slave)
        self._is_joined = True
        self._watch.put(self._session)
        self._tell(f"the {side.introduction.side} of {self._host} and the {local.side} of this host are one session")

    def _next_name(self) -> str:
        self._count += 1
        return NAME if self._count < 2 else f"{NAME}-{self._count}"

    def _drop(self) -> None:
        """End all sides."""
        for side in self._sides.values():
            side.ended = True
        self._sides, self._session, self._is_joined = {}, None, False

    def _drop_unless_introduced(self) -> None:
        """End the session if the host did not say after a reconnection that it goes on."""
        if self._sides and not self._introduced:
            self._drop()

    def _say(self, what: str) -> None:
        """Tell the user, but not the same thing twice in a row."""
        if what != self._said:
            self._said = what
            self._tell(f"{self._host}:{self._port}: {what}")


def _check_description(introduction: SideIntroduction) -> None:
    """Raises StreamError if a page could not show the description of a side."""
    description = introduction.description
    if description is None:
        return
    try:
        hello(introduction.session, {introduction.side: description}, remote=True)
        names = (*description.get("bank", ()), *description.get("torque_bank", ()))
        valid = all(isinstance(name, str) for name in names)
    except (AttributeError, LookupError, TypeError, ValueError):
        valid = False
    if not valid:
        raise StreamError("its description of the session cannot be read; use the same release on both hosts")


async def _send_alive(stream: MessageStream) -> None:
    while True:
        await asyncio.sleep(ALIVE_S)
        await stream.send(LinkMessage.ALIVE, b"", SILENCE_S)
