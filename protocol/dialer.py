"""The initiator's half of the handshake: says HELLO until it is answered. Its mirror is `weberlink.protocol.listener`.

Each HELLO is a key exchange of its own, with a fresh ephemeral key: under one key two different HELLOs must not be
sealed. The exchanges of the latest HELLOs stay open, since on a long path the answer to one comes after the next ones
have left.
"""

from collections import OrderedDict
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from weberlink.protocol.handshake import (
    LARGEST_STAMP,
    WELCOME_HEADER,
    Caller,
    Hello,
    HelloHeader,
    identity_of,
    pack_hello,
    read_answered,
    read_integer,
    read_map,
    read_welcome,
)
from weberlink.protocol.reasons import DropReason
from weberlink.protocol.security import Outgoing, Protection, Security

FIRST_INTERVAL = 0.02
LONGEST_INTERVAL = 0.1
"""A slave under a flood of calls reads a part of what comes; ten calls a second find their way."""
OPEN_CALLS = 16
"""HELLOs whose answer is still taken."""


class Answer(NamedTuple):
    """What a WELCOME that agrees brings: the keys, and one measurement of the link in each direction [s]."""

    protection: Protection
    peer_clock: float
    outward_delay: float
    name: str


class Dialer:
    """One call after another.

    Attributes:
        due: when the next HELLO is to be sent [s]; infinity when not calling.
        expects: name of the slave that is called; "" until it is known. The first that answers sets it.
        takes_over: whether a master that the slave serves is to be replaced; not any more after the first answer, so
            that two masters do not take the slave from each other for ever.
    """

    __slots__ = (
        "_agreement",
        "_caller",
        "_entropy",
        "_epoch",
        "_first_interval",
        "_interval",
        "_newest",
        "_open",
        "_security",
        "_stamp",
        "_version",
        "due",
        "expects",
        "takes_over",
    )

    def __init__(
        self,
        security: Security,
        entropy: Callable[[int], bytes],
        agreement: bytes,
        version: int,
        epoch: float,
        *,
        caller: Caller,
        expects: str = "",
        takes_over: bool = False,
        stamp: Callable[[float], int],
        silence: float = 0.0,
    ) -> None:
        """Prepare to call.

        Args:
            entropy: random bytes of a number, for keys.
            agreement: from `pack_agreement`.
            epoch: when our clock was at 0 [s].
            caller: who calls.
            expects: name of the slave; "" for any.
            takes_over: as of the attribute.
            stamp: wall clock [ns] at `now` [s]; where it goes back, stamps go on rising by one.
            silence: of the session [s]; the round trip is shorter. Pauses grow from a twentieth to a fifth of it, or to
                what is longer, so that the listener keeps the session of each HELLO until its answer is back.
        """
        self._security = security
        self._entropy = entropy
        self._agreement = agreement
        self._version = version
        self._epoch = epoch
        self._caller = caller
        self._stamp = stamp
        self._newest = 0
        self._open: OrderedDict[int, Outgoing] = OrderedDict()
        self._first_interval = self._interval = max(FIRST_INTERVAL, 0.05 * silence)
        self.expects = expects
        self.takes_over = takes_over
        self.due = inf

    def start(self, now: float) -> None:
        """Begin a new call; the first HELLO is due at once."""
        self._open.clear()
        self._interval = self._first_interval
        self.due = now

    def stop(self) -> None:
        """Hang up; an answer that still comes is not expected any more."""
        self._open.clear()
        self.due = inf

    def hello(self, now: float) -> bytes:
        """The next HELLO of this call, and schedule the one after it."""
        self.due = now + self._interval
        self._interval = min(2.0 * self._interval, max(LONGEST_INTERVAL, 4.0 * self._first_interval))
        self._newest = max(self._stamp(now), self._newest + 1)
        hello = Hello(
            self._agreement,
            round((now - self._epoch) * 1e6),
            *self._caller,
            expects=self.expects,
            takes_over=self.takes_over,
        )
        header = HelloHeader(self._version, identity_of(self._caller.name), self._newest).pack()
        exchange = self._security.call(header, self._entropy(self._security.private_size))
        self._open[self._newest] = exchange
        if len(self._open) > OPEN_CALLS:
            self._open.popitem(last=False)
        return header + exchange.hello(pack_hello(hello, self._security.overhead))

    def receive(self, data: bytes) -> Answer | str | DropReason | None:
        """Take a WELCOME.

        Returns:
            The session that it opens, the text of a refusal, why it is of no use, or None if all that follows from it
            is that the next HELLO is due at once.
        """
        answered = read_answered(data)
        exchange = None if answered is None else self._open.get(answered)
        if exchange is None:
            return DropReason.UNEXPECTED
        opened = exchange.open(data[WELCOME_HEADER:])
        if opened is None:
            return DropReason.UNPROVEN
        packed, protection = opened
        body = read_map(packed)
        if body is None:
            return DropReason.MALFORMED
        if isinstance(body.get("refusal"), str):
            return str(body["refusal"])
        if "newest" in body:
            return self._catch_up(body)
        return self._agree(body, protection)

    def _catch_up(self, body: dict[str, object]) -> DropReason | None:
        """The slave has heard a later stamp of this master: our clock went back. Go on from there."""
        newest = read_integer(body, "newest", LARGEST_STAMP - 1)
        if newest is None:
            return DropReason.MALFORMED
        if newest <= self._newest:  # it answers a copy of a HELLO that was repeated since
            return DropReason.SUPERSEDED
        self._newest = newest
        self.due = -inf
        return None

    def _agree(self, body: dict[str, object], protection: Protection) -> Answer | str | DropReason:
        welcome = read_welcome(body)
        if welcome is None:
            return DropReason.MALFORMED
        if self.expects and welcome.name != self.expects:
            return unexpected_slave(self.expects, welcome.name)
        self.expects, self.takes_over = welcome.name, False
        return Answer(protection, welcome.clock_us * 1e-6, welcome.delta_us * 1e-6, welcome.name)


def unexpected_slave(expected: str, name: str) -> str:
    """Why there is no session with another slave than the one that was meant."""
    return f"the master expects slave {expected!r}, and {name!r} answered"
