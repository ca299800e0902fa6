"""One mailbox of a magic-wormhole mailbox server, over a WebSocket.

A mailbox holds messages of two sides, and gives all of them to who opens it, and then each new one. The server forgets
a mailbox 11 to 16 minutes after the last connection to it ended, and else only when both sides closed it. So a side
that waits for days never closes its mailbox, and `sweep` empties it when many messages have gathered. Both ends of a
pair use their own side after every start, so no start of theirs makes the mailbox "crowded", which a third side does.

Facts: magic-wormhole-mailbox-server 0.8.0, `server.py`, `server_websocket.py`, `server_tap.py`.
"""

import asyncio
import json
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from socket import IPPROTO_TCP, TCP_QUICKACK
from ssl import SSLCertVerificationError
from typing import Any, Final, NamedTuple, Self

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from weberlink.bounded_json import parse
from weberlink.text import one_line
from weberlink_anywhere.calls import Message
from weberlink_anywhere.sealing import Sealing
from weberlink_anywhere.signalling import MailboxUnreachable

APPLICATION: Final = "weberlink/rendezvous-1"
OPEN_LIMIT_S: Final = 10.0
PING_S: Final = 10.0
"""Between two pings; a connection without a pong for as long again is lost."""
LARGEST_TOLD: Final = 32_768
"""Bytes of one message of the server; a call is sealed in fewer than 8,192."""
MOST_STORED: Final = 2048
"""Messages after which a server is not asked for more: a mailbox of so many is emptied."""
MOST_TOLD: Final = 2 * MOST_STORED
"""Of any kind, on one connection, which is renewed every minute."""


class MailboxRefuses(MailboxUnreachable):
    """The server answered with an error; asking again at once does not help."""


class Received(NamedTuple):
    """A message of the other side, and how long the server says that it held it [s], which nothing may rely on."""

    message: Message
    age: float


class Connection:
    """A connection to the server, as one side; the messages of both are JSON objects."""

    def __init__(self, socket: ClientConnection, url: str) -> None:
        self._socket, self._url, self._left = socket, url, MOST_TOLD

    async def send(self, **told: str) -> None:
        """Raises MailboxUnreachable: the connection is lost."""
        try:
            await self._socket.send(json.dumps(told))
        except WebSocketException as problem:
            raise _unreachable(self._url, problem) from None

    async def receive(self) -> dict[str, Any]:
        """Raises MailboxUnreachable: the connection is lost, or the server refuses what it was asked for."""
        self._left -= 1
        if self._left < 0:
            raise MailboxRefuses(f"the mailbox server {self._url} sends without end")
        try:
            told = dict(parse(await self._socket.recv(decode=False), LARGEST_TOLD))
            with suppress(OSError):  # the connection is lost
                # TCP acknowledges at once: the server holds its next packet until then, 40 ms on Linux (Nagle).
                self._socket.transport.get_extra_info("socket").setsockopt(IPPROTO_TCP, TCP_QUICKACK, 1)
            refused = {"error": told.get("error")} if told["type"] == "error" else told.get("welcome")
        except WebSocketException as problem:
            raise _unreachable(self._url, problem) from None
        except (ValueError, TypeError, KeyError):
            raise MailboxRefuses(f"{self._url} is not a magic-wormhole mailbox server") from None
        if isinstance(refused, dict) and "error" in refused:
            reason = one_line(str(refused["error"]))
            if reason == "crowded":
                reason = "a third party opened the mailbox of this pair; wait 20 minutes, or pair again"
            raise MailboxRefuses(f"the mailbox server {self._url} refuses: {reason}")
        return told

    def unanswered(self) -> MailboxUnreachable:
        """What to raise when the server is connected, and does not answer."""
        return _unreachable(self._url, TimeoutError())


class Mailbox:
    """An open mailbox: an iterator of the messages of the other side."""

    def __init__(self, connection: Connection, sealing: Sealing) -> None:
        self._connection, self._sealing = connection, sealing
        self.count = 0
        """Messages of both sides so far: as many as the server holds, or more."""

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Received:
        """Raises MailboxUnreachable: the connection is lost."""
        while True:
            if (received := self._read(await self._connection.receive())) is not None:
                return received

    async def stored(self) -> list[Received]:
        """The messages of the other side that the server holds, `MOST_STORED` at most; to be asked for at first.

        Raises:
            MailboxUnreachable: the connection is lost, or the server refuses to open the mailbox, or does not end.
        """
        await self._connection.send(type="ping", ping="stored")  # answered after what was asked before
        found = []
        try:
            async with asyncio.timeout(OPEN_LIMIT_S):
                while self.count < MOST_STORED and (told := await self._connection.receive())["type"] != "pong":
                    if (received := self._read(told)) is not None:
                        found.append(received)
        except TimeoutError:
            raise self._connection.unanswered() from None
        return found

    async def add(self, message: Message) -> None:
        """Leave a message.

        Raises:
            MailboxUnreachable: the connection is lost; the message may have arrived.
        """
        await self._connection.send(type="add", phase=message.phase, body=message.body)

    def _read(self, told: dict[str, Any]) -> Received | None:
        if told["type"] != "message":
            return None
        self.count += 1
        phase, body, age = told.get("phase"), told.get("body"), 0.0
        if told.get("side") == self._sealing.side or not isinstance(phase, str) or not isinstance(body, str):
            return None
        with suppress(KeyError, TypeError, ValueError, OverflowError):
            age = float(told["server_tx"]) - float(told["server_rx"])
        return Received(Message(phase, body), age)


@asynccontextmanager
async def open_mailbox(url: str, sealing: Sealing) -> AsyncIterator[Mailbox]:
    """Open the mailbox of a pair as this end's side.

    Raises:
        MailboxUnreachable: the server is not reached, or refuses.
    """
    async with _connected(url, sealing.side) as connection:
        await connection.send(type="open", mailbox=sealing.mailbox)
        yield Mailbox(connection, sealing)


async def sweep(url: str, sealing: Sealing) -> None:
    """Delete all messages: the server does so when both sides have closed the mailbox.

    A connection that has it open hears nothing more.

    Raises:
        MailboxUnreachable: the server is not reached, or refuses.
    """
    for side in (sealing.other_side, sealing.side):
        async with _connected(url, side) as connection:
            await connection.send(type="close", mailbox=sealing.mailbox, mood="happy")
            while (await connection.receive())["type"] != "closed":
                pass


@asynccontextmanager
async def _connected(url: str, side: str) -> AsyncIterator[Connection]:
    try:
        # Compression of what is encrypted saves nothing.
        socket = await connect(
            url,
            open_timeout=OPEN_LIMIT_S,
            ping_interval=PING_S,
            ping_timeout=PING_S,
            compression=None,
            max_size=LARGEST_TOLD,
        )
    except (OSError, WebSocketException, ValueError) as problem:  # TimeoutError is an OSError
        raise _unreachable(url, problem) from None
    try:
        connection = Connection(socket, url)
        await connection.receive()  # its welcome
        await connection.send(type="bind", appid=APPLICATION, side=side)
        yield connection
    finally:
        socket.transport.abort()  # nothing is under way, and a closing handshake costs a round trip, or a time-out
        await socket.wait_closed()


def _unreachable(url: str, problem: Exception) -> MailboxUnreachable:
    if isinstance(problem, SSLCertVerificationError):  # its number is none of the system
        why = one_line(problem.verify_message)
        return MailboxUnreachable(f"the certificate of the mailbox server {url} is not accepted: {why} (docs/relay.md)")
    code = getattr(problem, "errno", None) or 0
    reason = os.strerror(code) if code > 0 else getattr(problem, "strerror", None) or str(problem) or "no answer"
    return MailboxUnreachable(f"the mailbox server {url} cannot be reached: {one_line(reason)}")
