"""Two endpoints on found paths, with a stand-in for the processes that find them; all sockets are real."""

import asyncio
import socket
from collections.abc import Callable
from functools import partial
from time import monotonic

from tests.protocol.harness import forms, make_endpoint, sample_update
from tests.wait import soon
from weberlink.protocol import Connected, Endpoint, Event, Role, State, UpdateReceived
from weberlink.protocol.aio import UdpShell
from weberlink.protocol.aio.udp import peer_address
from weberlink.protocol.events import Address
from weberlink_anywhere import hand_over
from weberlink_anywhere.found_paths import FoundPaths
from weberlink_anywhere.hand_over import PathFound

OPERATOR, ROBOT = "operator", "robot"
HOST = "127.0.0.1"


class End:
    """An endpoint with its shell, and the finder's end of the socket between them."""

    def __init__(self, role: Role, **changes: object) -> None:
        is_master = role is Role.INITIATOR
        self.peer = ROBOT if is_master else OPERATOR
        settings = {
            "epoch": monotonic(),
            "outgoing": (forms(3),),
            "incoming": (forms(3),),
            "silence": 4.0,
            "name": OPERATOR if is_master else ROBOT,
            "peer": peer_address(ROBOT) if is_master else None,
        }
        self.endpoint: Endpoint = make_endpoint(role, **(settings | changes))
        ours, self.finder = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        self.finder.setblocking(False)
        self.ours = ours
        self.complaints: list[str] = []
        self.events: list[Event] = []
        self.shell = UdpShell(
            self.endpoint,
            now=monotonic,
            dscp=46,
            paths=partial(FoundPaths, finder=ours),
            on_no_path=self.complaints.append,
        )

    async def open(self) -> None:
        await self.shell.open(asyncio.get_running_loop())
        self.endpoint.connect(monotonic())
        self.shell.flush(monotonic())

    def find(self, bound: socket.socket, found: PathFound) -> None:
        """Hand a path over, as the finder does; the socket is closed here."""
        with bound:
            assert hand_over.send(self.finder, found, bound)

    def of(self, kind: type[Event]) -> list[Event]:
        while (event := self.endpoint.next_event()) is not None:
            self.events.append(event)
        return [event for event in self.events if isinstance(event, kind)]

    def ticks(self) -> list[int]:
        """Of the updates that were received."""
        return [event.update.tick for event in self.of(UpdateReceived) if isinstance(event, UpdateReceived)]

    def told(self) -> list[hand_over.Message]:
        """What the finder has heard since the last call."""
        messages = []
        try:
            while (received := hand_over.receive(self.finder)) is not None:
                messages.append(received[0])
        except BlockingIOError:
            pass
        return messages

    def close(self) -> None:
        self.shell.close()
        self.finder.close()
        self.ours.close()


class Middle:
    """What is between two hosts: forwards datagrams from a port for each of them; can be cut, and changes ports.

    Attributes:
        towards: the address to which each end sends, master first.
        is_repeating: whether every datagram is forwarded twice.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._ports = [self._port(0), self._port(1)]
        self._ends: list[Address | None] = [None, None]
        self.is_up = True
        self.is_repeating = False

    @property
    def towards(self) -> tuple[Address, Address]:
        first, second = (port.getsockname() for port in self._ports)
        return first, second

    def join(self, master: Address, slave: Address) -> None:
        self._ends = [master, slave]

    def change_port(self) -> None:
        """Reach the slave from another port, as a NAT that has lost its mapping; the old one is closed."""
        self._loop.remove_reader(self._ports[1].fileno())
        self._ports[1].close()
        self._ports[1] = self._port(1)

    def _port(self, index: int) -> socket.socket:
        port = bound_socket()
        port.setblocking(False)
        self._loop.add_reader(port.fileno(), self._forward, index)
        return port

    def _forward(self, index: int) -> None:
        """Take what one end has sent, and send it to the other from the port that the other knows."""
        try:
            data = self._ports[index].recv(5000)
        except BlockingIOError:
            return
        target = self._ends[1 - index]
        if self.is_up and target is not None:
            for _ in range(1 + self.is_repeating):
                self._ports[1 - index].sendto(data, target)

    def close(self) -> None:
        for port in self._ports:
            self._loop.remove_reader(port.fileno())
            port.close()


def bound_socket(host: str = HOST) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.bind((host, 0))
    return bound


def connect(master: End, slave: End, number: int = 1, place: int = 0, middle: Middle | None = None) -> None:
    """Find a path between two ends, straight or through a middle."""
    sockets = bound_socket(), bound_socket()
    addresses = sockets[0].getsockname(), sockets[1].getsockname()
    remotes = addresses[1], addresses[0]
    if middle is not None:
        middle.join(*addresses)
        remotes = middle.towards
    for end, bound, remote in zip((master, slave), sockets, remotes, strict=True):
        end.find(bound, PathFound(number, place, end.peer, remote, route="punched", interface="lo"))


async def engage(master: End, slave: End) -> None:
    await soon(lambda: master.of(Connected) and slave.of(Connected), "a session", pause=0.001)
    await soon(lambda: master.endpoint.state is slave.endpoint.state is State.ENGAGED, "an engaged one", pause=0.001)


async def send_ticks(master: End, first: int, count: int, during: Callable[[int], None] = lambda tick: None) -> None:
    """Send an update in every tick of 1 ms, and call `during` before each."""
    for tick in range(first, first + count):
        during(tick)
        now = monotonic()
        master.shell.service(now)
        assert master.endpoint.send_update(now, sample_update(tick))
        master.shell.flush(now)
        await asyncio.sleep(0.001)
