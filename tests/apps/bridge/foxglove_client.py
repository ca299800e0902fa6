"""A client of the Foxglove WebSocket protocol that reads in a thread, for tests of the live view."""

import json
from collections import defaultdict
from threading import Thread
from types import TracebackType
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.wait import until

HEAD = 13
"""Bytes before a message: kind, subscription and log time."""


class FoxgloveClient:
    """Subscribes to topics, and keeps what it is sent.

    Args:
        port: of the server on this host.
        topics: to subscribe to; None for all.
    """

    def __init__(self, port: int, topics: set[str] | None = None) -> None:
        self.types: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.messages: dict[str, list[bytes]] = defaultdict(list)
        self.told: list[dict[str, Any]] = []
        self._topics, self._names = topics, dict[int, str]()
        self._socket = connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True)  # type: ignore[list-item]
        self._thread = Thread(target=self._read, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._socket.close()
        self._thread.join()

    def send(self, op: str, **content: Any) -> None:
        self._socket.send(json.dumps({"op": op, **content}))

    def answer(self, op: str, to: str, **content: Any) -> dict[str, Any]:
        """Send something, and wait for what it brings."""
        known = len(self.told)
        self.send(op, **content)
        return until(lambda: next((each for each in self.told[known:] if each["op"] == to), {}), to)

    def set(self, name: str, value: object) -> Any:
        """Set a parameter; returns its value after that."""
        told = self.answer("setParameters", "parameterValues", parameters=[{"name": name, "value": value}], id="set")
        return told["parameters"][0]["value"]

    def _read(self) -> None:
        try:
            for message in self._socket:
                if isinstance(message, bytes):
                    self.messages[self._names[int.from_bytes(message[1:5], "little")]].append(message[HEAD:])
                else:
                    self._take(json.loads(message))
        except ConnectionClosed:
            pass

    def _take(self, document: dict[str, Any]) -> None:
        if document["op"] == "advertise":
            for channel in document["channels"]:
                self.types[channel["topic"]] = channel["schemaName"]
                self.schemas[channel["topic"]] = channel["schema"]
                if self._topics is None or channel["topic"] in self._topics:
                    self._names[channel["id"]] = channel["topic"]
                    self.send("subscribe", subscriptions=[{"id": channel["id"], "channelId": channel["id"]}])
        self.told.append(document)
