"""Agree on the round trip R of a session, which bounds the loop age together with the silence limit.

The initiator measures the round trip of the handshake; its first heartbeats tell it, and open the session. From then
on R follows the link: the initiator proposes another value and the tick at which both ends switch to it. R rises as
soon as the link needs it, falls slowly, and never exceeds what the user of either end allows. So neither a peer nor
somebody who holds datagrams back can stretch the limits beyond that.

The initiator never uses the new value before it knows that the other end has it. It proposes the next one only when no
datagram that used the value before can count any more: the two values in use are told apart by their parity alone
(`weberlink.protocol.liveness`).
"""

from math import ceil, inf
from typing import Final

from weberlink.protocol.liveness import Liveness
from weberlink.protocol.negotiation import ParameterNegotiation

LONGEST: Final = 10.0
"""Longest round trip that can be allowed [s]."""
STEP: Final = 0.01
"""R is a multiple of this [s]."""
NOTHING: Final = 0.001
"""A round trip of up to this counts as none [s]."""
FALL: Final = 0.02
FALL_AFTER: Final = 10.0
"""R falls when the link has needed less by this [s], for so long [s]."""
SWITCH_AHEAD: Final = 0.05
"""How far ahead of a proposal the tick of the switch lies, beside two round trips [s]."""
_BYTES: Final = 2


def rounded_up(round_trip: float) -> float:
    """The least R for a measured round trip [s]."""
    return max(0, ceil((round_trip - NOTHING) / STEP)) * STEP


def in_ms(round_trip: float) -> int:
    """As on the wire."""
    return round(round_trip * 1e3)


class RoundTripAgreement:
    """One end's part in the agreement on R, which `liveness` holds.

    Attributes:
        longest: largest R that both ends allow [s].
        switch_at: when to switch to the agreed value [s]; inf without one.
    """

    def __init__(self, liveness: Liveness, longest: float, tick_period: float, *, proposes: bool) -> None:
        self._liveness = liveness
        self._tick_period = tick_period
        self._proposes = proposes
        self.longest = longest
        self.negotiation = ParameterNegotiation(place=1)
        self.switch_at = inf
        self._switches_at = 0.0
        self._needed_since = -inf
        self._settled_after = 0.0

    def open(self, told_ms: int, now: float) -> bool:
        """Begin with the R that the initiator tells; False if the user does not allow it."""
        if told_ms > in_ms(self.longest):
            return False
        self._liveness.agree(told_ms * 1e-3, now)
        return True

    def follow(self, needed: float, tick_at: float, now: float) -> None:
        """Propose another value if the link has changed: few round trips exceed `needed`; our clock is at `tick_at`."""
        liveness = self._liveness
        present = liveness.round_trip
        wanted = min(rounded_up(needed), self.longest)
        if wanted >= present - FALL:
            self._needed_since = now
        falls = now - self._needed_since > FALL_AFTER
        if not self._proposes or not (wanted > present or falls) or not self._is_settled(now):
            return
        if falls:
            # At most by half: an echo must not wrap while datagrams of the former value are under way.
            wanted = max(wanted, STEP * ceil(0.5 * present / STEP))
        ahead = 2.0 * needed + SWITCH_AHEAD
        tick = ceil((tick_at + ahead) / self._tick_period)
        self._switches_at = now + ahead
        self._settled_after = max(present, wanted)
        self._needed_since = now
        liveness.expect(wanted)
        self.negotiation.propose(tick, in_ms(wanted).to_bytes(_BYTES, "big"), now)

    def _is_settled(self, now: float) -> bool:
        """Whether no datagram with the generation before the present one can count any more."""
        liveness = self._liveness
        if self.negotiation.is_proposing or self.switch_at < inf:
            return False
        past = liveness.limit - liveness.round_trip + self._settled_after
        return now - liveness.generation_heard_at > past

    def take_proposal(self, number: int, tick: int, body: bytes, ahead: float, now: float) -> None:
        """Answer a proposal of the initiator; `ahead` is how far its tick is from now, by the mapped clocks [s]."""
        proposed = self.negotiation.heard_proposal(number, tick, body)
        if proposed is None:
            return
        milliseconds = int.from_bytes(body, "big")
        if self._proposes or len(body) != _BYTES or milliseconds > in_ms(self.longest) or self.switch_at < inf:
            self.negotiation.answer(proposed, "")
            return
        self._liveness.expect(milliseconds * 1e-3)
        self.switch_at = now + max(ahead, 0.0)
        self.negotiation.answer(proposed, None)

    def take_answer(self, number: int, body: bytes, now: float) -> None:
        """Take an answer to our proposal."""
        answer = self.negotiation.heard_answer(number, body)
        if answer is not None and answer.refusal is None:
            self.switch_at = max(now, self._switches_at)

    def advance(self, now: float) -> bool:
        """Switch if it is time; returns whether R has changed."""
        if now < self.switch_at:
            return False
        self.switch_at = inf
        self._liveness.switch()
        return True
