"""A client of the Foxglove WebSocket protocol that reads in a thread."""

import json
from collections import defaultdict
from contextlib import suppress
from threading import Thread
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.wait import until

HEAD = 13  # bytes before a message: kind, subscription and log time


class FoxgloveClient:
    """Subscribes to all topics of a server on this host, and keeps what it is sent."""

    def __init__(self, port: int) -> None:
        self.types: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.messages: dict[str, list[bytes]] = defaultdict(list)
        self.told: list[dict[str, Any]] = []
        self._names: dict[int, str] = {}
        self._socket = connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True)  # type: ignore[list-item]
        self._thread = Thread(target=self._read, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._socket.close()
        self._thread.join()

    def answer(self, op: str, to: str, **content: Any) -> dict[str, Any]:
        known = len(self.told)
        self._socket.send(json.dumps({"op": op, **content}))
        return until(lambda: next((each for each in self.told[known:] if each["op"] == to), {}), to)

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._socket:
                if isinstance(message, bytes):
                    self.messages[self._names[int.from_bytes(message[1:5], "little")]].append(message[HEAD:])
                else:
                    self._take(json.loads(message))

    def _take(self, document: dict[str, Any]) -> None:
        for channel in document.get("channels", ()):
            self.types[channel["topic"]] = channel["schemaName"]
            self.schemas[channel["topic"]] = channel["schema"]
            self._names[channel["id"]] = channel["topic"]
            wish = [{"id": channel["id"], "channelId": channel["id"]}]
            self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wish}))
        self.told.append(document)
