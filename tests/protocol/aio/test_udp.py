"""The shell on real sockets of this host, with the real event loop. Time limits only bound a hang."""

import asyncio
import socket
from collections.abc import Awaitable, Callable, Iterator
from functools import partial, wraps
from random import Random
from time import monotonic
from typing import Any

import pytest
import uvloop

from tests.protocol.harness import forms, make_endpoint, sample_update
from tests.wait import in_loop, soon
from weberlink.protocol import Connected, Endpoint, Event, PeerClosed, PeerSilent, Role, State, UpdateReceived
from weberlink.protocol.aio import AddressInUseError, UdpShell
from weberlink.protocol.aio.sockets import MOST_S, address_of, name_of, resolve
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address

ANY: Address = ("127.0.0.1", 0)
SHELLS: list[UdpShell] = []


def live(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Make a test of a coroutine, in an event loop of its own; the shells that it made are closed at the end."""

    @partial(in_loop, loop_factory=uvloop.new_event_loop)
    @wraps(test)
    async def closing(**fixtures: Any) -> None:
        try:
            await test(**fixtures)
        finally:
            while SHELLS:
                SHELLS.pop().close()

    return closing


def shell_of(endpoint: Endpoint, **arguments: Any) -> UdpShell:
    SHELLS.append(UdpShell(endpoint, **{"now": monotonic, **arguments}))
    return SHELLS[-1]


def make(role: Role, **changes: object) -> Endpoint:
    settings = {"silence": 2.0} | changes
    return make_endpoint(role, epoch=monotonic(), outgoing=(forms(3),), incoming=(forms(3),), **settings)


async def until(endpoint: Endpoint, kind: type[Event]) -> Event:
    """Wait for an event of a kind; the endpoint is driven by its socket and timers alone."""
    return await soon(
        lambda: next((event for event in events(endpoint) if isinstance(event, kind)), None), kind.__name__
    )


def events(endpoint: Endpoint) -> Iterator[Event]:
    while (event := endpoint.next_event()) is not None:
        yield event


def comes(condition: Callable[[], bool]) -> Awaitable[bool]:
    return soon(condition, "what must come", pause=0.001)


async def opened(peer: Address | None = None, silence: float = 2.0, **arguments: Any) -> tuple[UdpShell, Endpoint]:
    """A master that calls its peer, or a slave."""
    endpoint = make(Role.RESPONDER if peer is None else Role.INITIATOR, peer=peer, silence=silence)
    shell = shell_of(endpoint, **({"listen": ANY} if peer is None else {}) | arguments)
    await shell.open(asyncio.get_running_loop())
    endpoint.connect(monotonic())
    shell.flush(monotonic())
    return shell, endpoint


async def engage(
    link: EmulatedLink[Address] | None = None, host: str = "127.0.0.1", *, silence: float = 2.0, **of_slave: Any
) -> tuple[UdpShell, Endpoint, UdpShell, Endpoint]:
    slave_shell, slave = await opened(None, silence, **of_slave)
    peer = (host, slave_shell.address[1])
    master_shell, master = await opened(peer, silence, link=link)
    assert (await until(master, Connected)).address == peer  # type: ignore[attr-defined]
    await until(slave, Connected)
    return master_shell, master, slave_shell, slave


@pytest.mark.parametrize(
    ("called", "listens"), [("127.0.0.1", "127.0.0.1"), ("localhost", "127.0.0.1"), ("127.0.0.2", "0.0.0.0")]
)
@live
async def test_two_shells_connect_exchange_updates_and_part(called: str, listens: str) -> None:
    """By a name, which is kept in events; a slave on all addresses answers from the one that was called."""
    master_shell, master, slave_shell, slave = await engage(host=called, listen=(listens, 0))
    for tick in range(20):
        now = monotonic()
        for shell in (master_shell, slave_shell):
            shell.service(now)
        assert master.send_update(now, sample_update(tick))
        master_shell.flush(now)
        # One that a busy machine acknowledges late is repeated, and comes again before the next.
        while (await until(slave, UpdateReceived)).update != sample_update(tick):  # type: ignore[attr-defined]
            assert master.statistics.repeats > 0
    slave.close(monotonic(), "slave: done")
    assert await until(master, PeerClosed) == PeerClosed("slave: done")


@pytest.mark.parametrize(
    ("name", "address"),
    [
        (("fe80::1%eth0", 5, 0, 3), ("fe80::1%3", 5)), (("fe80::1", 5, 0, 3), ("fe80::1%3", 5)),
        (("::1", 5, 0, 0), ("::1", 5)), (("127.0.0.1", 5), ("127.0.0.1", 5)),
    ],
)  # fmt: skip
def test_a_link_local_address_keeps_its_zone(name: Any, address: Address) -> None:
    """Of a direct cable: the system takes it with its zone only, to bind, to connect and to answer."""
    assert address_of(name) == address
    assert name_of(address) == (("fe80::1", 5, 0, 3) if "%" in address[0] else address)


@pytest.mark.parametrize("is_under_way", [False, True])
@live
async def test_a_farewell_leaves_with_the_socket(is_under_way: bool) -> None:
    """It waits in the endpoint, or in an emulated link of ten seconds, when the shell is closed."""
    link: EmulatedLink[Address] = EmulatedLink(Emulation(), Random(1).random)
    master_shell, master, _slave_shell, slave = await engage(link=link)
    link.change(Emulation(delay_s=10.0))
    master.close(monotonic(), "master: device fault")
    if is_under_way:
        master_shell.flush(monotonic())
    master_shell.close()
    assert await until(slave, PeerClosed) == PeerClosed("master: device fault")


@live
async def test_port_in_use_is_named() -> None:
    """By another program, or by a slave in a session, which could share it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(ANY)
        _master_shell, _, slave_shell, _ = await engage()
        for address in (other.getsockname(), slave_shell.address):
            with pytest.raises(AddressInUseError, match=f"127.0.0.1:{address[1]} is in use"):
                await shell_of(make(Role.RESPONDER), listen=address).open(asyncio.get_running_loop())


@pytest.mark.parametrize(("host", "found"), [("127.0.0.1", "127.0.0.1"), ("::1", "::1"), ("", "0.0.0.0")])
def test_a_numeric_address_is_not_looked_up(host: str, found: str) -> None:
    """The threads that look names up have stacks of 32 MB, which a daemon locks in memory."""
    no_loop = asyncio.AbstractEventLoop()
    assert asyncio.run(resolve(no_loop, (host, 47), socket.AF_UNSPEC, passive=True))[1] == (found, 47)
    with pytest.raises(NotImplementedError):
        asyncio.run(resolve(no_loop, ("localhost", 47), socket.AF_UNSPEC, passive=False))


@live
async def test_wrong_addresses_are_refused_by_name() -> None:
    shell = shell_of(make(Role.INITIATOR, peer=("no.such.host.invalid", 1)))
    with pytest.raises(OSError, match=r"no\.such\.host\.invalid:1 cannot be resolved"):
        await shell.open(asyncio.get_running_loop())
    with pytest.raises(OSError, match="assign"):
        await shell_of(make(Role.RESPONDER), listen=("192.0.2.1", 0)).open(asyncio.get_running_loop())


@live
async def test_a_send_that_the_system_refuses_is_a_loss() -> None:
    """A broadcast is not permitted; to a port of nobody the answer is an error. The peer is called again."""
    broadcast = ("255.255.255.255", 9)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        plain.bind(ANY)
        nobody = plain.getsockname()
        with pytest.raises(PermissionError):
            plain.sendto(b"x", broadcast)
    for peer in (broadcast, nobody):
        _, master = await opened(peer)
        await comes(lambda told=master.statistics: told.sent >= 4)
        assert master.state is State.CONNECTING


class SlowClock:
    """`monotonic`; from `hold` on, time goes on where it was last read, and advances only by what the test adds, and
    with each datagram of an endpoint by more than a slice. A stall of this machine is then no stall of the loop."""

    STEP_S = 3e-4

    def __init__(self) -> None:
        self._now: Callable[[], float] = monotonic
        self.waited = self._last = 0.0

    def hold(self, endpoint: Endpoint) -> None:
        began, told = self._last, endpoint.statistics
        before = told.received + told.drops
        self._now = lambda: began + self.waited + self.STEP_S * (told.received + told.drops - before)

    def __call__(self) -> float:
        self._last = self._now()
        return self._last


@live
async def test_short_stall_is_no_silence_with_slow_reads() -> None:
    """Waiting datagrams are read before the loop age is judged, although each one takes a whole slice."""
    clock = SlowClock()
    master_shell, master, slave_shell, slave = await engage(now=clock)
    clock.hold(slave)
    for tick, wait in enumerate((0.0, 0.1, 0.1, 0.6, 0.0), 1):
        clock.waited += wait  # the loop stands still, and with it the slave
        assert master.send_update(clock(), sample_update(tick))
        master_shell.flush(clock())
    slave_shell.service(clock())
    assert slave.state is State.ENGAGED
    assert not any(isinstance(event, PeerSilent) for event in events(slave))
    assert slave.statistics.received > 1


@live
async def test_flood_of_garbage_from_peer_counts_as_silence() -> None:
    """Before the peer counts as silent, more than one slice is read, within the budget."""
    clock = SlowClock()
    master_shell, _, slave_shell, slave = await engage(now=clock)
    before = slave.statistics.drops
    clock.hold(slave)
    clock.waited = 2.5
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood:
        flood.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        flood.bind(master_shell.address)  # what the kernel takes for the peer
        for _ in range(100):
            flood.sendto(b"\x03" + bytes(60), slave_shell.address)
        slave_shell.service(clock())
    assert slave.state is State.SILENT
    assert 1 < slave.statistics.drops - before <= 2.0 * MOST_S / SlowClock.STEP_S


@live
async def test_a_tick_is_due_as_long_before_it_as_a_datagram_takes_and_until_it_is_done() -> None:
    _, _, shell, _ = await engage()
    now = monotonic()
    for tick_at, is_due in ((now + 10.0, False), (now - 10.0, True), (now + 1e-9, True), (now + 10.0, False)):
        shell.flush(now, tick_at)
        shell.flush(now)  # which says nothing of a tick
        assert shell.is_due() is is_due


@live
async def test_strangers_fill_a_buffer_of_their_own() -> None:
    """A datagram of the peer arrives at once while strangers have filled their buffer."""
    master_shell, master, slave_shell, slave = await engage()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(5000):
            stranger.sendto(b"\x03" + bytes(60), slave_shell.address)
        assert master.send_update(monotonic(), sample_update(1))
        master_shell.flush(monotonic())
        before = sum(slave.statistics.dropped.values())
        slave_shell.service(monotonic())  # of the peer alone; the loop is woken for the others
        assert sum(slave.statistics.dropped.values()) == before
        assert [event.update.tick for event in events(slave) if isinstance(event, UpdateReceived)] == [1]


@live
async def test_a_peer_that_moves_is_followed() -> None:
    master_shell, master, slave_shell, slave = await engage()
    await comes(lambda: slave_shell.paths[0].remote == f"127.0.0.1:{master_shell.address[1]}")
    assert slave_shell.paths[0][:4] == (0, "direct", "", "") and slave_shell.paths[0].changes == 0
    moved = shell_of(master, listen=ANY)
    master_shell.close()
    await moved.open(asyncio.get_running_loop())
    ticks: list[int] = []

    def is_followed() -> bool:
        ticks.append(len(ticks) + 1)
        assert master.send_update(monotonic(), sample_update(ticks[-1]))
        moved.flush(monotonic())
        return slave_shell.paths[0].remote == f"127.0.0.1:{moved.address[1]}"

    await comes(is_followed)
    assert slave.peer == moved.address and slave.state is State.ENGAGED
    assert slave_shell.paths[0].changes == 1


@pytest.mark.parametrize("dscp", [0, 46, 63])
@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
@live
async def test_class_of_service_is_asked_for_and_seen(host: str, dscp: int) -> None:
    try:
        slave_shell, _ = await opened(listen=(host, 0), dscp=dscp)
    except OSError:
        pytest.skip("this host has no IPv6 loopback")
    master_shell, _ = await opened(slave_shell.address, dscp=7)
    await comes(lambda: None not in (master_shell.paths[0].dscp, slave_shell.paths[0].dscp))
    assert (master_shell.paths[0].dscp, slave_shell.paths[0].dscp) == (dscp, 7)


@live
async def test_a_timer_wakes_the_loop_once_for_what_is_due() -> None:
    """Not again and again in the last millisecond, the resolution of the loop's timers."""
    wakes = 0

    def now() -> float:  # the shell asks when it is woken, and when it sends
        nonlocal wakes
        wakes += 1
        return monotonic()

    *_, endpoint = await engage(now=now, silence=0.2)
    wakes, sent, before = 0, -endpoint.statistics.sent, endpoint.statistics.received
    await soon(lambda: endpoint.statistics.sent + sent > 5, "repeats")
    sent += endpoint.statistics.sent
    assert wakes <= 6 * (sent + endpoint.statistics.received - before)
