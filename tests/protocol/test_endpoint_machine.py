"""Two endpoints and whatever happens to them, in any order: what each believes is compared with what really arrived.

The world knows which datagram left in which session and when it was accepted; the endpoints know bytes and clocks only.
"""

from collections import defaultdict
from math import inf
from typing import NamedTuple

from hypothesis import Phase, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from tests.examples import examples
from tests.protocol.harness import (
    KEY,
    MASTER,
    SILENCE,
    SLAVE,
    STRANGER,
    TICK,
    Pair,
    Side,
    both,
    forms,
    kind_of,
    make_endpoint,
)
from weberlink.protocol import (
    Address,
    ChangeAnswered,
    ChangeProposed,
    Connected,
    DatagramDropped,
    DropReason,
    Endpoint,
    Event,
    PeerClosed,
    PeerSilent,
    Refused,
    Role,
    SessionExpired,
    State,
    TakenOver,
    UpdateReceived,
)
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.timing import WINDOW
from weberlink.protocol.wire import Kind
from weberlink.update import MAX_SELECTOR, PreviousSample, Update

OWN = st.integers(0, 1)
LATE = 2.0 * TICK
"""How late an owner may be in each of two ticks [s]."""
HANDSHAKE = (Kind.HELLO, Kind.WELCOME)
OF_THE_CONTENT = {
    DropReason.STALE, DropReason.SUPERSEDED, DropReason.UNTIMED, DropReason.IMPLAUSIBLE, DropReason.REPLAYED,
}  # fmt: skip
"""Why an authentic datagram of the present session may be dropped."""

Key = tuple[Endpoint, int]  # an endpoint and the number of its session


class Sent(NamedTuple):
    """A datagram: in which session it left, and when [s, world]."""

    session: Key
    at: float


class World(Pair):
    """The two ends, their owners, and the truth."""

    def __init__(self, streams: int, **arguments: object) -> None:
        super().__init__(on_tick=World.own, every=4, **arguments)  # type: ignore[arg-type]
        self.streams = streams
        self.epochs = {side.endpoint: side.offset for side in self.sides}
        self.dark: set[Role] = set()
        self.swallow = lambda side, data: side.endpoint.role in self.dark
        self.origins: dict[bytes, Sent] = {}
        self.accepted: defaultdict[Endpoint, set[bytes]] = defaultdict(set)
        self.partners: dict[Key, Key] = {}
        self.updates: defaultdict[tuple[Key, int], list[tuple[float, Update]]] = defaultdict(list)
        self.held: dict[tuple[Key, int], int] = {}
        # By session of the receiver and stream: which of the sender's updates was delivered last; and the same since
        # the receiver last forgot all.
        self.since: defaultdict[tuple[Key, int, int], int] = defaultdict(lambda: -1)
        self.heard_at: defaultdict[Key, float] = defaultdict(lambda: -inf)
        self.arrived: defaultdict[Key, float] = defaultdict(lambda: -inf)
        """By session of the sender: departure of the newest datagram that the peer has accepted."""
        self.proposals: defaultdict[Key, list[tuple[int, bytes]]] = defaultdict(list)
        self.proposed: defaultdict[Key, list[tuple[int, bytes]]] = defaultdict(list)
        self.answered: defaultdict[Key, list[tuple[int, bytes]]] = defaultdict(list)
        self.renewed: dict[Endpoint, int] = {}
        self.halted_at: dict[Endpoint, float] = {}
        """When its encoder stopped, by endpoint that encodes no more."""
        self.resumed_at: defaultdict[Endpoint, float] = defaultdict(lambda: inf)
        """Since when it encodes in a session in which each hears the other; inf while it does not."""
        self.counts: dict[Endpoint, tuple[int, ...]] = {}
        self.count = 0
        self.settles_at = 0.0
        """Until then a clock has jumped, and times cannot be compared."""

    def of(self, role: Role) -> Side:
        return self.master if role is Role.INITIATOR else self.slave

    def opposite(self, side: Side) -> Side:
        return self.slave if side.endpoint.role is Role.INITIATOR else self.master

    # --- owners

    def own(self, now: float, tick: int) -> None:
        """What the owner of each end does in a tick: answer what it is told."""
        for side in self.everyone:
            endpoint = side.endpoint
            is_encoding = endpoint not in self.halted_at
            endpoint.report_encoding(side.local(self.now), is_encoding=is_encoding)
            # Until the session has proved its first round trip, neither end follows, and nothing counts as missing.
            works = is_encoding and endpoint.state is State.ENGAGED and not endpoint.liveness.is_opening
            self.resumed_at[endpoint] = min(self.resumed_at[endpoint], self.now) if works else inf
            if side.renewals > self.renewed.get(endpoint, 0) and is_encoding and endpoint.state is State.ENGAGED:
                self.renewed[endpoint] = side.renewals
                for stream in range(self.streams):
                    self.send(side, stream)

    def send(self, side: Side, stream: int) -> bool:
        self.count += 1
        levels = (self.count % 30_000, self.count // 30_000, -(self.count % 7))
        previous = PreviousSample(1 + self.count % 9, (levels[0] - 5, levels[1], 7)) if self.count % 3 else None
        tick = self.tick_of(side)
        update = Update(tick, self.count % (MAX_SELECTOR + 1), levels, previous)
        if not side.endpoint.send_update(side.local(self.now), update, stream):
            return False
        self.updates[key_of(side), stream].append((self.now, update))
        self.flush(side)
        return True

    def tick_of(self, side: Side) -> int:
        """Of an end, by its own clock; every run of it begins at 0."""
        return round((side.local(self.now) - self.epochs[side.endpoint]) / TICK)

    # --- the truth

    def flush(self, side: Side) -> None:
        first = len(self.tap)
        super().flush(side)
        for _, _, data in self.tap[first:]:
            self.origins[data] = Sent(key_of(side), self.now)

    def deliver(self, to: Side, data: bytes, source: Address) -> None:
        """Let a datagram arrive, and judge all that it leads to."""
        to.collect(self.now)
        endpoint, counted, seen = to.endpoint, to.endpoint.statistics, len(to.events)
        received, drops = counted.received, counted.drops
        super().deliver(to, data, source)
        to.collect(self.now)
        events = to.events[seen:]
        is_accepted, is_dropped = counted.received > received, counted.drops > drops
        assert is_accepted or is_dropped, "every datagram is accepted or dropped for a reason"
        reasons = to.faults()[-1:] if is_dropped else []
        if any(isinstance(event, Connected) for event in events):
            self.heard_at[key_of(to)] = self.arrived[key_of(to)] = self.now
        origin = self.origins.get(data)
        if not data or kind_of(data) in HANDSHAKE:
            opens = Connected if endpoint.role is Role.INITIATOR else Refused
            assert all(isinstance(event, Refused | opens) for event in told(events)), events
        elif origin is None or data in self.accepted[endpoint] or not is_accepted:
            assert not is_accepted and not told(events), (events, "forged, replayed, or of another session")
            assert not origin or reasons != [DropReason.MALFORMED]
        else:
            assert set(reasons) <= OF_THE_CONTENT
            self._accept(to, data, origin, events, reasons)
        self.flush(to)

    def _accept(self, to: Side, data: bytes, origin: Sent, events: list[Event], reasons: list[DropReason]) -> None:
        own = key_of(to)
        self.accepted[to.endpoint].add(data)
        if not reasons and not any(isinstance(event, (PeerClosed, TakenOver)) for event in events):
            assert origin.session[0] is not to.endpoint, "its own datagram, reflected"
            for one, other in ((own, origin.session), (origin.session, own)):
                assert self.partners.setdefault(one, other) == other, "two ends of one session"
        if self.partners.get(own) == origin.session:
            self.arrived[origin.session] = max(self.arrived[origin.session], origin.at)
            is_old = reasons == [DropReason.STALE] and self.now - origin.at > SILENCE + self.limit(to)
            if not is_old and reasons not in ([DropReason.REPLAYED], [DropReason.IMPLAUSIBLE]):
                self.heard_at[own] = self.now
        for event in events:
            if isinstance(event, Connected):
                assert to.endpoint.role is Role.RESPONDER
                assert self.now - origin.at <= SILENCE + self.limit(to) + LATE or self.now < self.settles_at
            elif isinstance(event, UpdateReceived):
                self._receive(to, origin, event)
            elif isinstance(event, ChangeProposed):
                assert (event.tick, event.body) in self.proposals[origin.session]
                assert (event.tick, event.body) not in self.proposed[own], "told once"
                self.proposed[own].append((event.tick, event.body))
                to.endpoint.answer_change(event, None)
            elif isinstance(event, ChangeAnswered):
                assert (event.tick, event.body) in self.proposed[origin.session]
                assert (event.tick, event.body) not in self.answered[own] and event.refusal is None
                self.answered[own].append((event.tick, event.body))

    def _receive(self, to: Side, origin: Sent, event: UpdateReceived) -> None:
        own = key_of(to)
        sent = self.updates[origin.session, event.stream]
        number = [update for _, update in sent].index(event.update)
        memory = own, event.stream, to.silences
        assert number >= self.since[memory], "none after a newer one"
        self.since[memory] = number
        self.held[own, event.stream] = max(number, self.held.get((own, event.stream), -1))
        if self.now >= self.settles_at:
            age = self.now - origin.at
            assert age <= SILENCE + self.limit(to) + LATE, "no stale update is delivered"
            assert abs(event.age - age) <= 0.5 * self.limit(to) + 0.005
            assert self.now - sent[number][0] <= 2.0 * (SILENCE + self.limit(to)) + 0.02

    def limit(self, side: Side) -> float:
        return max(each.endpoint.liveness.round_trip for each in (side, *self.sides))

    def check(self) -> None:
        """What an end believes is true."""
        for side in self.everyone:
            endpoint, own = side.endpoint, key_of(side)
            if endpoint.state is not State.ENGAGED:
                assert not endpoint.may_follow(side.local(self.now))
                continue
            liveness = endpoint.liveness
            assert self.now < self.settles_at or side.local(self.now) < endpoint.silent_at + LATE
            if self.now < self.settles_at or liveness.is_opening or own not in self.partners:
                continue
            limit = SILENCE + self.limit(side) + LATE
            assert self.now - self.heard_at[own] <= SILENCE + LATE, "reception"
            assert self.now - self.arrived[own] <= limit, "loop age"
            assert side.world(liveness.confirmed_at) <= self.arrived[own] + 1e-6, "the loop age is never underestimated"
            if endpoint.may_follow(side.local(self.now)):
                self._check_driving(own, limit)

    def _check_driving(self, own: Key, limit: float) -> None:
        """Nothing is executed that is too old, or whose encoder has stopped."""
        peer = self.partners[own]
        assert self.now - self.halted_at.get(peer[0], inf) <= SILENCE + limit
        current = []
        for stream in range(self.streams):
            old = [at for at, _ in self.updates[peer, stream] if at < self.now - SILENCE - limit]
            current.append(self.held.get((own, stream), -1) >= len(old) - 1)
            since, before = self.resumed_at[own[0]], self.now - limit - LATE
            own_old = [at for at, _ in self.updates[own, stream] if max(at, since) < before]
            assert self.held.get((peer, stream), -1) >= len(own_old) - 1, "who follows is held by the other end"
        assert all(current), "an update that was held back counts as missing"

    def go(self, duration: float) -> None:
        ends_at = self.now + duration
        while self.now < ends_at - 1e-9:
            self.run(min(0.005, ends_at - self.now))
            self.check()
        for side in self.everyone:
            self._count(side)

    def _count(self, side: Side) -> None:
        """Counters only rise, repeats are bounded, and credit is never overrated."""
        endpoint, told = side.endpoint, side.endpoint.statistics
        assert told.drops == told.dropped.total() and told.overflowed == 0
        assert told.repeats <= 13 * sum(told.updates_sent) + 10.0 * self.now * self.streams
        counts = (
            *(told.sent, told.bytes_sent, told.received, told.repeats, told.heartbeats),
            *(*told.updates_sent, *told.updates_received, told.drops),
        )
        before, self.counts[endpoint] = self.counts.get(endpoint, counts), counts
        assert all(new >= old for new, old in zip(counts, before, strict=True))
        peer = self.partners.get(key_of(side))
        if peer is not None and peer[1] == peer[0].sessions and peer[0].state in (State.ENGAGED, State.SILENT):
            assert endpoint.credit.known <= peer[0].credit.granted


def key_of(side: Side) -> Key:
    return side.endpoint, side.endpoint.sessions


def told(events: list[Event]) -> list[Event]:
    """Events other than a dropped datagram, or one that time alone has brought."""
    return [event for event in events if not isinstance(event, DatagramDropped | PeerSilent | SessionExpired)]


class Endpoints(RuleBasedStateMachine):
    """Everything that may happen to two ends; a third one may take over."""

    @initialize(
        seed=st.integers(0, 2**16),
        keyed=st.booleans(),
        streams=st.integers(1, 2),
        delay=st.sampled_from([0.0, 0.001, 0.02, 0.045]),
        offset=st.sampled_from([0.0, 1000.5]),
    )
    def call(self, seed: int, keyed: bool, streams: int, delay: float, offset: float) -> None:
        layouts = {"outgoing": (forms(3),) * streams, "incoming": (forms(3),) * streams}
        self.kinds = {"security": PresharedKey(KEY) if keyed else Checksum(), **layouts, "carries_credit": True}
        self.runs, self.link = seed, Emulation(delay_s=delay)
        self.world = World(streams, link=self.link, seed=seed, **both(**self.kinds), offsets=(offset, 0.0))
        self.is_bad = False  # whether the link loses or damages datagrams
        self.world.connect()
        self.world.go(0.1 + 4.0 * delay)

    def new(self, role: Role, **changes: object) -> Endpoint:
        self.runs += 1
        side = self.world.of(role)
        made = make_endpoint(role, seed=self.runs, **{**self.kinds, "epoch": side.offset, **changes})
        made.connect(side.local(self.world.now))
        self.world.epochs[made] = side.offset
        return made

    # --- the link

    @rule(duration=st.sampled_from([0.003, 0.03, 0.09, 0.15, 0.5]))
    def wait(self, duration: float) -> None:
        self.world.go(duration)

    @rule()
    def wait_for_expiry(self) -> None:
        self.world.go(EXPIRY + SILENCE + 0.2)

    @rule(
        delays=st.tuples(*[st.sampled_from([0.0, 0.001, 0.02, 0.045, 0.1, 0.18])] * 2),
        loss=st.sampled_from([0.0, 0.0, 0.1, 0.3]),
        burst=st.sampled_from([1.0, 5.0]),
        disorder=st.sampled_from([0.0, 0.2]),
    )
    def change_link(self, delays: tuple[float, float], loss: float, burst: float, disorder: float) -> None:
        self.is_bad = loss + disorder > 0.0
        faults = {"jitter_s": 0.02 * disorder, "reorder": disorder, "duplicate": disorder, "corrupt": 0.25 * disorder}
        for link, delay in zip((self.world.forward, self.world.backward), delays, strict=True):
            link.change(Emulation(delay_s=delay, loss=loss, burst=burst, **faults))
        self.world.go(0.05)

    @rule(of=st.sampled_from([{Role.INITIATOR}, {Role.RESPONDER}, set(Role)]), lasts=st.sampled_from([0.03, 0.2, 0.6]))
    def cut(self, of: set[Role], lasts: float) -> None:
        """Nothing of these ends arrives for a while; each end falls silent within the limits."""
        world = self.world
        world.dark = of
        world.go(lasts)
        if lasts > SILENCE + world.limit(world.master) + 0.3:
            assert State.ENGAGED not in (world.master.endpoint.state, world.slave.endpoint.state)

    @rule()
    def heal(self) -> None:
        self.world.dark = set()
        self.world.go(0.1)

    # --- somebody on the path

    @rule(back=st.integers(0, 80), count=st.integers(1, 3), moved=st.booleans())
    def deliver_again(self, back: int, count: int, moved: bool) -> None:
        """A datagram that had arrived, or had not, comes now; and once more."""
        for _, side, data in self.world.tap[-1 - back :][:count]:
            to = self.world.opposite(side)
            for _ in range(2):
                source = STRANGER if moved and to is self.world.slave else side.address
                self.world.deliver(to, data, source)
        self.world.go(0.002)

    @rule(back=st.integers(0, 20), bit=st.integers(0, 2000), reflected=st.booleans())
    def deliver_altered(self, back: int, bit: int, reflected: bool) -> None:
        """One bit is another one, or the datagram comes back to its sender."""
        _, side, data = self.world.tap[-1 - back :][0]
        if not reflected:
            altered = bytearray(data)
            altered[bit // 8 % len(data)] ^= 1 << bit % 8
            data = bytes(altered)
        to = side if reflected else self.world.opposite(side)
        if kind_of(data) not in HANDSHAKE:
            self.world.deliver(to, data, self.world.master.address if to is self.world.slave else SLAVE)

    # --- the ends

    @rule(own=OWN, stream=st.integers(0, 1), count=st.integers(1, 4), pace=st.sampled_from([0.001, 0.015]))
    def update(self, own: int, stream: int, count: int, pace: float) -> None:
        side = self.world.sides[own]
        for _ in range(count):
            if side.endpoint not in self.world.halted_at:
                had_session = side.endpoint.state in (State.ENGAGED, State.SILENT)
                assert self.world.send(side, stream % self.world.streams) is had_session
            self.world.go(pace)

    @rule(own=OWN, runs=st.booleans())
    def halt(self, own: int, runs: bool) -> None:
        """The encoder of an end stops, or begins with a new state."""
        side = self.world.sides[own]
        if runs and side.endpoint in self.world.halted_at:
            del self.world.halted_at[side.endpoint]
            self.world.renewed[side.endpoint] = -1
        elif not runs:
            self.world.halted_at.setdefault(side.endpoint, self.world.now)
        self.world.go(0.02)

    @rule(own=OWN)
    def forget(self, own: int) -> None:
        """An owner holds the peer's updates no more: a new state must follow."""
        self.world.sides[own].endpoint.request_full_state()
        self.world.sides[own].silences += 1
        self.world.go(0.01)

    @rule(own=OWN, more=st.sampled_from([1, 300, 70_000]))
    def grant(self, own: int, more: int) -> None:
        endpoint = self.world.sides[own].endpoint
        endpoint.grant(endpoint.credit.granted + more)
        self.world.go(0.01)

    @rule(own=OWN, body=st.binary(min_size=1, max_size=200))
    def propose(self, own: int, body: bytes) -> None:
        """A live change, which the other owner accepts."""
        side = self.world.sides[own]
        tick = self.world.tick_of(side) + 300
        key, proposal = key_of(side), (tick, body)
        may = side.endpoint.state is State.ENGAGED
        is_free = len(self.world.proposals[key]) == len(self.world.answered[key])
        assert side.endpoint.propose_change(side.local(self.world.now), tick, body) is (may and is_free)
        if may and is_free:
            self.world.proposals[key].append(proposal)
        self.world.go(0.01)

    @rule(own=OWN, asleep=st.sampled_from([0.04, 0.3, 20.0]))
    def sleep(self, own: int, asleep: float) -> None:
        """The clock of one end jumps ahead: its process stood still, or the other machine slept."""
        self.world.sides[own].offset += asleep
        self.world.settles_at = self.world.now + EXPIRY + WINDOW + 1.0
        self.world.go(0.2)

    @rule()
    def roam(self) -> None:
        host, port = self.world.master.address
        self.world.master.address = (host, port + 1)
        self.world.go(0.05)

    @rule(role=st.sampled_from(Role), take_over=st.booleans())
    def restart(self, role: Role, take_over: bool) -> None:
        self.world.of(role).endpoint = self.new(role, **({"take_over": take_over} if role is Role.INITIATOR else {}))
        self.world.go(0.1)

    @rule(own=OWN)
    def leave(self, own: int) -> None:
        """One end says why it leaves; then its next run begins."""
        world = self.world
        side, other = world.sides[own], world.sides[1 - own]
        if side.endpoint.state is State.CLOSED:
            return
        reason, is_reached = f"run {self.runs} ends", self.is_reached()
        side.endpoint.close(side.local(world.now), reason)
        world.go(0.15)
        if is_reached and world.now >= world.settles_at:
            assert PeerClosed(reason) in other.of(PeerClosed)
        side.endpoint = self.new(side.endpoint.role)
        world.go(0.1)

    @precondition(lambda self: self.world.slave.endpoint.state is State.ENGAGED and not self.world.guests)
    @rule(take_over=st.booleans())
    def intrude(self, take_over: bool) -> None:
        """Another master with the key calls; it gets the slave only if it takes over, and the former one is told."""
        world = self.world
        former, sessions, is_reached = world.master, world.slave.endpoint.sessions, self.is_reached()
        guest = Side(self.new(Role.INITIATOR, name="bob@desk", take_over=take_over), (MASTER[0], 50_000 + self.runs))
        guest.offset = former.offset
        world.guests.append(guest)
        world.go(0.3)
        if guest.endpoint.sessions and world.slave.endpoint.peer_name == "bob@desk":
            world.go(0.15)  # the former one is told on a slow way too
            world.master = guest
            assert not is_reached or former.of(TakenOver) == [TakenOver("bob@desk")]
        world.guests = []
        if not take_over and world.slave.endpoint.state is State.ENGAGED and world.slave.endpoint.sessions == sessions:
            assert not guest.of(Connected)

    def teardown(self) -> None:
        """On a clean link both ends soon share a session and hold the newest of each other; then nothing happens."""
        if not hasattr(self, "world"):
            return
        world = self.world
        world.dark, world.guests = set(), []
        world.halted_at.clear()
        for side in world.sides:
            world.renewed[side.endpoint] = -1
        for link in (world.forward, world.backward):
            link.change(self.link)
        ends_at = max(world.now, world.settles_at) + 2.0 * EXPIRY + 2.0
        while world.now < world.settles_at or (not self.is_shared() and world.now < ends_at):
            for side in world.sides:
                if side.endpoint.state is State.CLOSED:
                    side.endpoint = self.new(side.endpoint.role)
            world.go(0.1)
        assert self.is_shared()
        world.go(0.5)
        quiet = [len(side.events) for side in world.sides]
        world.go(1.5)
        assert self.is_shared()
        for side, other, seen in zip(world.sides, world.sides[::-1], quiet, strict=True):
            assert not told(side.events[seen:]), (side.endpoint.role, told(side.events[seen:]))
            own, peer = key_of(side), key_of(other)
            assert side.endpoint.may_follow(side.local(world.now))
            for stream in range(world.streams):
                assert self.world.held[own, stream] == len(world.updates[peer, stream]) - 1, "the newest is held"
            assert side.endpoint.credit.known == other.endpoint.credit.granted
            assert world.answered[own] == world.proposals[own]
        assert world.master.endpoint.liveness.round_trip == world.slave.endpoint.liveness.round_trip

    def is_shared(self) -> bool:
        master, slave = self.world.sides
        is_engaged = master.endpoint.state is slave.endpoint.state is State.ENGAGED
        return is_engaged and self.world.partners.get(key_of(master)) == key_of(slave)

    def is_reached(self) -> bool:
        """Whether all that each says reaches the other, too."""
        world = self.world
        is_clear = not (self.is_bad or world.dark) and world.slave.endpoint.peer == world.master.address
        return self.is_shared() and is_clear


TestEndpoints = Endpoints.TestCase
# Shrinking takes minutes, and twenty steps can be read.
TestEndpoints.settings = examples(60, stateful_step_count=20, phases=(Phase.generate,))
