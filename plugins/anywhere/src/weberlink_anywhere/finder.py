"""The process that finds paths to known peers, and hands their sockets to the daemon that started it.

    python -m weberlink_anywhere.finder ORDER DESCRIPTOR

ORDER is a `FinderOrder` in JSON, DESCRIPTOR the number of an open socket to the daemon
(`weberlink_anywhere.hand_over`). The process ends when that socket is closed at the other end.
"""

import asyncio
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from socket import socket
from typing import Protocol

from weberlink.protocol.keys import KeyFileError
from weberlink.realtime.process import conceal_memory
from weberlink_anywhere import hand_over
from weberlink_anywhere.master_finder import MasterFinder
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.paths import Paths, ServerNames
from weberlink_anywhere.peers import PeerError, PeerStore
from weberlink_anywhere.rendezvous import Caller
from weberlink_anywhere.slave_finder import SlaveFinder
from weberlink_anywhere.sockets import SocketLoop

FAREWELL_S = 1.0
"""For telling the relays that their addresses are free."""


class Policy(Protocol):
    """What one side does: `MasterFinder` or `SlaveFinder`."""

    async def run(self) -> None: ...

    def hear(self, state: hand_over.SessionState) -> None: ...


class DaemonEnd:
    """The socket to the daemon, which does not block."""

    def __init__(self, end: socket) -> None:
        self._end = end
        self.closed = asyncio.Event()

    def tell(self, message: hand_over.Message, carried: socket | None = None) -> None:
        if not hand_over.send(self._end, message, carried):
            self.closed.set()  # gone; or it has not read for so long that it might as well be

    def listen(self, paths: Paths, policy: Policy) -> None:
        """Pass on what the daemon says."""

        def read() -> None:
            with suppress(ConnectionError):
                try:
                    while (received := hand_over.receive(self._end)) is not None:
                        match received[0]:
                            case hand_over.StunReceived() as message:
                                paths.deliver(message)
                            case hand_over.PathSilent(number):
                                paths.give_up(number)
                            case hand_over.SessionState() as state:
                                policy.hear(state)
                except BlockingIOError:
                    return
            asyncio.get_running_loop().remove_reader(self._end)
            self.closed.set()

        asyncio.get_running_loop().add_reader(self._end, read)


async def find(order: FinderOrder, end: socket) -> None:
    """Find paths until the daemon closes its end."""
    daemon = DaemonEnd(end)
    try:
        store = PeerStore(Path(order.store))
        paths = Paths(order, ServerNames(order, order.own), daemon.tell)
        policy: Policy
        if order.side == "master":
            peer = store.find(*order.peers).for_stream(order.stream)
            policy = MasterFinder(order, peer, Caller(peer, order.mailbox), paths)
        else:
            policy = SlaveFinder(order, store, paths)
    except (PeerError, KeyFileError) as problem:
        daemon.tell(hand_over.PathNews.of(order.peers[0] if order.peers else "", str(problem), True))
        return
    daemon.listen(paths, policy)
    running = asyncio.create_task(policy.run())
    ended = asyncio.create_task(daemon.closed.wait())
    try:
        await asyncio.wait({running, ended}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        running.cancel()
        ended.cancel()
        with suppress(asyncio.CancelledError):
            await running  # its own fault ends this process, and is written to stderr
    with suppress(TimeoutError):
        await asyncio.wait_for(paths.close(), FAREWELL_S)


def main(arguments: Sequence[str]) -> None:
    text, descriptor = arguments
    conceal_memory()
    with socket(fileno=int(descriptor)) as end, asyncio.Runner(loop_factory=SocketLoop) as runner:
        end.setblocking(False)
        os.set_inheritable(end.fileno(), False)
        runner.run(find(FinderOrder.from_json(text), end))


if __name__ == "__main__":
    main(sys.argv[1:])
