"""The handshake: two messages that open a session, the comparison of the two configurations, and who is served.

| datagram | in clear, authenticated | then |
|---|---|---|
| HELLO | kind u8, version u8, identity 8s, stamp u64 | first message of the key exchange |
| WELCOME | kind u8, version u8, stamp u64 of the HELLO that it answers | second message |

Little endian. The header of the HELLO is the prologue of the key exchange (`weberlink.protocol.security`), so a changed
header opens no session. The payload of both messages is a msgpack map: that of a HELLO is `Hello`; that of a WELCOME is
`WELCOME_FIELDS`, or `refusal` (text: why there is no session), or `newest` (the stamp that the next HELLO must exceed),
or to a call that does not ask to drive `told` (a map: how the responder is) or `epoch`.
Header and `refusal` are the same in every version from 2 on, so that two versions can tell each other apart.

The identity is a hash of the master's name. The stamp [ns] rises with every HELLO of a master, so that a responder
drops a recorded HELLO for the cost of a look-up. Both messages carry the sender's clock, so the first two datagrams
already map the clocks.

The initiator calls until the responder answers. Each HELLO is a key exchange of its own, with a fresh ephemeral key,
because one key must not seal two different HELLOs. The exchanges of the latest HELLOs stay open: on a long path the
answer to one arrives after the next ones have left.

A key has a right (`weberlink.protocol.keys.Right`), which the responder keeps; a call says what it asks for. Who asks
to watch is told in the WELCOME. Who asks to stop is told the epoch: random bytes of this run of the responder, which
the next HELLO must carry, so that no recorded call stops a later run. The WELCOME to that one leaves when the responder
has stopped. Neither needs an equal configuration.

An answer opens a pending session. It becomes the session of the endpoint when the first datagram under its keys
arrives, which only the sender of the HELLO can make: a replayed HELLO opens nothing.

A HELLO is processed from cheap to expensive: its stamp is looked up, its payload opened, and an answer made at a
limited rate. A restarted listener knows no stamps, so replays are opened until the first HELLO of the master itself is.
Its stamp is above theirs: from then on they are dropped for the look-up, and the master's next HELLO is within the
rate.
"""

from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from math import inf
from struct import Struct
from typing import Any, Final, NamedTuple

import msgpack

from weberlink.protocol.events import Address, DropReason, Told
from weberlink.protocol.keys import Grant, Right, is_name
from weberlink.protocol.local_end import PADDED_HELLO, LocalEnd
from weberlink.protocol.negotiation import in_ms, rounded_up
from weberlink.protocol.session import Session
from weberlink.protocol.wire import Kind

INSTANCE_BYTES: Final = 8
EPOCH_BYTES: Final = 16
LARGEST_STAMP: Final = (1 << 63) - 1
HELLO_HEADER = Struct("<BB8sQ")
WELCOME_HEADER = Struct("<BBQ")
_LONGEST_CLOCK_US: Final = 1 << 53
_NOTHING = object()

FIRST_INTERVAL: Final = 0.02
LONGEST_INTERVAL: Final = 0.1
"""Pauses between HELLOs, which double [s]. A slave under a flood of calls reads only a part of them; at ten calls per
second a master gets through."""
OPEN_CALLS: Final = 16  # HELLOs whose answer is still accepted
TOO_LONG_ANSWERS: Final = 3
TOO_LONG_AFTER: Final = 1.0
"""How many answers must have been too late, and for how long [s], until the slave is told that the link is too long.
Only before the first session: a link that was short enough once may be so again."""
PENDING_LIMIT: Final = 8
"""Pending sessions of one master. A HELLO repeated before its answer can be back opens a further one."""
KNOWN_MASTERS: Final = 16
"""Masters remembered, those with the newest stamps: a replay cannot push out a master that calls now."""
EXCHANGE_PACE: Final = 0.01  # least time between two key exchanges with one master, each of which takes some 0.2 ms [s]
EXCHANGE_PACE_ENGAGED: Final = 0.1  # the same while there is a session whose peer is heard: other callers can wait [s]
REFUSAL_PACE: Final = 0.1  # least time between two refusals, which take a key exchange too [s]
STALE_PACE: Final = 0.25  # least time between two answers to a stamp that is too old [s]


# --- names, maps, and what two ends disagree on


def identity_of(name: str) -> bytes:
    return sha256(name.encode()).digest()[:8]


def pack_map(body: Mapping[str, object]) -> bytes:
    packed: bytes = msgpack.packb(dict(body))
    return packed


def read_map(packed: bytes) -> dict[str, object] | None:
    """A msgpack map with text keys, or None if it is anything else."""
    try:
        body = msgpack.unpackb(packed, strict_map_key=True)
    except (ValueError, OverflowError, RecursionError, msgpack.UnpackException):
        return None
    if not isinstance(body, dict) or not all(isinstance(key, str) for key in body):
        return None
    return body


def differences(master: Mapping[str, object], slave: Mapping[str, object]) -> str:
    """Every key on which the two ends differ, with both values, as a message to the user; "" if they are the same."""

    def said(body: Mapping[str, object], key: str) -> str:
        return repr(body[key]) if key in body else "nothing"

    return "; ".join(
        f"{key}: master has {said(master, key)}, slave has {said(slave, key)}"
        for key in sorted(master.keys() | slave.keys())
        if master.get(key, _NOTHING) != slave.get(key, _NOTHING)
    )


def _unexpected_slave(expected: str, name: str) -> str:
    return f"the master expects slave {expected!r}, and {name!r} answered"


# --- the messages


class Hello(NamedTuple):
    """The first message, which stands for its sender from then on.

    Args:
        expects: name of the slave that it wants; "" for any.
        takes_over: whether a master that the slave serves now is to be replaced.
        longest_round_trip_us: largest one that the sender allows.
        round_trip_us: the one that the sender has measured, if it is longer than what both ends allow; else 0.
        asks: for which `Right`; left out where it is to drive.
        epoch: of the responder, from who asks to stop; left out where it is empty.
    """

    agreement: bytes
    clock_us: int
    name: str
    instance: bytes
    expects: str
    takes_over: bool
    longest_round_trip_us: int
    round_trip_us: int
    asks: str = Right.DRIVE.value
    epoch: bytes = b""


OPTIONAL: Final[Mapping[str, object]] = Hello._field_defaults


def _is_clock(value: object) -> bool:
    return type(value) is int and abs(value) <= _LONGEST_CLOCK_US


def _is_duration(value: object) -> bool:
    return type(value) is int and 0 <= value <= _LONGEST_CLOCK_US


HELLO_FIELDS: Final[Mapping[str, Callable[[object], bool]]] = {
    "agreement": lambda value: isinstance(value, bytes),
    "clock_us": _is_clock,
    "name": is_name,
    "instance": lambda value: isinstance(value, bytes) and len(value) == INSTANCE_BYTES,
    "expects": lambda value: value == "" or is_name(value),
    "takes_over": lambda value: isinstance(value, bool),
    "longest_round_trip_us": _is_duration,
    "round_trip_us": _is_duration,
    "asks": lambda value: value in tuple(Right),
    "epoch": lambda value: isinstance(value, bytes) and len(value) in (0, EPOCH_BYTES),
}
WELCOME_FIELDS: Final[Mapping[str, Callable[[object], bool]]] = {
    "clock_us": _is_clock,
    "delta_us": _is_clock,
    "name": is_name,
    "longest_round_trip_us": _is_duration,
}
"""Checks of each field; `delta_us` is the raw delay of the HELLO as the responder saw it."""


def read_fields(body: Mapping[str, object], checks: Mapping[str, Callable[[object], bool]]) -> list[Any] | None:
    """The fields of a message in the order of their checks, or None if one of them fails."""
    values = [body.get(name, OPTIONAL.get(name)) for name in checks]
    return values if all(check(value) for check, value in zip(checks.values(), values, strict=True)) else None


def pack_hello(hello: Hello, overhead: int) -> bytes:
    """The payload of a HELLO, padded so that the datagram has `PADDED_HELLO` bytes."""
    body = {name: value for name, value in hello._asdict().items() if value != OPTIONAL.get(name, _NOTHING)}
    body["padding"] = b""
    short = PADDED_HELLO - HELLO_HEADER.size - overhead - len(pack_map(body))
    return pack_map({**body, "padding": bytes(max(0, short))})


def pack_refusal(message: str, room: int) -> bytes:
    """The payload of a refusing WELCOME, of at most `room` bytes; a long message is cut."""
    room -= len(pack_map({"refusal": ""})) + 2  # msgpack spends up to two bytes more on the length of a long text
    text = message.encode(errors="replace")
    if len(text) > room:
        text = text[: max(0, room - 3)] + b"..."
    return pack_map({"refusal": text.decode(errors="ignore")})


# --- the two ends


class Dialer:
    """Calls the slave, again and again until it answers.

    Attributes:
        due: time of the next HELLO [s]; infinity when not calling.
        expects: name of the slave that is called; the first one that answers sets it.
        has_served: whether the slave has sent this run a datagram under the keys of a session.
    """

    def __init__(self, end: LocalEnd) -> None:
        self._end = end
        self._instance = end.entropy(INSTANCE_BYTES)  # of this run
        self._newest = 0
        self._open: OrderedDict[int, Any] = OrderedDict()
        # Pauses grow from a twentieth to a fifth of the largest loop age, so that the listener still holds the pending
        # session of a HELLO when its answer arrives.
        self._first_interval = max(FIRST_INTERVAL, 0.05 * (end.silence + end.longest_round_trip))
        self._interval = self._first_interval
        self._too_long = inf
        self._too_long_since = 0.0
        self._too_long_answers = 0
        self.has_served = False
        self.expects = end.expects
        self._epoch = b""
        self.due = inf

    def call(self, now: float) -> bytes:
        """Begin a new call: its first HELLO."""
        self.stop()
        self._interval = self._first_interval
        return self.hello(now)

    def stop(self) -> None:
        """Stop calling, and accept no more answers."""
        self._open.clear()
        self.due = inf

    def hello(self, now: float) -> bytes:
        """The next HELLO of this call, and schedule the one after it."""
        self.due = now + self._interval
        self._interval = min(2.0 * self._interval, max(LONGEST_INTERVAL, 4.0 * self._first_interval))
        end, security, is_first = self._end, self._end.security, not self.has_served
        stamp = max(0, round(now * 1e9)) if end.stamp is None else end.stamp(now)
        self._newest = max(stamp, self._newest + 1)  # if the clock goes back, stamps go on rising by one
        is_long = self._too_long_answers >= TOO_LONG_ANSWERS and now - self._too_long_since >= TOO_LONG_AFTER
        hello = Hello(
            end.packed,
            round((now - end.epoch) * 1e6),
            end.name,
            self._instance,
            expects=self.expects,
            # Once at most: two masters would take the slave from each other for ever.
            takes_over=end.take_over and is_first,
            longest_round_trip_us=round(end.longest_round_trip * 1e6),
            round_trip_us=round(self._too_long * 1e6) if is_long and is_first else 0,
            asks=end.asks.value,
            epoch=self._epoch,
        )
        header = HELLO_HEADER.pack(Kind.HELLO, end.version, identity_of(end.name), self._newest)
        payload = pack_hello(hello, security.overhead)
        message, self._open[self._newest] = security.call(header, end.entropy(security.private_size), payload)
        if len(self._open) > OPEN_CALLS:
            self._open.popitem(last=False)
        return header + message

    def on_welcome(  # noqa: C901, PLR0911 - each reason to drop
        self, data: bytes, now: float
    ) -> Session | Told | str | DropReason | None:
        """Take a WELCOME: the session that it opens, what a call was told that does not ask to drive, the text of a
        refusal, the reason to drop it, or None if it only makes the next HELLO due at once."""
        if len(data) < WELCOME_HEADER.size:
            return DropReason.UNEXPECTED
        state = self._open.get(WELCOME_HEADER.unpack_from(data)[2])
        if state is None:
            return DropReason.UNEXPECTED
        opened = self._end.security.open(state, data[WELCOME_HEADER.size :])
        if opened is None:
            return DropReason.UNPROVEN
        packed, protection = opened
        body = read_map(packed) or {}
        if isinstance(refusal := body.get("refusal"), str):
            return refusal
        if "newest" in body:  # the slave knows a later stamp of this master, because our clock went back
            newest = body["newest"]
            if type(newest) is not int or abs(newest) >= LARGEST_STAMP:
                return DropReason.MALFORMED
            if newest <= self._newest:  # it answers an older HELLO
                return DropReason.SUPERSEDED
            self._newest = newest
            self.due = -inf
            return None
        if self._end.asks is not Right.DRIVE:
            return self._on_told(body)
        welcome = read_fields(body, WELCOME_FIELDS)
        if welcome is None:
            return DropReason.MALFORMED
        clock_us, delta_us, name, longest_us = welcome
        if self.expects and name != self.expects:
            return _unexpected_slave(self.expects, name)
        self.expects = name
        end, peer_clock, outward_delay = self._end, clock_us * 1e-6, delta_us * 1e-6
        longest = min(end.longest_round_trip, longest_us * 1e-6)
        hello_at = end.epoch + peer_clock - outward_delay
        round_trip = now - hello_at
        if in_ms(round_trip) > in_ms(longest):
            if not self.has_served:  # the next HELLOs may tell the slave
                self._too_long_since = self._too_long_since if self._too_long_answers else now
                self._too_long_answers += 1
                self._too_long = min(self._too_long, round_trip)
            return DropReason.STALE
        session = Session(end, protection, peer_clock, now, longest, hello_at)
        session.liveness.agree(min(rounded_up(round_trip), longest), now)
        session.clock.learn(outward_delay, 0.0, 0.0)
        session.measure()
        return session

    def _on_told(self, body: dict[str, object]) -> Told | DropReason | None:
        told, epoch = body.get("told"), body.get("epoch")
        if isinstance(told, dict) and all(isinstance(value, str | int | float) for value in told.values()):
            return Told({str(key): value for key, value in told.items()})
        if not isinstance(epoch, bytes) or len(epoch) != EPOCH_BYTES:
            return DropReason.MALFORMED
        if epoch != self._epoch:  # else an earlier HELLO is answered again
            self._epoch = epoch
            self.due = -inf
        return None


class Pending(NamedTuple):
    """A session that no datagram has confirmed yet, with the HELLO that asked for it, where that came from, and what
    its key is good for."""

    session: Session
    hello: Hello
    address: Address
    grant: Grant


class Reply(NamedTuple):
    """The WELCOME to a HELLO, never longer than that; why it refuses; who asks to stop, by its own epoch."""

    welcome: bytes
    refusal: str | None = None
    stopper: str = ""


@dataclass(slots=True)
class _Master:
    """A master that has proven the key: newest stamp, latest exchange, instance served last, pending sessions."""

    stamp: int
    exchanged_at: float = -inf
    served: bytes = b""
    pending: deque[Pending] = field(default_factory=lambda: deque(maxlen=PENDING_LIMIT))


class Listener:
    """Answers HELLOs and keeps the sessions that they may become. `told` gives what is told to who watches."""

    def __init__(self, end: LocalEnd, told: Callable[[], Mapping[str, object]]) -> None:
        self._end, self._told = end, told
        self._epoch = b""
        self._masters: dict[bytes, _Master] = {}
        self._floor = 0
        self._refused_at = self._answered_stale_at = -inf

    @property
    def pending(self) -> list[Pending]:
        return [pending for master in self._masters.values() for pending in master.pending]

    def confirm(self, pending: Pending) -> None:
        """Serve the caller of a pending session, and discard all pending ones."""
        self._masters[identity_of(pending.hello.name)].served = pending.hello.instance
        self.settle()

    def settle(self) -> None:
        for master in self._masters.values():
            master.pending.clear()

    def on_hello(  # noqa: C901, PLR0911, PLR0912 - each reason to drop
        self, data: bytes, address: Address, now: float, *, serving: Hello | None, is_engaged: bool
    ) -> Reply | DropReason:
        """Take a HELLO: the reply, or the reason to drop it. `serving` is the master of the present session,
        `is_engaged` whether it is heard."""
        if len(data) < PADDED_HELLO:
            return DropReason.TRUNCATED
        _, version, identity, stamp = HELLO_HEADER.unpack_from(data)
        end, security, master = self._end, self._end.security, self._masters.get(identity)
        newest = self._floor if master is None else master.stamp
        is_stale = stamp <= newest
        if is_stale:
            if stamp == newest or now < self._answered_stale_at + STALE_PACE:
                return DropReason.REPLAYED
            self._answered_stale_at = now
        heard = security.hear(data[: HELLO_HEADER.size], data[HELLO_HEADER.size :])
        if heard is None:
            return DropReason.UNPROVEN
        payload, state, grant = heard
        hello: Hello | None = None
        refusal: str | None = None
        if is_stale:
            reply = pack_map({"newest": newest})
        else:
            master = self._remember(identity, stamp)
            # Who may only stop is kept waiting by nobody.
            is_busy = is_engaged and grant.right is not Right.STOP
            if now < master.exchanged_at + (EXCHANGE_PACE_ENGAGED if is_busy else EXCHANGE_PACE):
                return DropReason.OVERLOADED
            judged = self._judge(payload, version, identity, grant, serving, is_engaged=is_engaged)
            if isinstance(judged, DropReason):
                return judged
            if isinstance(judged, Hello):
                hello, master.exchanged_at = judged, now
                reply = pack_map(self._answer(hello, now))
            else:
                if now < self._refused_at + REFUSAL_PACE:
                    return DropReason.OVERLOADED
                self._refused_at, refusal = now, judged
                reply = pack_refusal(refusal, len(data) - WELCOME_HEADER.size - security.overhead)
        answered = security.answer(state, end.entropy(security.private_size), reply)
        if answered is None:
            return DropReason.MALFORMED
        message, protection = answered
        welcome = WELCOME_HEADER.pack(Kind.WELCOME, version, stamp) + message
        if hello is None or master is None:
            return Reply(welcome, refusal)
        if hello.asks == Right.STOP:
            return Reply(welcome, stopper=hello.name if hello.epoch == self._epoch else "")
        if hello.asks == Right.DRIVE:
            longest = min(end.longest_round_trip, hello.longest_round_trip_us * 1e-6)
            session = Session(end, protection, hello.clock_us * 1e-6, now, longest)
            master.pending.append(Pending(session, hello, address, grant))
        return Reply(welcome)

    def _answer(self, hello: Hello, now: float) -> dict[str, object]:
        """What a call is answered that is not refused."""
        end = self._end
        if hello.asks == Right.WATCH:
            return {"told": {"name": end.name, **self._told()}}
        if hello.asks == Right.STOP:
            self._epoch = self._epoch or end.entropy(EPOCH_BYTES)
            return {"told": {"name": end.name}} if hello.epoch == self._epoch else {"epoch": self._epoch}
        clock = now - end.epoch
        return {
            "clock_us": round(clock * 1e6),
            "delta_us": round((clock - hello.clock_us * 1e-6) * 1e6),
            "name": end.name,
            "longest_round_trip_us": round(end.longest_round_trip * 1e6),
        }

    def _remember(self, identity: bytes, stamp: int) -> _Master:
        """Record a stamp as proven. Of too many masters the one with the oldest stamp is forgotten; unknown masters
        must exceed its stamp from then on, so that no replay is accepted."""
        master = self._masters.get(identity)
        if master is None:
            if len(self._masters) >= KNOWN_MASTERS:
                oldest = min(self._masters, key=lambda known: self._masters[known].stamp)
                self._floor = max(self._floor, self._masters.pop(oldest).stamp)
            master = self._masters[identity] = _Master(stamp)
        master.stamp = stamp
        return master

    def _judge(  # noqa: C901, PLR0911 - each reason to refuse
        self, payload: bytes, version: int, identity: bytes, grant: Grant, serving: Hello | None, *, is_engaged: bool
    ) -> Hello | str | DropReason:
        """The content of a HELLO; why its master gets no session, for the user; or the reason to drop it."""
        end, body = self._end, read_map(payload)
        if body is not None and version != end.version:
            return differences({"protocol version": version}, {"protocol version": end.version})
        fields = None if body is None else read_fields(body, HELLO_FIELDS)
        hello = None if fields is None else Hello(*fields)
        agreement = None if hello is None else read_map(hello.agreement)
        if hello is None or agreement is None or identity != identity_of(hello.name):
            return DropReason.MALFORMED
        if hello.expects and hello.expects != end.name:
            return _unexpected_slave(hello.expects, end.name)
        if not grant.right.allows(hello.asks):
            return f"slave {end.name!r}: the key of {hello.name!r} is to {grant.right}, and it asks to {hello.asks}"
        if hello.asks != Right.DRIVE:
            return hello
        if end.expects and hello.name != end.expects:
            return f"slave {end.name!r} serves master {end.expects!r} only, and {hello.name!r} called"
        try:
            message = differences(agreement, end.agreement)
        except RecursionError:  # at a value that is nested too deep to be shown
            return DropReason.MALFORMED
        if message:
            return message
        longest = min(end.longest_round_trip, hello.longest_round_trip_us * 1e-6)
        if hello.round_trip_us * 1e-6 > longest:
            measured = f"{hello.round_trip_us * 1e-3:.0f}"
            return f"the round trip is {measured} ms, link.longest_round_trip_ms allows {longest * 1e3:g}"
        if serving is None or hello.instance == serving.instance or (serving.name == hello.name and not is_engaged):
            return hello  # the last: a restarted master calls in the silence of its former run
        if hello.takes_over and hello.instance != self._masters[identity].served:
            return hello
        another = "another run of " if hello.name == serving.name else ""
        return f"slave {end.name!r} serves {another}master {serving.name!r}; to take it over, use --take-over"
