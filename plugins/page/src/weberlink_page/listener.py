"""The monitor's end of the front (`weberlink_page.front`): takes connections that it passes on, hears of stops."""

import asyncio
import json
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from operator import methodcaller
from typing import Any

from weberlink.child_process import Child, python
from weberlink_page.front import CONNECTION, STOPPED, Crowd, FrontOrder

LONGEST_MESSAGE = 64
END_S = 1.0


class Listener:
    """Takes connections until it is closed.

    Args:
        serve: makes the protocol of a connection in this loop.
        unproven: connections that have not shown the key of the page.
        stopped: called with the moment of each stop that the front has passed on, on `time.monotonic` [s].
    """

    def __init__(
        self,
        listening: socket.socket,
        serve: Callable[[], asyncio.BaseProtocol],
        unproven: Crowd[asyncio.Transport],
        order: FrontOrder,
        stopped: Callable[[float], None],
        tell: Callable[[str], None],
    ) -> None:
        self._listening, self._serve, self._unproven, self._order = listening, serve, unproven, order
        self._stopped, self._tell = stopped, tell
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()
        self._start()

    def close(self) -> None:
        self._loop.remove_reader(self._channel)
        self._channel.close()  # which ends it
        self._front.end(END_S)
        self._listening.close()

    def _start(self) -> None:
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            given = [self._listening.fileno(), theirs.fileno()]
            self._front = Child(python("-m", "weberlink_page.front", *map(str, given)), pass_fds=given)
        self._channel.send(json.dumps(asdict(self._order)).encode())  # not an argument: others could read the token
        self._channel.setblocking(False)
        self._loop.add_reader(self._channel, self._on_message)

    def _on_message(self) -> None:
        try:
            message, descriptors, _, _ = socket.recv_fds(self._channel, LONGEST_MESSAGE, 1)
        except BlockingIOError:
            return
        except OSError:
            message, descriptors = b"", []
        if message == CONNECTION:
            for descriptor in descriptors:
                connection = socket.socket(fileno=descriptor)
                connection.setblocking(False)
                task = self._loop.create_task(self._take(connection))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        elif message.startswith(STOPPED):
            self._stopped(float(message.removeprefix(STOPPED)))
        else:
            self._again()

    def _again(self) -> None:
        """The front has ended, which it does at no request: without it no page could stop a session."""
        self._loop.remove_reader(self._channel)
        self._channel.close()
        self._front.end(END_S)
        self._tell(f"the process that takes connections {self._front.how_it_ended}; it is started again")
        self._start()

    async def _take(self, connection: socket.socket) -> None:
        with suppress(OSError):  # it has ended meanwhile
            host, *_ = connection.getpeername()
            transport, _ = await self._loop.connect_accepted_socket(self._serve, connection)
            self._unproven.forget(methodcaller("is_closing"))
            if (evicted := self._unproven.add(transport, host)) is not None:
                evicted.abort()
