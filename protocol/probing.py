"""An initiator that measures the link: it asks the peer over and over whether it is there, and notes the answers.

Every end answers such a question at once (`Kind.PATH`), whatever else it does. So the measurement needs no other
program at the peer, and its datagrams are as long and as well protected as those of the session.

The peer stamps an answer when it leaves, which is when the question arrived. So each answer tells the delay of both
directions, and the numbers of the peer's datagrams tell whether a question or its answer was lost.
"""

from typing import Any, NamedTuple

from weberlink.protocol.counters import SEQUENCE_BITS, expand_counter
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address, DropReason, PathAnswered, PathAsked
from weberlink.protocol.session import Outcome, Session
from weberlink.protocol.wire import CLEAR_BYTES, TOKEN_BYTES, sequence_of


class Heard(NamedTuple):
    """An authentic datagram of the peer.

    Args:
        session: number of the session, from 0.
        sequence: number of the datagram.
        at: arrival [s].
        question: number of the question that it answers; None for any other datagram.
        delay: from the peer to here [s], by the clocks mapped as `weberlink.protocol.timing` says; None while unknown.
    """

    session: int
    sequence: int
    at: float
    question: int | None
    delay: float | None


class ProbingEndpoint(Endpoint):
    """An initiator with questions to the peer. It sends no updates unless its owner does.

    Attributes:
        asked: departure of each question [s].
        heard: every authentic datagram of the peer, once, in the order of arrival.
    """

    def __init__(self, **arguments: Any) -> None:
        """Compose one end; arguments as of `Endpoint`."""
        super().__init__(**arguments)
        self.asked: list[float] = []
        self.heard: list[Heard] = []
        self._sessions = -1
        self._newest = self._arriving = 0
        self._answered: int | None = None

    def ask(self, now: float) -> bool:
        """Send a question; False if there is no session, and nothing was sent."""
        session = self._session
        if session is None:
            return False
        self._due = None
        token = len(self.asked).to_bytes(TOKEN_BYTES, "big")
        self.asked.append(now)
        self._post(session.sender.send_path(now, token, is_answer=False))
        return True

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        self._arriving = sequence_of(data) if len(data) >= CLEAR_BYTES else 0
        super().receive_datagram(data, address, now)

    def _establish(self, session: Session, address: Address) -> None:
        self._sessions += 1
        self._newest = 0
        super()._establish(session, address)

    def _follow(self, session: Session, outcome: Outcome, address: Address, now: float) -> None:
        self._answered = None
        super()._follow(session, outcome, address, now)
        if outcome is DropReason.REPLAYED:
            return
        sequence = expand_counter(self._arriving, SEQUENCE_BITS, self._newest + 1)
        self._newest = max(self._newest, sequence)
        self.heard.append(Heard(self._sessions, sequence, now, self._answered, session.clock.one_way))

    def _take_path(self, session: Session, outcome: PathAsked | PathAnswered, source: Address, now: float) -> None:
        if isinstance(outcome, PathAnswered):
            number = int.from_bytes(outcome.token, "big")
            self._answered = number if number < len(self.asked) else None
        super()._take_path(session, outcome, source, now)
