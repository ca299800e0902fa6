"""Changes that both ends make at the same tick: those that owners propose, and that of the round trip R of a session.

One end proposes, the other answers. A proposal is repeated until it is answered, and each repeat is answered again. An
answer is not acknowledged: if all answers are lost until the tick has passed, the other end makes the change at the
tick, and the proposer makes it when the first answer arrives. Repeats do not wait for an answer to the one before, so
several must be lost until that happens.

R bounds the loop age together with the silence limit. The initiator measures the round trip of the handshake; its first
heartbeats tell it, and open the session. From then on R follows the link: the initiator proposes another value. R rises
as soon as the link needs it, falls slowly, and never exceeds what the user of either end allows. So neither a peer nor
somebody who holds datagrams back can stretch the limits beyond that. The initiator never uses the new value before it
knows that the other end has it. It proposes the next one only when no datagram that used the value before can count any
more: the two values in use are told apart by their parity alone (`weberlink.protocol.liveness`).
"""

from math import ceil, inf
from typing import Final

from weberlink.protocol.events import ChangeAnswered, ChangeProposed
from weberlink.protocol.liveness import Liveness

NUMBERS: Final = 4  # of the proposals of one negotiation; a session has two, whose numbers follow each other
PACE: Final = 0.002
PACE_SHARE: Final = 0.1
"""Time between two repeats: the least [s], and as a share of round trip plus jitter."""
ACCEPTED: Final = b"\x01"
REFUSED: Final = b"\x00"

LONGEST: Final = 10.0  # longest round trip that can be allowed [s]
STEP: Final = 0.01  # R is a multiple of this [s]
NOTHING: Final = 0.001  # a round trip of up to this counts as none [s]
FALL: Final = 0.02
FALL_AFTER: Final = 10.0
"""R falls when the link has needed less by this [s], for so long [s]."""
SWITCH_AHEAD: Final = 0.05  # how far ahead of a proposal the tick of the switch lies, beside two round trips [s]
_BYTES: Final = 2

Message = tuple[int, int, bytes, bool]
"""A proposal or an answer: number of the proposal; tick of the sender at which to make the change, 0 in an answer; what
is to change, or the answer; whether it is an answer."""


class Negotiation:
    """One end's part in the changes of a session: its own proposal, and its answer to the newest one of the peer.

    `place` is which of the negotiations of the session this is; 0 is the owner's. The next message is `due` then [s].
    """

    def __init__(self, place: int = 0) -> None:
        self._first = place * NUMBERS
        self._number = self._first
        self._proposal: Message | None = None
        self._repeat_at = inf
        self._answering: tuple[int, int] | None = None
        self._proposed: ChangeProposed | None = None
        self._answer: Message | None = None
        self.due = inf

    @property
    def is_proposing(self) -> bool:
        return self._proposal is not None

    def propose(self, tick: int, body: bytes, now: float) -> None:
        """Begin a proposal for a tick of ours. Nothing happens while another one waits for its answer."""
        if self._proposal is not None:
            return
        self._number = self._after(self._number)
        self._proposal = self._number, tick, body, False
        self._repeat_at = now
        self.due = min(self.due, now)

    def answer(self, proposal: ChangeProposed, refusal: str | None) -> None:
        """Answer the newest proposal of the peer; `refusal` is None to accept it, else the reason.

        Any other proposal is not answered: one that a newer one has replaced, or one of another session."""
        if self._answering is None or proposal is not self._proposed:
            return
        body = ACCEPTED if refusal is None else REFUSED + refusal.encode(errors="replace")
        self._answer = self._answering[0], 0, body, True
        self.due = -inf

    def take(self, now: float, rtt: float) -> Message | None:
        if self.due == -inf:
            self.due = self._repeat_at
            return self._answer
        self._repeat_at = self.due = now + max(PACE, PACE_SHARE * rtt)
        return self._proposal

    def on_proposal(self, number: int, tick: int, body: bytes, at: float) -> ChangeProposed | None:  # noqa: ARG002
        """Receive a proposal with its full tick, which begins `at` by the mapped clocks, or now if that is past [s];
        None for a repeated one, which is answered again if it is the newest.

        A proposer goes on to the next number only when the last one is answered, so any other number is of the past."""
        if self._answering == (number, tick):
            self.due = self._repeat_at if self._answer is None else -inf
            return None
        if number != self._after(self._first if self._answering is None else self._answering[0]):
            return None
        self._answering, self._answer, self.due = (number, tick), None, self._repeat_at
        self._proposed = ChangeProposed(tick, body)
        return self._proposed

    def on_answer(self, number: int, body: bytes, now: float) -> ChangeAnswered | None:  # noqa: ARG002
        """Receive an answer; None if it answers no present proposal of ours."""
        if self._proposal is None or number != self._proposal[0] or not body:
            return None
        _, tick, proposed, _ = self._proposal
        self._proposal, self._repeat_at = None, inf
        self.due = -inf if self.due == -inf else inf
        return ChangeAnswered(tick, proposed, None if body[:1] == ACCEPTED else body[1:].decode(errors="replace"))

    def _after(self, number: int) -> int:
        return self._first + (number - self._first + 1) % NUMBERS


def rounded_up(round_trip: float) -> float:
    """The least R for a measured round trip [s]."""
    return max(0, ceil((round_trip - NOTHING) / STEP)) * STEP


def in_ms(round_trip: float) -> int:
    """As on the wire."""
    return round(round_trip * 1e3)


class RoundTripAgreement(Negotiation):
    """One end's part in the agreement on R, which `liveness` holds.

    Attributes:
        longest: largest R that both ends allow [s].
        switch_at: when to switch to the agreed value [s]; inf without one.
    """

    def __init__(self, liveness: Liveness, longest: float, tick_period: float, *, proposes: bool) -> None:
        super().__init__(place=1)
        self._liveness = liveness
        self._tick_period = tick_period
        self._proposes = proposes
        self.longest = longest
        self.switch_at = inf
        self._switches_at = 0.0
        self._needed_since = -inf
        self._settled_after = 0.0

    def on_needed(self, needed: float, tick_at: float, now: float) -> None:
        """Propose another value if the link has changed: few round trips exceed `needed`; our clock is at `tick_at`."""
        liveness = self._liveness
        present = liveness.round_trip
        wanted = min(rounded_up(needed), self.longest)
        if wanted >= present - FALL:
            self._needed_since = now
        falls = now - self._needed_since > FALL_AFTER
        if not self._proposes or not (wanted > present or falls) or self.is_proposing or self.switch_at < inf:
            return
        if now - liveness.generation_heard_at <= liveness.limit - present + self._settled_after:
            return  # a datagram with the generation before the present one may still count
        if falls:
            # At most by half: an echo must not wrap while datagrams of the former value are under way.
            wanted = max(wanted, STEP * ceil(0.5 * present / STEP))
        ahead = 2.0 * needed + SWITCH_AHEAD
        self._switches_at = now + ahead
        self._settled_after = max(present, wanted)
        self._needed_since = now
        milliseconds = in_ms(wanted)
        liveness.expect(milliseconds * 1e-3)  # as the peer will, to the last bit
        self.propose(ceil((tick_at + ahead) / self._tick_period), milliseconds.to_bytes(_BYTES, "big"), now)

    def on_proposal(self, number: int, tick: int, body: bytes, at: float) -> None:
        """Answer a proposal of the initiator."""
        proposed = super().on_proposal(number, tick, body, at)
        if proposed is None:
            return
        milliseconds = int.from_bytes(body, "big")
        if self._proposes or len(body) != _BYTES or milliseconds > in_ms(self.longest) or self.switch_at < inf:
            self.answer(proposed, "")
            return
        self._liveness.expect(milliseconds * 1e-3)
        self.switch_at = at
        self.answer(proposed, None)

    def on_answer(self, number: int, body: bytes, now: float) -> None:
        answer = super().on_answer(number, body, now)
        if answer is not None and answer.refusal is None:
            self.switch_at = max(now, self._switches_at)

    def advance(self, now: float) -> bool:
        """Switch if it is time; returns whether R has changed."""
        if now < self.switch_at:
            return False
        self.switch_at = inf
        self._liveness.switch()
        return True
