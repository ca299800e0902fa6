"""Sessions over paths that another process finds, on real sockets. Time limits only bound a hang."""

import asyncio
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from itertools import count
from time import monotonic
from types import SimpleNamespace
from typing import Self

import msgpack
import pytest
import uvloop

from tests.compiled import replaces_methods
from tests.protocol.harness import forms, make_endpoint, sample_update
from tests.wait import in_loop, soon
from weberlink.protocol import Connected, Endpoint, Event, PeerSilent, Role, State, UpdateReceived
from weberlink.protocol.aio import UdpShell
from weberlink.protocol.aio.udp import PEER_SHARE, STRANGER_SHARE, peer_address
from weberlink.protocol.events import Address, DropReason
from weberlink_anywhere import hand_over
from weberlink_anywhere.found_paths import FINDER_ENDED, MOVED_PEERS, SILENT_S, STUN_BURST_S, STUN_S, FoundPaths
from weberlink_anywhere.hand_over import PathFound, PathLost, PathNews, PathSilent, SessionState, StunReceived

OPERATOR, ROBOT, HOST = "operator", "robot", "127.0.0.1"
NONSENSE = [b"x", bytes(5000), msgpack.packb([2, ROBOT, "x" * 5000, True]), msgpack.packb([0, 1, 0]), b"\xc1" * 40]
STUN = b"\x00\x01\x00\x00" + hand_over.STUN_COOKIE + bytes(12)  # A binding request without attributes
CHANNEL = 0x4001


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
        self.ours, self.finder = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for each in (self.ours, self.finder):
            each.setblocking(False)
        self.complaints: list[str] = []
        self.events: list[Event] = []
        self.shell = UdpShell(
            self.endpoint,
            now=monotonic,
            dscp=46,
            paths=partial(FoundPaths, finder=self.ours),
            on_no_path=self.complaints.append,
        )

    async def __aenter__(self) -> Self:
        await self.shell.open(asyncio.get_running_loop())
        self.endpoint.connect(monotonic())
        self.shell.flush(monotonic())
        return self

    def find(self, bound: socket.socket, found: PathFound) -> None:
        with bound:
            assert hand_over.send(self.finder, found, bound)

    def of(self, kind: type[Event]) -> list[Event]:
        while (event := self.endpoint.next_event()) is not None:
            self.events.append(event)
        return [event for event in self.events if isinstance(event, kind)]

    def ticks(self) -> list[int]:
        return [event.update.tick for event in self.of(UpdateReceived) if isinstance(event, UpdateReceived)]

    def told(self) -> list[hand_over.Message]:
        """What the finder has heard since the last call."""
        messages = []
        with suppress(BlockingIOError):
            while (received := hand_over.receive(self.finder)) is not None:
                messages.append(received[0])
        return messages

    async def __aexit__(self, *_: object) -> None:
        for each in (self.shell, self.finder, self.ours):
            each.close()


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
        data, target = self._ports[index].recv(5000), self._ends[1 - index]
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
    for tick in range(first, first + count):
        during(tick)
        now = monotonic()
        master.shell.service(now)
        assert master.endpoint.send_update(now, sample_update(tick))
        master.shell.flush(now)
        await asyncio.sleep(0.001)


Main = Callable[[End, End], Awaitable[None]]


def live(main: Main | None = None, **changes: object) -> Callable[..., None]:
    """Make a test of a coroutine that is given a master and a slave, whose endpoints have the `changes`."""
    if main is None:
        return partial(live, **changes)  # type: ignore[return-value]
    body: Main = main

    async def whole() -> None:
        async with End(Role.RESPONDER, **changes) as slave, End(Role.INITIATOR, **changes) as master:
            await body(master, slave)

    return in_loop(whole, uvloop.new_event_loop)


async def until(condition: Callable[[], object]) -> None:
    await soon(condition, "what must come", pause=0.001)


@asynccontextmanager
async def over(master: End, slave: End, count: int) -> AsyncIterator[list[Middle]]:
    """Both ends engaged over paths, and what is in the middle of each."""
    middles = [Middle() for _ in range(count)]
    try:
        for place, middle in enumerate(middles):
            connect(master, slave, place + 1, place, middle)
        await engage(master, slave)
        await until(lambda: len(master.shell.paths) == len(slave.shell.paths) == count)
        yield middles
    finally:
        for middle in middles:
            middle.close()


async def all_arrived(slave: End, count: int) -> None:
    """Wait for the updates of ticks 1 to `count`; one that a newer one has overtaken on another path counts."""
    await until(lambda: slave.ticks()[-1:] == [count])
    ticks = slave.ticks()
    assert ticks == sorted(ticks)
    assert count - len(ticks) <= slave.endpoint.statistics.dropped[DropReason.SUPERSEDED]


@live
async def test_ends_that_change_paths_apart_lose_nothing(master: End, slave: End) -> None:
    """The master sends on the new path while the slave's finder still holds it, and the other way round."""
    assert master.endpoint.state is State.CONNECTING
    assert [(facts.route, facts.note) for facts in master.shell.paths] == [("", "finding a path")]
    connect(master, slave)
    await engage(master, slave)
    (facts,) = master.shell.paths
    assert (*facts[:4], facts.changes, facts.note) == (0, "punched", "", "lo", 0, "")
    await until(lambda: master.shell.paths[0].dscp == slave.shell.paths[0].dscp == 46)
    sockets = bound_socket(), bound_socket()
    addresses = [each.getsockname() for each in sockets]

    def replace(tick: int) -> None:
        if tick == 20:
            master.find(sockets[0], PathFound(2, 0, ROBOT, addresses[1]))
        elif tick == 60:
            slave.find(sockets[1], PathFound(2, 0, OPERATOR, addresses[0]))

    await send_ticks(master, 1, 100, replace)
    await all_arrived(slave, 100)
    assert master.of(PeerSilent) == slave.of(PeerSilent) == []
    assert slave.endpoint.statistics.copies > 0
    assert slave.endpoint.statistics.dropped[DropReason.REPLAYED] == 0
    assert len(master.of(Connected)) == len(slave.of(Connected)) == 1
    assert master.shell.paths[0].changes == slave.shell.paths[0].changes == 1
    assert SessionState(ROBOT, hand_over.ENGAGED) in master.told()
    assert SessionState(OPERATOR, hand_over.ENGAGED) in slave.told()


@live
async def test_one_of_two_paths_cut_misses_no_update(master: End, slave: End) -> None:
    async with over(master, slave, 2) as middles:

        def cut(tick: int) -> None:
            middles[0].is_up, middles[1].is_up = not 20 <= tick < 50, not 60 <= tick < 90

        await send_ticks(master, 1, 100, cut)
        await all_arrived(slave, 100)
        assert master.of(PeerSilent) == slave.of(PeerSilent) == []
        assert [facts.place for facts in slave.shell.paths] == [0, 1]
        statistics = slave.endpoint.statistics
        assert statistics.copies > 30
        assert statistics.dropped[DropReason.REPLAYED] == 0
        middles[0].is_repeating = True  # on its own path, a copy is a replay
        await send_ticks(master, 101, 50)
        await all_arrived(slave, 150)
        assert statistics.dropped[DropReason.REPLAYED] > 0


@live
async def test_finder_is_told_of_one_silent_path(master: End, slave: End) -> None:
    async with over(master, slave, 2) as middles:
        middles[1].is_up = False
        began = monotonic()
        for end in (master, slave):
            told: list[hand_over.Message] = []
            await until(lambda end=end, told=told: told.extend(end.told()) or PathSilent(2) in told)  # type: ignore[misc]
            assert PathSilent(1) not in told
        assert monotonic() - began > SILENT_S - 0.1
        assert master.endpoint.state is slave.endpoint.state is State.ENGAGED


@live(silence=0.1)
async def test_ends_engage_on_a_new_path_after_a_cut(master: End, slave: End) -> None:
    async with over(master, slave, 1) as (middle,):
        middle.is_up = False
        await until(lambda: master.of(PeerSilent) and slave.of(PeerSilent))
        connect(master, slave, number=2)
        await until(lambda: master.endpoint.state is slave.endpoint.state is State.ENGAGED)
        states = [message.state for message in master.told() if isinstance(message, SessionState)]
        assert states[:3] == [hand_over.ENGAGED, hand_over.SILENT, hand_over.ENGAGED]
        assert [facts.changes for facts in master.shell.paths] == [1]


@live
async def test_lost_mapping_of_a_nat_is_followed(master: End, slave: End) -> None:
    """The slave hears the master from another port, validates it, and sends there through the same socket."""
    async with over(master, slave, 1) as (middle,):
        before = master.endpoint.statistics.received

        def change(tick: int) -> None:
            if tick == 10:
                middle.change_port()

        await send_ticks(master, 1, 50, change)
        followed = "{}:{}".format(*middle.towards[1]), peer_address(OPERATOR)
        for tick in count(51):  # what comes in a burst from an address that is not validated yet may be dropped
            if (slave.shell.paths[0].remote, slave.endpoint.peer) == followed and slave.ticks()[-1] > 50:
                break
            await send_ticks(master, tick, 1)
        assert slave.shell.paths[0].changes == 1
        assert master.endpoint.statistics.received > before
        assert master.endpoint.state is slave.endpoint.state is State.ENGAGED
        assert len(slave.of(Connected)) == 1


@replaces_methods
def test_the_addresses_that_were_answered_last_are_remembered() -> None:
    """An answer to one of them leaves through the socket that heard it; one that was not answered is not remembered."""
    endpoint, sent = make_endpoint(Role.RESPONDER), []

    def receive(data: bytes, source: Address, now: float) -> None:
        endpoint.statistics.sent += len(data)

    stand_in = SimpleNamespace(role=Role.RESPONDER, peer=None, statistics=endpoint.statistics, receive_datagram=receive)
    path = SimpleNamespace(is_open=True, send_to=lambda data, address: sent.append(address))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        paths = FoundPaths(SimpleNamespace(endpoint=stand_in), finder=ours)  # type: ignore[arg-type]
        addresses = [("192.0.2.1", port) for port in range(1, MOVED_PEERS + 3)]
        for address in (*addresses[:MOVED_PEERS], addresses[0], *addresses[MOVED_PEERS:]):
            paths.take_from_elsewhere(b"call", address, 0.0, path)  # type: ignore[arg-type]
        for port in range(2 * MOVED_PEERS):
            paths.take_from_elsewhere(b"", ("203.0.113.9", port), 0.0, path)  # type: ignore[arg-type]
        for address in (*addresses, ("203.0.113.9", 1)):
            paths.send(b"answer", address)
        path.is_open = False
        paths.send(b"answer", addresses[-1])
    assert sent == [addresses[0], *addresses[3:]]


@live
async def test_stun_of_the_peer_goes_to_the_finder(master: End, slave: End) -> None:
    bound, peer = bound_socket(), bound_socket()
    address, source = bound.getsockname(), peer.getsockname()
    slave.find(bound, PathFound(7, 0, OPERATOR, source))
    with peer:
        await until(lambda: slave.shell.paths[0].route)
        peer.sendto(STUN, address)
        messages = await soon(slave.told, "the message", pause=0.001)
        assert messages == [StunReceived(7, source, STUN)]
        assert slave.endpoint.statistics.drops == 0
        peer.sendto(b"\x00\x01\x00\x00" + bytes(16), address)  # without the cookie it is a datagram like any other
        await until(lambda: slave.endpoint.statistics.drops == 1)


@pytest.mark.parametrize("is_peer", [False, True])
def test_flood_of_stun_is_passed_on_within_a_limit(is_peer: bool) -> None:
    @live
    async def flood(master: End, slave: End) -> None:
        bound, peer, stranger = bound_socket(), bound_socket(), bound_socket()
        address = bound.getsockname()
        slave.find(bound, PathFound(1, 0, OPERATOR, peer.getsockname()))
        await until(lambda: slave.shell.paths[0].route)
        began = monotonic()
        with peer, stranger:
            sender = peer if is_peer else stranger
            sender.sendto(STUN + bytes(1481), address)  # too long to be one
            for _ in range(1000):
                sender.sendto(STUN, address)
            await asyncio.sleep(0.1)
            passed = [message for message in slave.told() if isinstance(message, StunReceived)]
            assert {message.source for message in passed} == {sender.getsockname()}
        share = PEER_SHARE if is_peer else STRANGER_SHARE
        assert 1 <= len(passed) <= (STUN_BURST_S + share * (monotonic() - began)) / STUN_S + 1
        assert {len(message.data) for message in passed} == {len(STUN)}

    flood()


@live
async def test_datagrams_of_a_relay_carry_its_channel(master: End, slave: End) -> None:
    """The relay of this test strips the header of what the master sends, and adds it to what the slave sends."""
    head = CHANNEL.to_bytes(2, "big")
    inner, outer = bound_socket(), bound_socket()
    sockets = bound_socket(), bound_socket()
    addresses = [each.getsockname() for each in sockets]
    seen: list[bytes] = []

    def strip() -> None:
        data = inner.recv(5000)
        seen.append(data[:4])
        outer.sendto(data[4 : 4 + int.from_bytes(data[2:4], "big")], addresses[1])

    def wrap() -> None:
        data = outer.recv(5000)
        inner.sendto(b"\x40\x02" + data[:9], addresses[0])  # of a channel that is not that of the path
        inner.sendto(head + len(data).to_bytes(2, "big") + data + b"\0", addresses[0])

    with inner, outer:
        asyncio.get_running_loop().add_reader(inner.fileno(), strip)
        asyncio.get_running_loop().add_reader(outer.fileno(), wrap)
        found = PathFound(1, 0, ROBOT, inner.getsockname(), CHANNEL, route="relayed", via="home relay")
        master.find(sockets[0], found)
        slave.find(sockets[1], PathFound(1, 0, OPERATOR, outer.getsockname()))
        await engage(master, slave)
        assert {header[:2] for header in seen} == {head}
        assert master.endpoint.statistics.drops == 0
        assert master.shell.paths[0][1:3] == ("relayed", "home relay")
        wrapped = head + len(STUN).to_bytes(2, "big") + STUN
        master.told()
        inner.sendto(wrapped, addresses[0])
        messages = await soon(master.told, "the message", pause=0.001)
        assert messages == [StunReceived(1, inner.getsockname(), wrapped)]
        for each in (inner, outer):
            asyncio.get_running_loop().remove_reader(each.fileno())


@live
async def test_messages_that_are_none_are_counted_and_change_nothing(master: End, slave: End) -> None:
    connect(master, slave)
    await engage(master, slave)
    for nonsense in NONSENSE:
        master.finder.send(nonsense)
    assert hand_over.send(master.finder, PathNews(ROBOT, "heard"))
    await until(lambda: master.shell.paths[0].note == "heard")
    statistics = master.endpoint.statistics
    assert statistics.dropped == {DropReason.UNREADABLE: len(NONSENSE)}
    assert statistics.drops == len(NONSENSE)
    await send_ticks(master, 1, 20)
    await all_arrived(slave, 20)


@live(silence=0.1)
async def test_a_lost_path_carries_nothing_more_and_final_news_end_a_call_alone(master: End, slave: End) -> None:
    assert hand_over.send(slave.finder, PathNews(OPERATOR, "UDP is blocked", is_final=True))
    connect(master, slave)
    await engage(master, slave)
    assert hand_over.send(master.finder, PathNews(ROBOT, "the mailbox cannot be reached", is_final=True))
    for end in (master, slave):
        assert hand_over.send(end.finder, PathLost(1))
    await until(lambda: master.of(PeerSilent) and slave.of(PeerSilent))
    assert master.shell.paths[0][1::5] == ("", "the mailbox cannot be reached")
    assert master.complaints == slave.complaints == []  # the slave waits for the next call


@live
async def test_a_call_without_a_path_ends_with_what_the_finder_said(master: End, slave: End) -> None:
    assert hand_over.send(master.finder, PathNews(ROBOT, "UDP is blocked", is_final=True))
    slave.finder.close()
    await until(lambda: master.complaints and slave.complaints)
    assert (master.complaints, slave.complaints) == (["UDP is blocked"], [FINDER_ENDED])
    master.finder.close()
    await asyncio.sleep(0.02)
    assert len(master.complaints) == 1


@live
async def test_session_outlives_the_finder_and_no_other_follows(master: End, slave: End) -> None:
    connect(master, slave)
    await engage(master, slave)
    slave.finder.close()
    await send_ticks(master, 1, 30)
    await all_arrived(slave, 30)
    assert slave.complaints == []
    master.endpoint.close(monotonic(), "completed")
    master.shell.flush(monotonic())
    await until(lambda: slave.complaints)
    assert slave.complaints == [FINDER_ENDED]


@live
async def test_all_sockets_are_closed(master: End, slave: End) -> None:
    for number in range(1, 5):
        connect(master, slave, number)
    await engage(master, slave)
    ports = [int(end.shell.paths[0].remote.rpartition(":")[2]) for end in (master, slave)]
    for end in (master, slave):
        end.shell.close()
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
            again.bind(("127.0.0.1", port))


@pytest.mark.parametrize(
    "data",
    [b"", b"\x00", STUN[:7], b"\x04" + STUN[1:], b"\x40\x01\x00\x14" + STUN, bytes(40)],
    ids=["empty", "short", "cut", "first_byte", "in_a_channel", "zeros"],
)
def test_other_datagrams_are_no_stun(data: bytes) -> None:
    assert not hand_over.is_stun(data)
    assert hand_over.is_stun(STUN)
