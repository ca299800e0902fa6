"""A mailbox server that does what a rule says to the messages of two hosts, in front of a real one.

The path of the URL is the rule, a word for its phase if it has one, and a token: `ws://127.0.0.1:PORT/drop/pake/slave/7`.
Connections of one path are those of one trial, in order: first the slave, which invites, then the master.
"""

import asyncio
import json
import threading
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

Message = dict[str, Any]
ROLES = ("slave", "master")


class Trial:
    """What is known of the connections of one path."""

    def __init__(self, words: list[str]) -> None:
        self.words = words
        self.sides: list[str] = []
        self.held: dict[str, list[Message]] = defaultdict(list)
        self.seen: list[str] = []


def changed(trial: Trial, message: Message) -> list[Message]:
    """The last bit of a message is another one."""
    body = bytearray.fromhex(message["body"])
    body[-1] ^= 1
    return [message | {"body": body.hex()}]


RULES: dict[str, Callable[[Trial, Message], list[Message]]] = {"drop": lambda trial, message: [], "changed": changed}
"""What arrives instead of a message of the phase and to the host that the path names ("both" for either)."""


def arriving(trial: Trial, to: str, message: Message) -> list[Message]:
    rule, phase, whom = (*trial.words, "", "", "")[:3]
    if rule in RULES and whom in (to, "both") and message["phase"] == phase:
        return RULES[rule](trial, message)
    return [message]


class MaliciousMailbox:
    """The server, in a thread of its own.

    Args:
        real: URL of the real mailbox server.
    """

    def __init__(self, real: str) -> None:
        self._real = real
        self._trials: dict[str, Trial] = {}
        self._loop = asyncio.new_event_loop()
        self._is_ready = threading.Event()
        self._thread = threading.Thread(target=lambda: self._loop.run_until_complete(self._main()), daemon=True)

    def url(self, rule: str, token: object) -> str:
        return f"ws://127.0.0.1:{self._port}/{rule}/{token}"

    def trial(self, url: str) -> Trial:
        return self._trials["/" + url.split("/", 3)[3]]

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._is_ready.wait(10)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join(10)

    async def _main(self) -> None:
        self._end = asyncio.Event()
        async with serve(self._meet, "127.0.0.1", 0, close_timeout=0.1) as server:
            self._port = server.sockets[0].getsockname()[1]
            self._is_ready.set()
            await self._end.wait()
            for connection in server.connections:
                connection.transport.abort()

    async def _meet(self, client: ServerConnection) -> None:
        assert client.request is not None
        path = client.request.path
        trial = self._trials.setdefault(path, Trial(path.strip("/").split("/")))
        async with connect(self._real, close_timeout=0.1) as server:
            bound = json.loads(await client.recv())  # the first message, which names the host's side
            await server.send(json.dumps(bound))
            if bound["side"] not in trial.sides:
                trial.sides.append(bound["side"])
            up = asyncio.create_task(self._up(trial, client, server))
            with suppress(ConnectionClosed):
                await self._down(trial, bound["side"], client, server)
            up.cancel()

    async def _up(self, trial: Trial, client: ServerConnection, server: ClientConnection) -> None:
        """What a host sends; a third host of the rule "recorded" is given what the first one got."""
        with suppress(ConnectionClosed):
            async for text in client:
                trial.seen.append(str(text))
                await server.send(text)
                if json.loads(text)["type"] == "open" and trial.words[0] == "recorded" and len(trial.sides) == 3:
                    for old in trial.held["slave"]:
                        await client.send(json.dumps(old))
        await server.close()

    async def _down(self, trial: Trial, own: str, client: ServerConnection, server: ClientConnection) -> None:
        """What the server sends to the host of the side `own`."""
        order = trial.sides.index(own)
        to = ROLES[order % 2]
        async for text in server:
            message = json.loads(text)
            is_of_peer = message["type"] == "message" and message["side"] != own
            if is_of_peer:
                trial.held[to].append(message)
            for one in arriving(trial, to, message) if is_of_peer else [message]:
                await client.send(json.dumps(one))
