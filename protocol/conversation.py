"""The conversation with the peer: its state, its present session, and what the owner reads and sends in it."""

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Final

from weberlink.protocol.events import (
    Address,
    ChangeProposed,
    Connected,
    Event,
    PathAnswered,
    PathAsked,
    UpdateLost,
)
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.mailbox import Mailbox, Statistics
from weberlink.protocol.path import Path
from weberlink.protocol.round_trip import LONGEST
from weberlink.protocol.sending import Parameters
from weberlink.protocol.session import LONGEST_SILENCE, Session
from weberlink.protocol.states import Role, State, Trigger, next_state
from weberlink.protocol.wire import LONGEST_CHANGE, TICK_BITS, DirectionLayout
from weberlink.update import Update, UpdateForm

ENCODING_REPORT_S: Final = 0.02
ENCODING_REPORT_TICKS: Final = 10
"""How long an encoder counts as running after its owner last reported it: the longer of the two."""
MOST_TICKS: Final = 1 << TICK_BITS - 1
"""Ticks that the silence limit may span."""
QUIET_SHARE: Final = 0.2
LONGEST_QUIET: Final = 0.05
"""How long nothing must come from the peer's address before another one is used: a share of the silence limit, and the
longest time [s]."""


def session_parameters(
    outgoing: Sequence[Sequence[UpdateForm]],
    incoming: Sequence[Sequence[UpdateForm]],
    *,
    carries_credit: bool,
    epoch: float,
    tick_period: float,
    silence: float,
    longest_round_trip: float,
    opens: bool,
) -> Parameters:
    """Check and combine what all sessions of an endpoint have in common; arguments as of `Endpoint`.

    Raises:
        ValueError: naming the argument.
    """
    if not (tick_period > 0.0 and silence > 0.0):
        raise ValueError(f"tick_period and silence must be positive, not {tick_period} and {silence}")
    if silence > min(LONGEST_SILENCE, tick_period * MOST_TICKS):
        raise ValueError(f"silence must be at most {min(LONGEST_SILENCE, tick_period * MOST_TICKS):g} s, not {silence}")
    if not 0.0 <= longest_round_trip <= LONGEST:
        raise ValueError(f"longest_round_trip must be in 0..{LONGEST:g} s, not {longest_round_trip}")
    forward, backward = (
        DirectionLayout(streams, carries_credit=carries_credit, acks=len(others))
        for streams, others in ((outgoing, incoming), (incoming, outgoing))
    )
    return Parameters(forward, backward, epoch, tick_period, silence, longest_round_trip, opens)


class Conversation:
    """One end of a link between its owner and the sessions, without handshake and timers (`Endpoint` adds them).

    Attributes:
        role: of this end.
        state: of the conversation.
        peer: where the peer is, or was last; None for a responder before the first call.
        sessions: number of sessions that have begun.
        liveness: when the ends last heard each other in the session, or in the last one.
        statistics: counters over all sessions, and present measurements.
    """

    def __init__(
        self,
        role: Role,
        parameters: Parameters,
        agreement: Mapping[str, object],
        entropy: Callable[[int], bytes],
        peer: Address | None,
    ) -> None:
        self.role = role
        self.state = State.IDLE
        self.peer = peer
        self.sessions = 0
        self.statistics = Statistics()
        self.liveness = Liveness(parameters.epoch, parameters.silence, 0.0, -inf)
        self._parameters = parameters
        self._agreement = agreement
        self._entropy = entropy
        self._mailbox = Mailbox(self.statistics)
        self._session: Session | None = None
        self._former: Session | None = None
        self._path: Path | None = None
        self._encoding_reported_at: float | None = None
        self._is_encoding = True
        self._is_peer_heard = False  # true while silent if datagrams of the peer still came as silence fell
        self._due: float | None = None  # read several times a tick; None when it may have changed

    # --- what the owner reads

    def next_event(self) -> Event | None:
        """Take the oldest event; None if there is none."""
        return self._mailbox.next_event()

    def datagrams_to_send(self) -> list[tuple[bytes, Address]]:
        """Take everything to be sent, oldest first."""
        return self._mailbox.datagrams()

    @property
    def silent_at(self) -> float:
        """Time at which a limit is passed if nothing more is heard [s]; infinite while not engaged."""
        if self._session is None or self.state is not State.ENGAGED:
            return inf
        return self._session.silent_at

    def is_peer_encoding(self, now: float) -> bool:
        """Whether the peer's updates may be executed: each end hears the other, and the peer's encoder runs."""
        return self.state is State.ENGAGED and self.liveness.drives(now)

    def peer_time(self, now: float) -> float | None:
        """The peer's clock [s since its epoch]; None while unknown. Divided by the tick period: its tick."""
        return None if self._session is None else self._session.clock.peer_time(now)

    def latest_receivable_peer_time(self, now: float) -> float | None:
        """The peer's clock less the least delay to here [s]; None while unknown.

        Anything that the peer sent before then can have arrived by now; anything later cannot.
        """
        return None if self._session is None else self._session.clock.latest_receivable_peer_time(now)

    @property
    def rtt(self) -> float | None:
        """Round trip of the latest datagrams [s]; None while unknown."""
        return None if self._session is None else self._session.clock.rtt

    @property
    def round_trip_limit(self) -> float:
        """Round trip that both ends have agreed on, by which the loop age may exceed the silence limit [s]."""
        return self.liveness.round_trip

    @property
    def jitter(self) -> float:
        """By how much few datagrams of either direction exceed their least delay [s]."""
        return 0.0 if self._session is None else self._session.clock.jitter

    @property
    def loss_burst(self) -> float:
        """Mean length of the recent runs of lost datagrams of the peer; 0 while fewer than three are known."""
        return self.statistics.incoming_burst

    @property
    def credit(self) -> int:
        """Cumulative count granted to the peer in every datagram; 0 when a session begins.

        Setting it raises ValueError if it would fall. Without a session it stays 0.
        """
        return 0 if self._session is None else self._session.credit.granted

    @credit.setter
    def credit(self, count: int) -> None:
        session = self._session
        if session is not None and session.credit.granted != count:
            session.credit.granted = count
            session.sender.heartbeats.granted(count)
            self._due = None

    @property
    def peer_credit(self) -> int:
        """Cumulative count granted by the peer in this session, as far as known: never more than it granted."""
        return 0 if self._session is None else self._session.credit.known

    # --- what the owner sends

    def send_update(self, now: float, update: Update, stream: int = 0) -> bool:
        """Send a new state of a stream to the peer, and repeat it until it arrives.

        A silent peer is sent the update too; it is repeated once the peer is back.

        Args:
            now: [s].
            update: its tick is counted from the epoch.
            stream: which it belongs to, from 0.

        Returns:
            False if there is no session, and nothing was sent.

        Raises:
            ValueError: naming what cannot be sent.
        """
        if self._session is None:
            return False
        self._due = None
        self._is_encoding = True
        self._post(self._session.sender.send_update(now, update, stream))
        return True

    def report_encoding(self, now: float, *, is_encoding: bool) -> None:
        """Report in every tick whether the encoder of this end runs, which every datagram tells the peer.

        An owner that has reported and then stops counts as not encoding; one that never reports counts as encoding.
        """
        self._encoding_reported_at = now
        if is_encoding is not self._is_encoding:
            self._is_encoding = is_encoding
            self._tell_encoding()

    def request_full_state(self) -> None:
        """Tell the peer that the owner holds none of its updates any more, so that it sends complete ones."""
        if self._session is not None:
            self._session.request_full_state()

    def propose_change(self, now: float, tick: int, body: bytes) -> bool:
        """Propose that both ends change something at the same tick; `ChangeAnswered` follows.

        Args:
            tick: of ours, at which the change is to be made; far enough ahead for the answer to come back.
            body: what is to change, 1 to `LONGEST_CHANGE` bytes.

        Returns:
            False, and nothing is proposed, without an engaged peer or while an earlier proposal waits for its answer.

        Raises:
            ValueError: the body is empty or too long.
        """
        if not 1 <= len(body) <= LONGEST_CHANGE:
            raise ValueError(f"a change takes 1 to {LONGEST_CHANGE} bytes, not {len(body)}")
        if self._session is None or self.state is not State.ENGAGED or self._session.sender.negotiation.is_proposing:
            return False
        self._session.sender.negotiation.propose(tick, body, now)
        self._due = None
        return True

    def answer_change(self, proposal: ChangeProposed, refusal: str | None) -> None:
        """Answer a change that the peer has proposed, unless its session is over or it has proposed another one since.

        Args:
            proposal: the event itself, which belongs to its session.
            refusal: None to accept it, else a short reason.
        """
        if self._session is not None:
            self._session.sender.negotiation.answer(proposal, refusal)
            self._due = None

    # --- sessions

    def _turn(self, trigger: Trigger) -> None:
        self.state = next_state(self.state, trigger)

    def _post(self, datagram: bytes) -> None:
        assert self.peer is not None
        self._mailbox.post(datagram, self.peer)

    def _tell_encoding(self) -> None:
        """Tell the peer at once if our encoder has started or stopped."""
        if self._session is None or self.state is not State.ENGAGED:
            return
        sender = self._session.sender
        if sender.said_encoding is not self._is_encoding:
            sender.heartbeats.asked()
            self._due = None

    def _session_due(self) -> float:
        """Time of the next action of the present session [s]; infinite without one."""
        session, is_engaged = self._session, self.state is State.ENGAGED
        if session is None:
            return inf
        due = session.sender.next_timer(is_engaged=is_engaged, is_encoding=self._is_encoding)
        return min(due, session.silent_at if is_engaged else session.expires_at, self._deaf_at)

    @property
    def _deaf_at(self) -> float:
        """When a peer that was still heard as silence fell is no longer heard either [s]; infinite without one."""
        return self.liveness.heard_at + self._parameters.silence if self._is_peer_heard else inf

    def _send_due(self, now: float) -> None:
        """Send what is due in the present session, and report lost updates to the owner."""
        session, is_engaged = self._session, self.state is State.ENGAGED
        if session is None:
            return
        if is_engaged:
            limit = max(ENCODING_REPORT_S, ENCODING_REPORT_TICKS * self._parameters.tick_period)
            if self._encoding_reported_at is not None and now - self._encoding_reported_at > limit:
                self._is_encoding = False
            for stream in session.sender.take_lost(now) if self._is_encoding else ():
                self._mailbox.tell(UpdateLost(stream))
        while (
            datagram := session.sender.handle_timer(now, is_engaged=is_engaged, is_encoding=self._is_encoding)
        ) is not None:
            self._post(datagram)

    def _establish(self, session: Session, address: Address) -> None:
        self._turn(Trigger.ESTABLISH)
        self._end_session()
        self._session = session
        self.sessions += 1
        self.liveness = session.liveness
        self._tell_encoding()
        self.peer = address
        if self.role is Role.RESPONDER:
            self._path = Path(address, self._entropy, min(LONGEST_QUIET, QUIET_SHARE * self._parameters.silence))
        self._mailbox.begin(Connected(address, self._agreement))

    def _end_session(self) -> None:
        self._path = None
        self._is_peer_heard = False
        if self._session is not None:
            self._former, self._session = self._session, None

    def _locate(self, path: Path, session: Session, source: Address, now: float) -> None:
        """Record where an authentic datagram came from."""
        path.hear(source, now, is_fresh=session.is_newest and session.is_fresh)
        self.peer = path.address
        if (challenge := path.challenge(now)) is not None:
            token, target = challenge
            self._mailbox.post(session.sender.send_path(now, token, is_answer=False), target)

    def _take_path(self, session: Session, outcome: PathAsked | PathAnswered, source: Address, now: float) -> None:
        """Answer the question whether this end is at an address, or take the answer to ours."""
        if isinstance(outcome, PathAsked):
            self._mailbox.post(session.sender.send_path(now, outcome.token, is_answer=True), source)
        elif self._path is not None:
            self._path.answer(outcome.token, now)
            self.peer = self._path.address
