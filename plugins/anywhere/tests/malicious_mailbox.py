"""A mailbox server that changes or drops messages of two hosts, in front of a real one.

The path of the URL is RULE/PHASE/TO, and a token: `ws://127.0.0.1:PORT/drop/pake/slave/7`. Connections of one path are
those of one trial, in order: first the slave, which invites, then the master.
"""

import asyncio
import json
import threading
from contextlib import suppress
from typing import Any, Self

from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

Message = dict[str, Any]


class Trial:
    """What is known of the connections of one path."""

    def __init__(self, path: str) -> None:
        self.rule, self.phase, self.whom, *_ = *path.strip("/").split("/"), "", ""
        self.sides: list[str] = []
        self.of_slave: list[Message] = []
        self.seen: list[str] = []

    def arriving(self, to: str, message: Message) -> list[Message]:
        """What arrives instead of a message to the host of the side `to`."""
        if to == "slave":
            self.of_slave.append(message)
        if (message["phase"], to) != (self.phase, self.whom) or self.rule not in ("drop", "changed"):
            return [message]
        body = bytearray.fromhex(message["body"])
        body[-1] ^= 1
        return [] if self.rule == "drop" else [message | {"body": body.hex()}]


class MaliciousMailbox:
    """The server, in a thread of its own, in front of the one with the URL `real`."""

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

    def __exit__(self, *_: object) -> None:
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
        trial = self._trials.setdefault(client.request.path, Trial(client.request.path))
        async with connect(self._real, close_timeout=0.1) as server:
            bound = json.loads(await client.recv())  # the first message, which names the host's side
            await server.send(json.dumps(bound))
            if bound["side"] not in trial.sides:
                trial.sides.append(bound["side"])
            up = asyncio.create_task(self._up(trial, client, server))
            with suppress(ConnectionClosed):
                async for text in server:
                    told, to = json.loads(text), ("slave", "master")[trial.sides.index(bound["side"]) % 2]
                    is_of_peer = told["type"] == "message" and told["side"] != bound["side"]
                    for one in trial.arriving(to, told) if is_of_peer else [told]:
                        await client.send(json.dumps(one))
            up.cancel()

    async def _up(self, trial: Trial, client: ServerConnection, server: ClientConnection) -> None:
        """What a host sends; a third host of the rule "recorded" is given what the first one got."""
        with suppress(ConnectionClosed):
            async for text in client:
                trial.seen.append(str(text))
                await server.send(text)
                if json.loads(text)["type"] == "open" and trial.rule == "recorded" and len(trial.sides) == 3:
                    for old in trial.of_slave:
                        await client.send(json.dumps(old))
        await server.close()
