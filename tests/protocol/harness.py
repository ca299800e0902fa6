"""Two real endpoints back to back through two emulated links, in virtual time.

Each side has its own clock (offset and drift against the time of the world). Whatever happens next (a tick of the
owners, an arrival, a timer) happens at its own instant, in order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from math import ceil, floor, inf
from random import Random

import pytest

from weberlink.protocol import (
    Address,
    Connected,
    DatagramDropped,
    DropReason,
    Endpoint,
    Event,
    LocalEnd,
    PeerReturned,
    PeerSilent,
    Refused,
    Role,
    State,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.liveness import HeartbeatSchedule, Liveness
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum, Protection, Security
from weberlink.protocol.wire import Kind
from weberlink.update import MAX_SELECTOR, PreviousSample, Update, UpdateForm

MASTER: Address = ("192.0.2.1", 40_000)
SLAVE: Address = ("192.0.2.2", 47_000)
STRANGER: Address = ("203.0.113.9", 9)
OTHER: Address = ("192.0.2.9", 40_009)
KEY = bytes(range(32))
AGREEMENT = {"rate_hz": 1000, "codec.force.weber": 0.1, "codec.force.predictor": "hybrid"}
TICK = 0.001
CLEAR = Emulation(delay_s=0.001)
SILENCE = 0.1
GAP = HeartbeatSchedule(Liveness(0.0, SILENCE, 0.0, 0.0), 0.0, TICK).max_gap  # between datagrams, without delay [s]
MENDED_WITHIN = 0.16
"""Time after the last loss, if nobody fell silent, in which the newest update arrives: one gap of the other end for the
evidence, and the longest pace between two repeats [s]."""


@dataclass
class Side:
    """An endpoint with its clock, and everything that it reported."""

    endpoint: Endpoint
    address: Address
    offset: float = 0.0
    drift: float = 0.0
    events: list[Event] = field(default_factory=list)
    received_at: list[tuple[float, UpdateReceived]] = field(default_factory=list)
    renewals: int = 0  # events after which the owner must send a new state
    renewed: int = 0  # how many of them `renew` has answered
    silences: int = 0  # events after which what the peer has sent counts no more

    def local(self, world: float) -> float:
        return self.offset + world * (1.0 + self.drift)

    def world(self, local: float) -> float:
        return (local - self.offset) / (1.0 + self.drift)

    def collect(self, world: float) -> None:
        while (event := self.endpoint.next_event()) is not None:
            self.events.append(event)
            self.renewals += isinstance(event, Connected | PeerReturned | UpdateLost)
            self.silences += isinstance(event, PeerSilent)
            if isinstance(event, UpdateReceived):
                self.received_at.append((world, event))

    def send(self, world: float, tick: int, stream: int = 0) -> int:
        """Send the update of a tick; returns the tick."""
        assert self.endpoint.send_update(self.local(world), sample_update(tick), stream)
        return tick

    def renew(self, world: float, tick: int) -> None:
        """Send a new state where one is needed, as an owner does."""
        if self.endpoint.state is State.ENGAGED and self.renewals > self.renewed:
            self.renewed = self.renewals
            self.send(world, tick)

    def refusal(self) -> str:
        (refused,) = self.of(Refused)
        return refused.message

    def of(self, kind: type[Event]) -> list[Event]:
        return [event for event in self.events if isinstance(event, kind)]

    def updates(self) -> list[UpdateReceived]:
        return [event for event in self.events if isinstance(event, UpdateReceived)]

    def faults(self) -> list[DropReason]:
        return [event.reason for event in self.events if isinstance(event, DatagramDropped)]


def forms(*groups: int) -> tuple[UpdateForm, ...]:
    """A stream whose updates have these groups of levels, with a previous sample, for every selector."""
    return (UpdateForm(groups, groups),) * (MAX_SELECTOR + 1)


def local_end(role: Role = Role.INITIATOR, *, seed: int = 0, **changes: object) -> LocalEnd:
    """An end with plain values, except for `changes`."""
    to_slave, to_master = (forms(3),), (forms(6),)
    arguments: dict[str, object] = {
        "agreement": AGREEMENT,
        "outgoing": to_slave if role is Role.INITIATOR else to_master,
        "incoming": to_master if role is Role.INITIATOR else to_slave,
        "security": Checksum(),
        "entropy": Random(f"{seed} {role.value}").randbytes,
        "epoch": 0.0,
        "tick_period": TICK,
    }
    return LocalEnd(role, **{**arguments, **changes})  # type: ignore[arg-type]


def make_endpoint(role: Role, *, seed: int = 0, **changes: object) -> Endpoint:
    peer = changes.pop("peer", SLAVE if role is Role.INITIATOR else None)
    return Endpoint(local_end(role, seed=seed, **changes), peer)  # type: ignore[arg-type]


def exchanged(security: Security, seed: int = 1, prologue: bytes = b"") -> tuple[Protection, Protection]:
    """Keys of a new session: the initiator's and the responder's."""
    entropy = Random(f"exchange {seed}").randbytes
    hello, waiting = security.call(prologue, entropy(security.private_size), b"hello")
    heard = security.hear(prologue, hello)
    assert heard is not None and heard[0] == b"hello"
    answered = security.answer(heard[1], entropy(security.private_size), b"welcome")
    assert answered is not None
    opened = security.open(waiting, answered[0])
    assert opened is not None and opened[0] == b"welcome"
    return opened[1], answered[1]


Tick = Callable[["Pair", float, int], None]


class Pair:
    def __init__(
        self,
        *,
        link: Emulation = CLEAR,
        backward: Emulation | None = None,
        seed: int = 1,
        master: Mapping[str, object] | None = None,
        slave: Mapping[str, object] | None = None,
        offsets: tuple[float, float] = (0.0, 0.0),
        drifts: tuple[float, float] = (0.0, 0.0),
        on_tick: Tick | None = None,
        every: int = 1,
    ) -> None:
        """Build both ends.

        Args:
            link: faults of both directions, or of that to the slave alone where `backward` has those of the other.
            offsets: local time of master and slave at world time 0 [s].
            drifts: relative error of the rate of each clock.
            on_tick: called with the pair, world time and the number of the tick after each tick that is a multiple of
                `every`.
        """
        self.seed = seed
        self.now = 0.0
        self.ticks = 0
        self._on_tick = on_tick
        self._every = every
        self.master, self.slave = (
            Side(make_endpoint(role, seed=seed, **{"epoch": offset, **(changes or {})}), address, offset, drift)
            for role, changes, address, offset, drift in zip(
                Role, (master, slave), (MASTER, SLAVE), offsets, drifts, strict=True
            )
        )
        self.forward, self.backward = self.link(link), self.link(backward or link)
        self.guests: list[Side] = []  # further masters, over the same links
        self.tap: list[tuple[float, Side, bytes]] = []  # everything sent: world time, sender, bytes
        self.sent_to: list[tuple[Address, int]] = []  # target and kind of the same
        # Whether to drop a datagram of this sender, in addition to the faults of the links.
        self.swallow: Callable[[Side, bytes], bool] = lambda side, data: False

    def link(self, emulation: Emulation) -> EmulatedLink[tuple[Address, Address]]:
        self.seed += 1
        return EmulatedLink(emulation, Random(self.seed).random, 0.0)

    @property
    def sides(self) -> tuple[Side, Side]:
        return self.master, self.slave

    @property
    def everyone(self) -> tuple[Side, ...]:
        return (*self.sides, *self.guests)

    def connect(self) -> "Pair":
        for side in self.sides:
            side.endpoint.connect(side.local(self.now))
        return self

    def join(self, address: Address = OTHER, **changes: object) -> Side:
        other = make_endpoint(Role.INITIATOR, **{"seed": 77, **changes})  # type: ignore[arg-type]
        other.connect(self.now)
        self.guests.append(Side(other, address))
        return self.guests[-1]

    def engage(self) -> "Pair":
        """Connect, and let both ends measure the link."""
        self.connect().run(0.2)
        assert self.master.of(Connected) and self.slave.of(Connected), f"seed {self.seed}"
        return self

    def run(self, duration: float) -> "Pair":
        """Advance the time of the world by `duration` [s].

        Ticks in which no owner does anything are skipped, except for the first, which sends what a test has queued."""
        end = self.now + duration
        is_idle = False
        while self.now < end - 1e-9:
            self.now = min(self._next(is_idle=is_idle), end)
            arrived = [each for link in (self.forward, self.backward) for each in link.receive(self.now)]
            for (data, (source, target)), to in product(arrived, self.everyone):
                if target == to.address:
                    self.deliver(to, data, source)
            for side in self.everyone:
                local, due = side.local(self.now), side.endpoint.next_timer()
                if due is not None and due <= local + 1e-9:
                    side.endpoint.handle_timer(max(local, due))
            if self.now >= self.ticks * TICK - 1e-9:
                if is_idle:
                    self.ticks = floor(self.now / TICK + 1e-6)
                self._tick()
            for side in self.everyone:
                self.flush(side)
            for side in self.everyone:
                side.collect(self.now)
            is_idle = self._on_tick is None or self._every > 1
        return self

    def _tick(self) -> None:
        for side in self.everyone:
            side.endpoint.handle_timer(side.local(self.now))
            side.collect(self.now)
        if self._on_tick is not None and self.ticks % self._every == 0:
            self._on_tick(self, self.now, self.ticks)
        self.ticks += 1

    def _next(self, *, is_idle: bool) -> float:
        tick = self.ticks * TICK
        if is_idle:
            tick = inf if self._on_tick is None else ceil(self.ticks / self._every) * self._every * TICK
        times = [due for link in (self.forward, self.backward) if (due := link.next_due()) is not None]
        times += [side.world(due) for side in self.everyone if (due := side.endpoint.next_timer()) is not None]
        return max(self.now, min([tick, *times]))

    def deliver(self, to: Side, data: bytes, source: Address) -> None:
        to.endpoint.receive_datagram(data, source, to.local(self.now))

    def flush(self, side: Side) -> None:
        link = self.backward if side is self.slave else self.forward
        for data, target in side.endpoint.datagrams_to_send():
            self.tap.append((self.now, side, data))
            self.sent_to.append((target, kind_of(data) if data else -1))
            if not self.swallow(side, data):
                link.send(data, (side.address, target), self.now)


def suites() -> list[Security]:
    return [PresharedKey(KEY), Checksum()]


by_suite = pytest.mark.parametrize("security", suites())


def sample_update(tick: int) -> Update:
    """An update of a position sample that depends on its tick."""
    newest = (tick % 1000, -tick % 1000, 7)
    return Update(tick, tick % 8, newest, PreviousSample(3, (newest[0] - 5, newest[1] + 5, -7)))


ENGAGED = [State.ENGAGED] * 2


def both(**changes: object) -> dict[str, dict[str, object]]:
    return {"master": changes, "slave": changes}


def states(pair: Pair) -> list[State]:
    return [side.endpoint.state for side in pair.sides]


def kind_of(data: bytes) -> int:
    """Kind of a datagram that is not empty; of a session with a key, only a handshake tells it."""
    kind = data[0] & 7
    return kind if data[0] == kind or kind not in (Kind.HELLO, Kind.WELCOME) else -1


def sent(pair: Pair, kind: Kind, side: Side | None = None) -> list[bytes]:
    return [data for _, sender, data in pair.tap if kind_of(data) == kind and side in (None, sender)]


def dropped(endpoint: Endpoint, data: bytes, source: Address, now: float = 0.2) -> list[DropReason]:
    before = endpoint.statistics.dropped.copy()
    endpoint.receive_datagram(data, source, now)
    return list((endpoint.statistics.dropped - before).elements())
