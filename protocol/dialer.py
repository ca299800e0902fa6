"""The initiator's half of the handshake: send HELLOs until `weberlink.protocol.listener` answers one.

Each HELLO is a key exchange of its own, with a fresh ephemeral key, because one key must not seal two different HELLOs.
The exchanges of the latest HELLOs stay open: on a long path the answer to one arrives after the next ones have left.
"""

from collections import OrderedDict
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from weberlink.protocol.events import DropReason
from weberlink.protocol.handshake import (
    LARGEST_STAMP,
    WELCOME_HEADER,
    Hello,
    HelloHeader,
    LocalEnd,
    identity_of,
    pack_hello,
    read_answered,
    read_map,
    read_welcome,
    unexpected_slave,
)
from weberlink.protocol.security import Outgoing, Protection

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
        header = HelloHeader(end.version, identity_of(end.name), self._newest).pack()
        exchange = security.call(header, end.entropy(security.private_size))
        self._open[self._newest] = exchange
        if len(self._open) > OPEN_CALLS:
            self._open.popitem(last=False)
        return header + exchange.hello(pack_hello(hello, security.overhead))

    def on_welcome(self, data: bytes) -> Answer | str | DropReason | None:
        """Take a WELCOME: the session that it opens, the text of a refusal, the reason to drop it, or None if it only
        makes the next HELLO due at once."""
        answered = read_answered(data)
        exchange = None if answered is None else self._open.get(answered)
        if exchange is None:
            return DropReason.UNEXPECTED
        opened = exchange.open(data[WELCOME_HEADER:])
        if opened is None:
            return DropReason.UNPROVEN
        packed, protection = opened
        body = read_map(packed) or {}
        if isinstance(refusal := body.get("refusal"), str):
            return refusal
        if "newest" in body:
            return self._catch_up(body["newest"])
        return self._agree(body, protection)

    def _agree(self, body: dict[str, object], protection: Protection) -> Answer | str | DropReason:
        welcome = read_welcome(body)
        if welcome is None:
            return DropReason.MALFORMED
        if self.expects and welcome.name != self.expects:
            return unexpected_slave(self.expects, welcome.name)
        self.expects = welcome.name
        longest = min(self._end.longest_round_trip, welcome.longest_round_trip_us * 1e-6)
        return Answer(protection, welcome.clock_us * 1e-6, welcome.delta_us * 1e-6, longest)

    def _catch_up(self, newest: object) -> DropReason | None:
        """The slave knows a later stamp of this master, because our clock went back: continue from there."""
        if type(newest) is not int or abs(newest) >= LARGEST_STAMP:
            return DropReason.MALFORMED
        if newest <= self._newest:  # it answers an older HELLO
            return DropReason.SUPERSEDED
        self._newest = newest
        self.due = -inf
        return None
