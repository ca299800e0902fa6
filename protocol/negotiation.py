"""Negotiation of parameter changes that both ends make at the same tick.

One end proposes, the other answers. A proposal is repeated until it is answered, and each repeat is answered again. An
answer is not acknowledged: if all answers are lost until the tick has passed, the other end makes the change at the
tick, and the proposer makes it when the first answer arrives. Repeats do not wait for an answer to the one before, so
several must be lost until that happens.
"""

from math import inf
from typing import NamedTuple

from weberlink.protocol.events import ChangeAnswered, ChangeProposed

NUMBERS = 4
"""Of the proposals of one negotiation; a session has two (`NEGOTIATIONS`), whose numbers follow each other."""
NEGOTIATIONS = 2
PACE, PACE_SHARE = 0.002, 0.1
"""Time between two repeats: the least [s], and as a share of round trip plus jitter."""
ACCEPTED, REFUSED = b"\x01", b"\x00"


class Change(NamedTuple):
    """A proposal or an answer: number of the proposal; tick of the sender at which to make the change, 0 in an answer;
    what is to change, or the answer."""

    number: int
    tick: int
    body: bytes
    is_answer: bool


class ParameterNegotiation:
    """One end's part in the changes of a session: its own proposal, and its answer to the newest one of the peer.

    `place` is which of the negotiations of the session this is; 0 is the owner's."""

    def __init__(self, place: int = 0) -> None:
        self._first = place * NUMBERS
        self._number = self._first
        self._proposal: Change | None = None
        self._due = inf
        self._answering: tuple[int, int] | None = None
        self._proposed: ChangeProposed | None = None
        self._answer: Change | None = None
        self._answer_due = False

    @property
    def is_proposing(self) -> bool:
        """Whether a proposal of ours waits for its answer."""
        return self._proposal is not None

    @property
    def due(self) -> float:
        """Time of the next message [s]."""
        return -inf if self._answer_due else self._due

    def propose(self, tick: int, body: bytes, now: float) -> None:
        """Begin a proposal for a tick of ours. Nothing happens while another one waits for its answer."""
        if self._proposal is not None:
            return
        self._number = self._after(self._number)
        self._proposal = Change(self._number, tick, body, is_answer=False)
        self._due = now

    def answer(self, proposal: ChangeProposed, refusal: str | None) -> None:
        """Answer the newest proposal of the peer; `refusal` is None to accept it, else the reason.

        Any other proposal is not answered: one that a newer one has replaced, or one of another session.
        """
        if self._answering is None or proposal is not self._proposed:
            return
        body = ACCEPTED if refusal is None else REFUSED + refusal.encode(errors="replace")
        self._answer = Change(self._answering[0], 0, body, is_answer=True)
        self._answer_due = True

    def take(self, now: float, rtt: float) -> Change | None:
        """The message that is due."""
        if self._answer_due:
            self._answer_due = False
            return self._answer
        self._due = now + max(PACE, PACE_SHARE * rtt)
        return self._proposal

    def heard_proposal(self, number: int, tick: int, body: bytes) -> ChangeProposed | None:
        """Receive a proposal with its full tick; None for a repeated one, which is answered again if it is the newest.

        A proposer goes on to the next number only when the last one is answered, so any other number is of the past.
        """
        if self._answering == (number, tick):
            self._answer_due = self._answer is not None
            return None
        if number != self._after(self._first if self._answering is None else self._answering[0]):
            return None
        self._answering, self._answer, self._answer_due = (number, tick), None, False
        self._proposed = ChangeProposed(tick, body)
        return self._proposed

    def heard_answer(self, number: int, body: bytes) -> ChangeAnswered | None:
        """Receive an answer; None if it answers no present proposal of ours."""
        proposal = self._proposal
        if proposal is None or number != proposal.number or not body:
            return None
        self._proposal, self._due = None, inf
        refusal = None if body[:1] == ACCEPTED else body[1:].decode(errors="replace")
        return ChangeAnswered(proposal.tick, proposal.body, refusal)

    def _after(self, number: int) -> int:
        return self._first + (number - self._first + 1) % NUMBERS
