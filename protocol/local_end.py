"""What an endpoint is told of itself: role, agreement, layouts, security, and limits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import msgpack

from weberlink.protocol.events import Statistics
from weberlink.protocol.keys import Right, check_name
from weberlink.protocol.negotiation import LONGEST
from weberlink.protocol.security import REKEY_AFTER, Security
from weberlink.protocol.states import Role
from weberlink.protocol.wire import LONGEST_DATAGRAM, TICK_BITS, DirectionLayout
from weberlink.update import UpdateForm

PROTOCOL_VERSION: Final = 6
PADDED_HELLO: Final = 512
"""A HELLO is at least this long, so that an answer with a reason need not be longer than the HELLO."""
MOST_TICKS: Final = 1 << TICK_BITS - 1  # ticks that the silence limit may span
LONGEST_SILENCE: Final = 10.0
"""Largest silence limit [s]; with the longest round trip and `EXPIRY` far below half of the range of a time stamp."""


@dataclass(eq=False)
class LocalEnd:
    """One end of a link, checked: what its calls and sessions share.

    Args:
        role: the initiator calls its peer; the responder answers whoever proves the key.
        agreement: dotted path to value; must be the same at both ends. Held as the peer reads it.
        outgoing, incoming: by stream (one or two), what its updates carry, by selector.
        security: the suite, with its key.
        entropy: returns that many random bytes, for keys and nonces; must be unpredictable where it matters.
        epoch: `now` of the owner's tick 0 [s].
        tick_period: of both ends [s], > 0.
        silence: time without a fresh datagram after which the peer counts as gone [s]; at most `LONGEST_SILENCE`
            and 2^15 ticks.
        longest_round_trip: of a session [s]; the smaller value of the two ends holds, at most `LONGEST`.
        carries_credit: whether every update and heartbeat, of both ends, carries the sender's credit.
        name: of this end, as the other end shows it; "" for that of its role.
        expects: name of the only peer that is accepted; "" for any. An initiator keeps to the first that answers.
        version: of the protocol; another one than this code's only to study a mismatch.
        rekey_after: datagrams after which a key is replaced, if it was not by time.
        take_over: whether an initiator replaces another master that the slave serves, in its first session.
        stamp: wall clock [ns] at `now` [s]; a responder remembers the stamps of calls. None to count `now`.
        asks: what an initiator wants; other than to drive, it gets `Told` instead of a session.

    Raises:
        ValueError: naming the argument.
    """

    role: Role
    agreement: Mapping[str, object]
    outgoing: Sequence[Sequence[UpdateForm]]
    incoming: Sequence[Sequence[UpdateForm]]
    security: Security
    entropy: Callable[[int], bytes]
    epoch: float
    tick_period: float
    silence: float = 0.1
    longest_round_trip: float = 0.4
    carries_credit: bool = False
    name: str = ""
    expects: str = ""
    version: int = PROTOCOL_VERSION
    rekey_after: int = REKEY_AFTER
    take_over: bool = False
    stamp: Callable[[float], int] | None = None
    asks: Right = Right.DRIVE
    calls: bool = field(init=False)  # whether this end begins the sessions
    packed: bytes = field(init=False)  # the agreement
    sends: DirectionLayout = field(init=False)
    receives: DirectionLayout = field(init=False)
    statistics: Statistics = field(init=False)

    def __post_init__(self) -> None:
        if not (self.tick_period > 0.0 and self.silence > 0.0):
            raise ValueError(f"tick_period and silence must be positive, not {self.tick_period} and {self.silence}")
        most = min(LONGEST_SILENCE, self.tick_period * MOST_TICKS)
        if self.silence > most:
            raise ValueError(f"silence must be at most {most:g} s, not {self.silence}")
        if not 0.0 <= self.longest_round_trip <= LONGEST:
            raise ValueError(f"longest_round_trip must be in 0..{LONGEST:g} s, not {self.longest_round_trip}")
        self.name = check_name(self.name or self.role.value)
        self.expects = check_name(self.expects) if self.expects else ""
        self.sends, self.receives = (
            DirectionLayout(streams, carries_credit=self.carries_credit, acks=len(others))
            for streams, others in ((self.outgoing, self.incoming), (self.incoming, self.outgoing))
        )
        for key, value in self.agreement.items():
            try:
                msgpack.packb({key: value})
            except (TypeError, ValueError, OverflowError) as problem:
                raise ValueError(f"agreement {key!r}: {value!r} cannot be sent to the peer ({problem})") from None
        self.packed = msgpack.packb(dict(self.agreement))
        size, room = len(self.packed), LONGEST_DATAGRAM - PADDED_HELLO
        if size > room:
            raise ValueError(f"the agreement takes {size} bytes, more than {room}")
        self.agreement = msgpack.unpackb(self.packed)
        self.calls = self.role is Role.INITIATOR
        self.statistics = Statistics()
