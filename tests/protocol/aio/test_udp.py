"""The shell on real sockets of this host, with the real event loop. Time limits only bound a hang."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from ipaddress import IPv6Address
from pathlib import Path
from random import Random
from time import monotonic, sleep
from typing import Any

import pytest
import uvloop

from tests.protocol.harness import forms, make_endpoint, sample_update
from weberlink.protocol import Connected, Endpoint, Event, PeerClosed, PeerSilent, Role, State, UpdateReceived
from weberlink.protocol.aio import AddressInUseError, UdpShell
from weberlink.protocol.aio.queue import MOST_S
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address

ANY: Address = ("127.0.0.1", 0)
HANG_S = 10.0
SHELLS: list[UdpShell] = []


def live(main: Callable[[asyncio.AbstractEventLoop], Awaitable[None]]) -> Callable[[], None]:
    """Make a test of a coroutine, in an event loop of its own; the shells that it made are closed at the end."""

    async def bounded() -> None:
        try:
            async with asyncio.timeout(HANG_S):
                await main(asyncio.get_running_loop())
        finally:
            while SHELLS:
                SHELLS.pop().close()

    def test() -> None:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(bounded())

    return test


def shell_of(endpoint: Endpoint, **arguments: Any) -> UdpShell:
    SHELLS.append(UdpShell(endpoint, **{"now": monotonic, **arguments}))
    return SHELLS[-1]


def make(role: Role, **changes: object) -> Endpoint:
    settings = {"silence": 2.0} | changes
    return make_endpoint(role, epoch=monotonic(), outgoing=(forms(3),), incoming=(forms(3),), **settings)


async def until(endpoint: Endpoint, kind: type[Event], events: list[Event]) -> Event:
    """Wait for an event of a kind; the endpoint is driven by its socket and timers alone."""
    while True:
        while (event := endpoint.next_event()) is not None:
            events.append(event)
            if isinstance(event, kind):
                return event
        await asyncio.sleep(0.001)


async def until_true(condition: Callable[[], object]) -> None:
    while not condition():
        await asyncio.sleep(0.001)


async def engage(
    loop: asyncio.AbstractEventLoop,
    link: EmulatedLink[Address] | None = None,
    host: str = "127.0.0.1",
    *,
    silence: float = 2.0,
    slave_now: Callable[[], float] = monotonic,
    listen: Address = ANY,
) -> tuple[UdpShell, Endpoint, UdpShell, Endpoint]:
    slave = make(Role.RESPONDER, silence=silence)
    slave_shell = shell_of(slave, now=slave_now, listen=listen)
    await slave_shell.open(loop)
    slave.connect(monotonic())
    master = make(Role.INITIATOR, peer=(host, slave_shell.address[1]), silence=silence)
    master_shell = shell_of(master, link=link)
    await master_shell.open(loop)
    master.connect(monotonic())
    master_shell.flush(monotonic())
    await until(master, Connected, [])
    await until(slave, Connected, [])
    return master_shell, master, slave_shell, slave


@live
async def test_two_shells_connect_exchange_updates_and_part(loop: asyncio.AbstractEventLoop) -> None:
    master_shell, master, slave_shell, slave = await engage(loop)
    for tick in range(20):
        now = monotonic()
        for shell in (master_shell, slave_shell):
            shell.service(now)
        assert master.send_update(now, sample_update(tick))
        master_shell.flush(now)
        event = await until(slave, UpdateReceived, [])
        assert event.update == sample_update(tick)
    slave.close(monotonic(), "slave: done")
    assert await until(master, PeerClosed, []) == PeerClosed("slave: done")


@pytest.mark.parametrize("is_under_way", [False, True])
def test_a_farewell_leaves_with_the_socket(is_under_way: bool) -> None:
    """It waits in the endpoint, or in an emulated link of ten seconds, when the shell is closed."""

    @live
    async def session(loop: asyncio.AbstractEventLoop) -> None:
        link: EmulatedLink[Address] = EmulatedLink(Emulation(), Random(1).random)
        master_shell, master, _slave_shell, slave = await engage(loop, link=link)
        link.change(Emulation(delay_s=10.0))
        master.close(monotonic(), "master: device fault")
        if is_under_way:
            master_shell.flush(monotonic())
        master_shell.close()
        assert await until(slave, PeerClosed, []) == PeerClosed("master: device fault")

    session()


@live
async def test_host_names_are_resolved_and_kept_in_events(loop: asyncio.AbstractEventLoop) -> None:
    slave = make(Role.RESPONDER)
    slave_shell = shell_of(slave, listen=ANY)
    await slave_shell.open(loop)
    slave.connect(monotonic())
    peer = ("localhost", slave_shell.address[1])
    master = make(Role.INITIATOR, peer=peer)
    master.connect(monotonic())  # the first HELLO waits for the socket
    master_shell = shell_of(master, listen=ANY)
    await master_shell.open(loop)
    event = await until(master, Connected, [])
    assert isinstance(event, Connected)
    assert event.address == peer


@live
async def test_emulated_faults_act_on_real_sockets(loop: asyncio.AbstractEventLoop) -> None:
    link: EmulatedLink[Address] = EmulatedLink(
        Emulation(delay_s=0.03, duplicate=0.5, corrupt=0.2), Random(3).random, monotonic()
    )
    master_shell, master, _slave_shell, slave = await engage(loop, link)
    sent_at = monotonic()
    while slave.statistics.updates_received[0] < 10:
        master.send_update(monotonic(), sample_update(1))
        master_shell.flush(monotonic())
        await asyncio.sleep(0.005)
    assert monotonic() - sent_at >= 0.03
    assert link.counters.duplicated > 0
    assert slave.statistics.dropped.total() > 0
    rtt = master.statistics.rtt
    assert rtt is not None
    assert rtt >= 0.03


@live
async def test_port_in_use_is_named(loop: asyncio.AbstractEventLoop) -> None:
    """By another program, or by a slave in a session, which could share it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(ANY)
        _master_shell, _, slave_shell, _ = await engage(loop)
        for address in (other.getsockname(), slave_shell.address):
            with pytest.raises(AddressInUseError, match=f"127.0.0.1:{address[1]} is in use"):
                await shell_of(make(Role.RESPONDER), listen=address).open(loop)


@live
async def test_wrong_addresses_are_refused_by_name(loop: asyncio.AbstractEventLoop) -> None:
    shell = shell_of(make(Role.INITIATOR, peer=("no.such.host.invalid", 1)))
    with pytest.raises(OSError, match=r"no\.such\.host\.invalid:1 cannot be resolved"):
        await shell.open(loop)
    with pytest.raises(OSError, match="assign"):
        await shell_of(make(Role.RESPONDER), listen=("192.0.2.1", 0)).open(loop)


@live
async def test_a_send_that_the_system_refuses_is_a_loss(loop: asyncio.AbstractEventLoop) -> None:
    """A broadcast is not permitted; to a port of nobody the answer is an error. The peer is called again."""
    broadcast = ("255.255.255.255", 9)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        plain.bind(ANY)
        nobody = plain.getsockname()
        with pytest.raises(PermissionError):
            plain.sendto(b"x", broadcast)
    for peer in (broadcast, nobody):
        master = make(Role.INITIATOR, peer=peer)
        shell = shell_of(master)
        await shell.open(loop)
        master.connect(monotonic())
        shell.flush(monotonic())
        await until_true(lambda told=master.statistics: told.sent >= 4)
        assert master.state is State.CONNECTING


@live
async def test_slave_on_all_addresses_answers_from_the_called_one(loop: asyncio.AbstractEventLoop) -> None:
    master_shell, master, _, slave = await engage(loop, host="127.0.0.2", listen=("0.0.0.0", 0))
    for tick in range(20):  # the master follows to the address from which the slave then sends
        now = monotonic()
        assert master.send_update(now, sample_update(tick))
        master_shell.flush(now)
        assert (await until(slave, UpdateReceived, [])).update == sample_update(tick)  # type: ignore[attr-defined]


def link_local() -> str | None:
    """An address of this host with its zone, "fe80::1%eth0"; None if it has none."""
    listed = Path("/proc/net/if_inet6")
    for line in listed.read_text(encoding="utf-8").splitlines() if listed.exists() else ():
        digits, _, _, scope, _, interface = line.split()
        if scope == "20":
            return f"{IPv6Address(bytes.fromhex(digits))}%{interface}"
    return None


@pytest.mark.skipif(link_local() is None, reason="this host has no link-local IPv6 address")
@live
async def test_a_link_local_address_keeps_its_zone(loop: asyncio.AbstractEventLoop) -> None:
    """Of a direct cable: the system takes it with its zone only, to bind, to connect and to answer."""
    host = link_local()
    assert host is not None
    slave = make(Role.RESPONDER)
    slave_shell = shell_of(slave, listen=(host, 0))
    await slave_shell.open(loop)
    slave.connect(monotonic())
    master = make(Role.INITIATOR, peer=(host, slave_shell.address[1]))
    master_shell = shell_of(master)
    await master_shell.open(loop)
    master.connect(monotonic())
    master_shell.flush(monotonic())
    for endpoint, shell in ((master, master_shell), (slave, slave_shell)):
        await until(endpoint, Connected, [])
        # The socket that is connected to the peer hears it too.
        before = endpoint.statistics.received
        await until_true(lambda told=endpoint.statistics, before=before: told.received > before + 3)
        assert "%" in shell.paths[0].remote


class SlowClock:
    """`monotonic`; from `begin` on, time advances only with each datagram, by more than a slice."""

    STEP_S = 3e-4

    def __init__(self) -> None:
        self._now: Callable[[], float] = monotonic

    def begin(self, endpoint: Endpoint) -> float:
        """Make each datagram of the endpoint slow from now on; returns the time."""
        began, told = monotonic(), endpoint.statistics
        before = told.received + told.drops
        self._now = lambda: began + self.STEP_S * (told.received + told.drops - before)
        return began

    def __call__(self) -> float:
        return self._now()


@live
async def test_short_stall_is_no_silence_with_slow_reads(loop: asyncio.AbstractEventLoop) -> None:
    """Waiting datagrams are read before the loop age is judged, although each one takes a whole slice."""
    clock = SlowClock()
    master_shell, master, slave_shell, slave = await engage(loop, silence=0.2, slave_now=clock)
    for tick, wait in enumerate((0.0, 0.01, 0.01, 0.06, 0.0), 1):
        sleep(wait)  # the loop stands still, and with it the slave
        assert master.send_update(monotonic(), sample_update(tick))
        master_shell.flush(monotonic())
    slave_shell.service(clock.begin(slave))
    events: list[Event] = []
    while (event := slave.next_event()) is not None:
        events.append(event)
    assert slave.state is State.ENGAGED
    assert not any(isinstance(event, PeerSilent) for event in events)
    assert slave.statistics.received > 1


@live
async def test_flood_of_garbage_from_peer_counts_as_silence(loop: asyncio.AbstractEventLoop) -> None:
    """Before the peer counts as silent, more than one slice is read, within the budget."""
    clock = SlowClock()
    master_shell, _, slave_shell, slave = await engage(loop, silence=0.2, slave_now=clock)
    before = slave.statistics.drops
    sleep(0.25)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood:
        flood.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        flood.bind(master_shell.address)  # what the kernel takes for the peer
        for _ in range(100):
            flood.sendto(b"\x03" + bytes(60), slave_shell.address)
        slave_shell.service(clock.begin(slave))
    assert slave.state is State.SILENT
    assert 1 < slave.statistics.drops - before <= 2.0 * MOST_S / SlowClock.STEP_S


@live
async def test_strangers_fill_a_buffer_of_their_own(loop: asyncio.AbstractEventLoop) -> None:
    """A datagram of the peer arrives at once while strangers have filled their buffer."""
    master_shell, master, slave_shell, slave = await engage(loop)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(5000):
            stranger.sendto(b"\x03" + bytes(60), slave_shell.address)
        assert master.send_update(monotonic(), sample_update(1))
        master_shell.flush(monotonic())
        before = sum(slave.statistics.dropped.values())
        slave_shell.service(monotonic())  # of the peer alone; the loop is woken for the others
        assert sum(slave.statistics.dropped.values()) == before
        events: list[Event] = []
        while (event := slave.next_event()) is not None:
            events.append(event)
        assert [event.update.tick for event in events if isinstance(event, UpdateReceived)] == [1]


@live
async def test_a_peer_that_moves_is_followed(loop: asyncio.AbstractEventLoop) -> None:
    master_shell, master, slave_shell, slave = await engage(loop)
    await until_true(lambda: slave_shell.paths[0].remote == f"127.0.0.1:{master_shell.address[1]}")
    assert slave_shell.paths[0][:4] == (0, "direct", "", "")
    assert slave_shell.paths[0].changes == 0
    moved = shell_of(master, listen=ANY)
    master_shell.close()
    await moved.open(loop)
    ticks: list[int] = []

    def is_followed() -> bool:
        ticks.append(len(ticks) + 1)
        assert master.send_update(monotonic(), sample_update(ticks[-1]))
        moved.flush(monotonic())
        return slave_shell.paths[0].remote == f"127.0.0.1:{moved.address[1]}"

    await until_true(is_followed)
    assert slave.peer == moved.address
    assert slave.state is State.ENGAGED
    assert slave_shell.paths[0].changes == 1


@pytest.mark.parametrize("dscp", [0, 46, 63])
@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_class_of_service_is_asked_for_and_seen(host: str, dscp: int) -> None:
    if host == "::1" and not socket.has_ipv6:
        pytest.skip("this Python has no IPv6")

    @live
    async def session(loop: asyncio.AbstractEventLoop) -> None:
        slave_shell = shell_of(slave := make(Role.RESPONDER), listen=(host, 0), dscp=dscp)
        try:
            await slave_shell.open(loop)
        except OSError:
            pytest.skip("this host has no IPv6 loopback")
        slave.connect(monotonic())
        master = make(Role.INITIATOR, peer=slave_shell.address)
        master_shell = shell_of(master, dscp=7)
        await master_shell.open(loop)
        master.connect(monotonic())
        master_shell.flush(monotonic())
        await until_true(lambda: master_shell.paths[0].dscp is not None and slave_shell.paths[0].dscp is not None)
        assert (master_shell.paths[0].dscp, slave_shell.paths[0].dscp) == (dscp, 7)

    session()


@live
async def test_a_timer_wakes_the_loop_once_for_what_is_due(loop: asyncio.AbstractEventLoop) -> None:
    """Not again and again in the last millisecond, the resolution of the loop's timers."""
    wakes = 0

    def now() -> float:  # the shell asks when it is woken, and when it sends
        nonlocal wakes
        wakes += 1
        return monotonic()

    *_, endpoint = await engage(loop, slave_now=now, silence=0.2)
    wakes, sent, before = 0, -endpoint.statistics.sent, endpoint.statistics.received
    await asyncio.sleep(0.5)
    sent += endpoint.statistics.sent
    assert sent > 5
    assert wakes <= 6 * (sent + endpoint.statistics.received - before)
