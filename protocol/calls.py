"""The two halves of the handshake: the initiator calls until the responder answers.

Each HELLO is a key exchange of its own, with a fresh ephemeral key, because one key must not seal two different HELLOs.
The exchanges of the latest HELLOs stay open: on a long path the answer to one arrives after the next ones have left.

An answer opens a pending session. It becomes the session of the endpoint when the first datagram under its keys
arrives, which only the sender of the HELLO can make: a replayed HELLO opens nothing.

A HELLO is processed in this order, from cheap to expensive:

1. Look up its stamp. If it is not above the newest one that this master has proven, it counts as a replay: the HELLO is
   dropped, or answered with that stamp at a limited rate, because the master's clock may have gone back.
2. Open its payload. A forgery is dropped, and changes nothing. From here on the stamp counts as proven.
3. Make a key exchange, rate-limited for each master, or a refusal, rate-limited for all.

A restarted listener knows no stamps, so replays pass step 1 until the first HELLO of the master itself is opened. Its
stamp is above theirs. From then on they are dropped in step 1, and the master's next HELLO is within the rate limit.
"""

from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from weberlink.protocol import handshake
from weberlink.protocol.events import Address, DropReason
from weberlink.protocol.handshake import Hello, HelloHeader, LocalEnd, Welcome
from weberlink.protocol.security import Incoming, Outgoing, Protection
from weberlink.protocol.session import Session
from weberlink.protocol.states import Role

FIRST_INTERVAL = 0.02
LONGEST_INTERVAL = 0.1
"""Pauses between HELLOs, which double [s]. A slave under a flood of calls reads only a part of them; at ten calls per
second a master gets through."""
OPEN_CALLS = 16
"""HELLOs whose answer is still accepted."""
TOO_LONG_ANSWERS = 3
TOO_LONG_AFTER = 1.0
"""How many answers must have been too late, and for how long [s], until the slave is told that the link is too long.
Only before the first session: a link that was short enough once may be so again."""
PENDING_LIMIT = 8
"""Pending sessions of one master. A HELLO repeated before its answer can be back opens a further one."""
KNOWN_MASTERS = 16
"""Masters remembered, those with the newest stamps: a replay cannot push out a master that calls now."""
EXCHANGE_PACE = 0.01
"""Least time between two key exchanges with one master, each of which takes some 0.2 ms [s]."""
EXCHANGE_PACE_ENGAGED = 0.1
"""The same while there is a session whose peer is heard: other callers can wait [s]."""
REFUSAL_PACE = 0.1
"""Least time between two refusals, which take a key exchange too [s]."""
STALE_PACE = 0.25
"""Least time between two answers to a stamp that is too old [s]."""


class Answer(NamedTuple):
    """An accepting WELCOME."""

    protection: Protection
    peer_clock: float
    """Departure of the WELCOME on the peer's clock [s]."""
    outward_delay: float
    """Raw delay of the HELLO that it answers, as the peer measured it [s]."""
    longest_round_trip: float
    """The largest one that both ends allow [s]."""


class Dialer:
    """Calls the slave, again and again until it answers. The next HELLO is `due` then [s], infinity when not calling.
    `expects` is the name of the slave that is called; the first one that answers sets it."""

    def __init__(
        self,
        end: LocalEnd,
        instance: bytes,
        *,
        stamp: Callable[[float], int],
        takes_over: bool = False,
        patience: float = 0.0,
    ) -> None:
        """Prepare to call.

        Args:
            end: the caller.
            instance: random bytes of this run of it.
            stamp: wall clock [ns] at `now` [s]; if it goes back, stamps go on rising by one.
            takes_over: whether to replace a master that the slave serves, until `confirm`: otherwise two masters would
                take the slave from each other for ever. A slave that has served this run ignores it in any case.
            patience: largest loop age of a session [s]. Pauses between HELLOs grow from a twentieth to a fifth of it,
                at least from `FIRST_INTERVAL` to `LONGEST_INTERVAL`, so that the listener still holds the pending
                session of a HELLO when its answer arrives.
        """
        self._end = end
        self._instance = instance
        self._stamp = stamp
        self._newest = 0
        self._open: OrderedDict[int, Outgoing] = OrderedDict()
        self._first_interval = self._interval = max(FIRST_INTERVAL, 0.05 * patience)
        self._too_long = inf
        self._too_long_since = 0.0
        self._too_long_answers = 0
        self._has_served = False
        self.expects = end.expects
        self._takes_over = takes_over
        self.due = inf

    def start(self, now: float) -> None:
        """Begin a new call; the first HELLO is due at once."""
        self._open.clear()
        self._interval = self._first_interval
        self.due = now

    def stop(self) -> None:
        """Stop calling, and accept no more answers."""
        self._open.clear()
        self.due = inf

    def confirm(self) -> None:
        """Note that the slave serves this master: it has sent a datagram under the keys of a session."""
        self._takes_over = False
        self._has_served = True
        self._too_long_answers = 0

    def find_too_long(self, round_trip: float, now: float) -> None:
        """Note an answer that took longer than both ends allow [s]; the next HELLOs may tell the slave."""
        if self._has_served:
            return
        if not self._too_long_answers:
            self._too_long_since = now
        self._too_long_answers += 1
        self._too_long = min(self._too_long, round_trip)

    def hello(self, now: float) -> bytes:
        """The next HELLO of this call, and schedule the one after it."""
        self.due = now + self._interval
        self._interval = min(2.0 * self._interval, max(LONGEST_INTERVAL, 4.0 * self._first_interval))
        self._newest = max(self._stamp(now), self._newest + 1)
        end, security = self._end, self._end.security
        is_too_long = self._too_long_answers >= TOO_LONG_ANSWERS and now - self._too_long_since >= TOO_LONG_AFTER
        hello = Hello(
            end.agreement,
            round((now - end.epoch) * 1e6),
            end.name,
            self._instance,
            expects=self.expects,
            takes_over=self._takes_over,
            longest_round_trip_us=round(end.longest_round_trip * 1e6),
            round_trip_us=round(self._too_long * 1e6) if is_too_long else 0,
        )
        header = HelloHeader(end.version, handshake.identity_of(end.name), self._newest).pack()
        exchange = security.call(header, end.entropy(security.private_size))
        self._open[self._newest] = exchange
        if len(self._open) > OPEN_CALLS:
            self._open.popitem(last=False)
        return header + exchange.hello(handshake.pack_hello(hello, security.overhead))

    def on_welcome(self, data: bytes) -> Answer | str | DropReason | None:
        """Take a WELCOME: the session that it opens, the text of a refusal, the reason to drop it, or None if it only
        makes the next HELLO due at once."""
        answered = handshake.read_answered(data)
        exchange = None if answered is None else self._open.get(answered)
        if exchange is None:
            return DropReason.UNEXPECTED
        opened = exchange.open(data[handshake.WELCOME_HEADER :])
        if opened is None:
            return DropReason.UNPROVEN
        packed, protection = opened
        body = handshake.read_map(packed) or {}
        if isinstance(refusal := body.get("refusal"), str):
            return refusal
        if "newest" in body:
            return self._catch_up(body["newest"])
        return self._agree(body, protection)

    def _agree(self, body: dict[str, object], protection: Protection) -> Answer | str | DropReason:
        welcome = handshake.read_welcome(body)
        if welcome is None:
            return DropReason.MALFORMED
        if self.expects and welcome.name != self.expects:
            return handshake.unexpected_slave(self.expects, welcome.name)
        self.expects = welcome.name
        longest = min(self._end.longest_round_trip, welcome.longest_round_trip_us * 1e-6)
        return Answer(protection, welcome.clock_us * 1e-6, welcome.delta_us * 1e-6, longest)

    def _catch_up(self, newest: object) -> DropReason | None:
        """The slave knows a later stamp of this master, because our clock went back: continue from there."""
        if type(newest) is not int or abs(newest) >= handshake.LARGEST_STAMP:
            return DropReason.MALFORMED
        if newest <= self._newest:  # it answers an older HELLO
            return DropReason.SUPERSEDED
        self._newest = newest
        self.due = -inf
        return None


Reply = tuple[bytes, str | None]
"""A WELCOME to send to where the HELLO came from, and its text if it refuses."""


@dataclass(slots=True)
class _Master:
    """A master that has proven the key: newest stamp, latest exchange, instance served last, pending sessions."""

    stamp: int
    exchanged_at: float = -inf
    served: bytes = b""
    pending: deque[tuple[Session, Hello, Address]] = field(default_factory=lambda: deque(maxlen=PENDING_LIMIT))


class Listener:
    """Answers HELLOs and keeps the sessions that they may become."""

    def __init__(self, end: LocalEnd, open_session: Callable[[Protection, float, float, float], Session]) -> None:
        """Prepare to be called; `open_session` takes keys, longest round trip, the peer's clock and now [s]."""
        self._end = end
        self._agreement = handshake.read_map(end.agreement) or {}
        self._open_session = open_session
        self._masters: dict[bytes, _Master] = {}
        self._floor = 0
        self._refused_at = self._answered_stale_at = -inf

    @property
    def pending(self) -> tuple[Session, ...]:
        """Sessions that no datagram has confirmed yet."""
        return tuple(session for master in self._masters.values() for session, _, _ in master.pending)

    def confirm(self, session: Session) -> tuple[Hello, Address]:
        """Serve the caller of a pending session, and discard all pending ones; returns its HELLO and address."""
        master, hello, address = next(
            (master, hello, address)
            for master in self._masters.values()
            for pending, hello, address in master.pending
            if pending is session
        )
        master.served = hello.instance
        self.settle()
        return hello, address

    def settle(self) -> None:
        """Discard all pending sessions."""
        for master in self._masters.values():
            master.pending.clear()

    def on_hello(
        self, data: bytes, address: Address, now: float, *, serving: Hello | None = None, is_engaged: bool = False
    ) -> Reply | DropReason:
        """Take a HELLO: the answer to send, never longer than the HELLO, or the reason to drop it.

        `serving` is the master of the present session, `is_engaged` whether it is heard."""
        header = handshake.read_hello_header(data)
        if header is None:
            return DropReason.TRUNCATED
        master = self._masters.get(header.identity)
        newest = self._floor if master is None else master.stamp
        if header.stamp <= newest:
            return self._answer_stale(header, data, newest, now)
        exchange = self._end.security.hear(data[: handshake.HELLO_HEADER], data[handshake.HELLO_HEADER :])
        if exchange is None:
            return DropReason.UNPROVEN
        master = self._remember(header)
        if now < master.exchanged_at + (EXCHANGE_PACE_ENGAGED if is_engaged else EXCHANGE_PACE):
            return DropReason.OVERLOADED
        hello = self._read(header, exchange, serving, is_engaged=is_engaged)
        if isinstance(hello, Hello):
            master.exchanged_at = now
            return self._welcome(header, exchange, hello, master, address, now)
        return hello if isinstance(hello, DropReason) else self._refuse(header, exchange, hello, len(data), now)

    def _answer_stale(self, header: HelloHeader, data: bytes, newest: int, now: float) -> Reply | DropReason:
        """Tell a master whose clock went back which stamp it must exceed, at a limited rate; drop replays."""
        if header.stamp == newest or now < self._answered_stale_at + STALE_PACE:
            return DropReason.REPLAYED
        self._answered_stale_at = now
        exchange = self._end.security.hear(data[: handshake.HELLO_HEADER], data[handshake.HELLO_HEADER :])
        if exchange is None:
            return DropReason.UNPROVEN
        return self._reply(header, exchange, handshake.pack_map({"newest": newest}))

    def _remember(self, header: HelloHeader) -> _Master:
        """Record a stamp as proven. Of too many masters the one with the oldest stamp is forgotten; unknown masters
        must exceed its stamp from then on, so that no replay is accepted."""
        master = self._masters.get(header.identity)
        if master is not None:
            master.stamp = header.stamp
            return master
        if len(self._masters) >= KNOWN_MASTERS:
            oldest = min(self._masters, key=lambda identity: self._masters[identity].stamp)
            self._floor = max(self._floor, self._masters.pop(oldest).stamp)
        self._masters[header.identity] = _Master(header.stamp)
        return self._masters[header.identity]

    def _read(
        self, header: HelloHeader, exchange: Incoming, serving: Hello | None, *, is_engaged: bool
    ) -> Hello | str | DropReason:
        """The content of a HELLO, the text of a refusal, or the reason to drop it."""
        body = handshake.read_map(exchange.payload)
        if body is None:
            return DropReason.MALFORMED
        if header.version != self._end.version:
            return handshake.difference("protocol version", Role.INITIATOR, header.version, self._end.version)
        hello = handshake.read_hello(body)
        agreement = None if hello is None else handshake.read_map(hello.agreement)
        if hello is None or agreement is None or header.identity != handshake.identity_of(hello.name):
            return DropReason.MALFORMED
        if serving is not None and serving.name == hello.name and not is_engaged:
            serving = None  # a restarted master calls in the silence of its former run
        return self._objection(hello, agreement, serving) or hello

    def _objection(self, hello: Hello, agreement: dict[str, object], serving: Hello | None) -> str:
        """Message to the user: why this master gets no session; "" if it does."""
        if hello.expects and hello.expects != self._end.name:
            return handshake.unexpected_slave(hello.expects, self._end.name)
        if self._end.expects and hello.name != self._end.expects:
            return f"slave {self._end.name!r} serves master {self._end.expects!r} only, and {hello.name!r} called"
        if message := handshake.differences(Role.RESPONDER, self._agreement, agreement):
            return message
        longest = min(self._end.longest_round_trip, hello.longest_round_trip_us * 1e-6)
        if hello.round_trip_us * 1e-6 > longest:
            measured = f"{hello.round_trip_us * 1e-3:.0f}"
            return f"the round trip is {measured} ms, link.longest_round_trip_ms allows {longest * 1e3:g}"
        was_served = hello.instance == self._masters[handshake.identity_of(hello.name)].served
        if serving is None or hello.instance == serving.instance or (hello.takes_over and not was_served):
            return ""
        another = "another run of " if hello.name == serving.name else ""
        return f"slave {self._end.name!r} serves {another}master {serving.name!r}; to take it over, use --take-over"

    def _welcome(
        self, header: HelloHeader, exchange: Incoming, hello: Hello, master: _Master, address: Address, now: float
    ) -> Reply | DropReason:
        clock, departure = now - self._end.epoch, hello.clock_us * 1e-6
        own, peers = self._end.longest_round_trip, hello.longest_round_trip_us * 1e-6
        delay_us = round((clock - departure) * 1e6)
        welcome = Welcome(round(clock * 1e6), delay_us, self._end.name, round(own * 1e6))
        answered = self._answer(header, exchange, handshake.pack_map(welcome._asdict()))
        if answered is None:
            return DropReason.MALFORMED
        message, protection = answered
        session = self._open_session(protection, min(own, peers), departure, now)
        master.pending.append((session, hello, address))
        return message, None

    def _refuse(
        self, header: HelloHeader, exchange: Incoming, refusal: str, size: int, now: float
    ) -> Reply | DropReason:
        if now < self._refused_at + REFUSAL_PACE:
            return DropReason.OVERLOADED
        self._refused_at = now
        room = size - handshake.WELCOME_HEADER - self._end.security.overhead
        return self._reply(header, exchange, handshake.pack_refusal(refusal, room), refusal)

    def _reply(
        self, header: HelloHeader, exchange: Incoming, payload: bytes, refusal: str | None = None
    ) -> Reply | DropReason:
        """An answer without a session."""
        answered = self._answer(header, exchange, payload)
        return DropReason.MALFORMED if answered is None else (answered[0], refusal)

    def _answer(self, header: HelloHeader, exchange: Incoming, payload: bytes) -> tuple[bytes, Protection] | None:
        answered = exchange.answer(payload, self._end.entropy(self._end.security.private_size))
        return None if answered is None else (header.pack_answer() + answered[0], answered[1])
