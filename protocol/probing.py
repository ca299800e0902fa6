"""An initiator that measures the link: it asks the peer over and over whether it is there, and notes the answers.

Every end answers such a question at once (`Kind.PATH`), whatever else it does. So the measurement needs no other
program at the peer, and its datagrams are as long and as well protected as those of the session. The peer stamps an
answer when it leaves, which is when the question arrived: each answer tells the delay of both directions, and the
numbers of the peer's datagrams tell whether a question or its answer was lost.
"""

from typing import NamedTuple

from weberlink.protocol import wire
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address, DropReason, PathProbe
from weberlink.protocol.session import Outcome, Session


class Heard(NamedTuple):
    """An authentic datagram of the peer: number of the session, from 0; its own number; arrival [s]; the question that
    it answers, None for any other datagram; delay from the peer to here by the mapped clocks [s], None while
    unknown."""

    session: int
    sequence: int
    at: float
    question: int | None
    delay: float | None


class ProbingEndpoint(Endpoint):
    """An initiator with questions to the peer: when each was `asked` [s], and each authentic datagram `heard`."""

    asked: list[float]
    heard: list[Heard]

    def begin(self, now: float) -> None:
        """Forget what was asked and heard, and call the peer."""
        self.asked, self.heard = [], []
        self.connect(now)

    def ask(self, now: float) -> bool:
        """Send a question; False if there is no session, and nothing was sent."""
        session = self._session
        if session is None:
            return False
        self._due = None
        self._post(session.send(now, wire.PATH, len(self.asked).to_bytes(wire.TOKEN_BYTES, "big")))
        self.asked.append(now)
        return True

    def _on_authentic(self, session: Session, outcome: Outcome, address: Address, now: float) -> None:
        super()._on_authentic(session, outcome, address, now)
        if outcome is DropReason.REPLAYED:
            return
        question: int | None = None
        if isinstance(outcome, PathProbe) and outcome.is_answer:
            number = int.from_bytes(outcome.token, "big")
            question = number if number < len(self.asked) else None
        self.heard.append(Heard(self.sessions - 1, session.sequence, now, question, session.clock.one_way))
