"""Two hosts that meet at a mailbox server, and a third party that has the server's powers over their mailbox."""

import asyncio
import json
import os
from collections.abc import AsyncIterator, Coroutine, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any, Self

from websockets.asyncio.client import ClientConnection, connect

from tests.wait import PATIENCE
from weberlink_anywhere.mailbox import APPLICATION
from weberlink_anywhere.peers import Peer
from weberlink_anywhere.rendezvous import Caller, Waiter
from weberlink_anywhere.sealing import Sealing
from weberlink_anywhere.signalling import Answer, Busy, Description, Offer

PATHS = (Description("ufrag", "p" * 22, ("1 1 udp 2130706431 192.0.2.1 4000 typ host",)),)


class Pair:
    """A master and a slave that know each other, at one mailbox server."""

    def __init__(self, url: str, master: str = "anna", slave: str = "robot") -> None:
        key = os.urandom(32)
        self.url = url
        self.master = Peer(master, master, slave, "master", key, url)
        self.slave = Peer(slave, slave, master, "slave", key, url)
        self.sealing = Sealing(key, "slave")
        self.caller = Caller(self.slave, url)

    async def call(self, timeout: float = PATIENCE) -> Answer | Busy:
        return await self.caller.call(PATHS, take_over=False, timeout=timeout)


class Host:
    """A slave's host, which answers every offer by the paths offered, and remembers the offers."""

    def __init__(self, pairs: Sequence[Pair], **options: int) -> None:
        self.notes: list[str] = []
        self.offers: list[tuple[str, Offer]] = []
        self.waiter = Waiter(pairs[0].url, self.notes.append, **options)
        self.waiter.meet([pair.master for pair in pairs])

    async def answer(self, peer: Peer, offer: Offer) -> Answer | Busy:
        self.offers.append((peer.label, offer))
        return Answer(offer.paths)


@asynccontextmanager
async def waiting(*pairs: Pair, **options: int) -> AsyncIterator[Host]:
    """A slave that waits, until the end of the `with`."""
    host = Host(pairs, **options)
    async with running(host.waiter.serve(host.answer)):
        yield host


@asynccontextmanager
async def running(work: Coroutine[Any, Any, Any]) -> AsyncIterator[asyncio.Task[Any]]:
    task = asyncio.create_task(work)
    try:
        yield task
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


class ThirdParty:
    """A connection of its own to the mailbox of a pair, as a side of its choice."""

    def __init__(self, pair: Pair, side: str) -> None:
        self._pair, self._side = pair, side
        self._socket: ClientConnection

    async def __aenter__(self) -> Self:
        self._socket = await connect(self._pair.url)
        await self.send(type="bind", appid=APPLICATION, side=self._side)
        await self.send(type="open", mailbox=self._pair.sealing.mailbox)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._socket.close()

    async def send(self, **told: str) -> None:
        await self._socket.send(json.dumps(told))

    async def add(self, phase: str, body: str) -> None:
        await self.send(type="add", phase=phase, body=body)

    async def stored(self) -> list[dict[str, Any]]:
        await self.send(type="ping", ping="0")
        found = []
        while (told := json.loads(await self._socket.recv()))["type"] != "pong":
            if told["type"] in ("message", "error"):
                found.append(told)
        return found
