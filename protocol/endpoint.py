"""One end of a link: states, sessions and queues; everything else is delegated.

Pure: driven by its owner (`send_update`), the network (`receive_datagram`) and time (`handle_timer`), each with
`now`, and answering through `datagrams_to_send`, `next_timer` and `next_event`. What a peer does wrong is an event
and a count, never an exception. Knows no codec: it carries integers that it does not interpret.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf

from protocol.dialer import Dialer
from protocol.direction import Direction
from protocol.events import (
    Address,
    Connected,
    Event,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    TakenOver,
    UpdateReceived,
)
from protocol.handshake import PROTOCOL_VERSION, pack_agreement, read_map
from protocol.listener import Listener
from protocol.mailbox import Mailbox
from protocol.reasons import DropReason
from protocol.roles import Role
from protocol.security import Protection, Security
from protocol.session import Opened, Outcome, Parameters, Session
from protocol.states import State, Trigger, next_state
from protocol.statistics import Statistics
from protocol.wire import LONGEST_CHANGE, LONGEST_DATAGRAM, Kind, kind_of, length_fault

_HANDSHAKE = frozenset((Kind.HELLO, Kind.WELCOME))


class Endpoint:
    """One end of a link.

    The life of an initiator: `connect`, then `Connected` (or `Refused`, which is final), updates, `PeerSilent` and
    `PeerReturned` in the same session or `Connected` in a new one. It calls again by itself whenever the peer is gone.
    A responder does the same from the other side and goes on listening, until `close`.

    Attributes, which the owner reads:
        state: where the conversation stands.
        heard_at: when the last fresh authentic datagram came from the peer [s]; -inf before the first.
        statistics: counters and measurements, which go on.
    """

    __slots__ = (
        "_address",
        "_agreement",
        "_dialer",
        "_due",
        "_former",
        "_lengths",
        "_listener",
        "_mailbox",
        "_parameters",
        "_role",
        "_session",
        "heard_at",
        "state",
        "statistics",
    )

    def __init__(
        self,
        *,
        role: Role,
        agreement: Mapping[str, object],
        outgoing_values: Sequence[int],
        incoming_values: Sequence[int],
        security: Security,
        entropy: Callable[[int], bytes],
        epoch: float,
        tick_period: float,
        silence: float = 0.1,
        peer: Address | None = None,
        version: int = PROTOCOL_VERSION,
        carries_credit: bool = False,
    ) -> None:
        """Compose one end.

        Args:
            role: the initiator calls `peer`; the responder answers whoever proves the key.
            agreement: dotted path to value; must be the same at both ends.
            outgoing_values, incoming_values: levels in a sample of each stream of each direction; one stream or two.
            security: the suite, with its key.
            entropy: random bytes of a number, for keys and nonces; must be unpredictable where it matters.
            epoch: `now` of the owner's tick 0 [s].
            tick_period: of both ends [s], > 0.
            silence: age beyond which no update is delivered, and the silence beyond which a peer counts as gone [s].
            peer: whom an initiator calls.
            version: of the protocol; another one than this code's only to study a mismatch.
            carries_credit: whether every update and heartbeat, of both ends, carries the sender's `credit`; follows
                from something in the agreement.

        Raises:
            ValueError: naming the argument.
        """
        if role is Role.INITIATOR and peer is None:
            raise ValueError("peer: an initiator must be told whom to call")
        if not (tick_period > 0.0 and silence > 0.0):
            raise ValueError(f"tick_period and silence must be positive, not {tick_period} and {silence}")
        outgoing, incoming = (
            Direction(values, carries_credit=carries_credit, further_acks=len(others) - 1)
            for values, others in ((outgoing_values, incoming_values), (incoming_values, outgoing_values))
        )
        packed = pack_agreement(agreement)
        self._agreement: dict[str, object] = read_map(packed) or {}
        self._role = role
        self._address = peer
        self.state = State.IDLE
        self.statistics = Statistics()
        self._parameters = Parameters(outgoing, incoming, epoch, tick_period, silence)
        self._lengths = self._parameters.incoming.lengths(security.tag_size)
        self._dialer = Dialer(security, entropy, packed, version, epoch)
        self._listener = Listener(security, entropy, self._agreement, version, epoch, self._open_session)
        self._session: Session | None = None
        self._former: Session | None = None
        self.heard_at = -inf
        self._due: float | None = None  # asked for several times a tick; None when it may have changed
        self._mailbox = Mailbox(self.statistics)

    # --- what the owner reads

    @property
    def role(self) -> Role:
        return self._role

    @property
    def peer(self) -> Address | None:
        """Where the peer is, or was last; None for a responder that nobody has called."""
        return self._address

    @property
    def silent_at(self) -> float:
        """When the peer counts as gone if nothing fresh is heard until then [s]; infinite while it is not there."""
        return self.heard_at + self._parameters.silence if self.state is State.ENGAGED else inf

    @property
    def confirmed_at(self) -> float:
        """Departure of our newest datagram that the peer is known to have heard [s]."""
        return self.heard_at

    @property
    def encoder_heard_at(self) -> float:
        """Arrival of the newest datagram that says that the peer's encoder runs [s]."""
        return self.heard_at

    def is_peer_encoding(self, now: float) -> bool:  # noqa: ARG002
        """Whether what the peer encodes may be acted on."""
        return self.state is State.ENGAGED

    def silent_for(self, now: float) -> float:
        """The larger of the loop age and the time since the peer's encoder was known to run [s]."""
        return now - self.heard_at

    def attest(self, now: float, *, is_encoding: bool) -> None:
        """Say, once a tick, whether the owner's encoder runs."""

    def peer_time(self, now: float) -> float | None:
        """The peer's clock [s since its epoch]; None while it is not known. Divided by the tick period: its tick."""
        return None if self._session is None else self._session.clock.peer_time(now)

    @property
    def credit(self) -> int:
        """Cumulative count handed to the peer, stamped into each datagram as it is made; 0 when a session begins.

        Setting it raises ValueError where it would fall; without a session there is nobody to hand to, and it stays 0.
        """
        return 0 if self._session is None else self._session.credit.handed

    @credit.setter
    def credit(self, count: int) -> None:
        if self._session is not None:
            self._session.credit.handed = count

    @property
    def peer_credit(self) -> int:
        """Cumulative count that the peer has handed over in this session, as far as known: never more than it was."""
        return 0 if self._session is None else self._session.credit.known

    @property
    def rtt(self) -> float | None:
        """Round trip of the latest datagrams [s]; None while it is not known."""
        return None if self._session is None else self._session.clock.rtt

    @property
    def jitter(self) -> float:
        """By how much few datagrams of either direction exceed their least delay [s]."""
        return 0.0 if self._session is None else self._session.clock.jitter

    def heard_time(self, now: float) -> float | None:
        """The part of the peer's clock that can have been heard by now [s]: its time less the least delay to here.

        What the peer did not send before then it had no need to send; what it does later is not known yet.
        """
        return None if self._session is None else self._session.clock.heard_time(now)

    def next_event(self) -> Event | None:
        """The oldest event not yet taken."""
        return self._mailbox.next_event()

    def datagrams_to_send(self) -> list[tuple[bytes, Address]]:
        """Everything to be sent, oldest first; the caller takes it over."""
        return self._mailbox.datagrams()

    # --- what the owner does

    def connect(self, now: float) -> None:
        """Begin: an initiator calls, a responder listens.

        Raises:
            StateError: if begun before.
        """
        self._due = None
        if self._role is Role.INITIATOR:
            self._turn(Trigger.DIAL)
            self._call(now)
        else:
            self._turn(Trigger.LISTEN)

    def send_update(
        self,
        now: float,
        tick: int,
        selector: int,
        newest: tuple[int, ...],
        gap: int,
        previous: tuple[int, ...],
        stream: int = 0,
    ) -> bool:
        """Send a new state of a stream to the peer, and see to it that it arrives.

        To a peer that has fallen silent the update is sent as well, and is repeated once the peer is back.

        Args:
            tick: when the newest sample was taken, counted from the epoch.
            selector: 0..15.
            newest: int16 levels.
            gap: ticks between the two samples, 1..65535; 0 without a previous one.
            previous: int16 levels of the sample before, or ().
            stream: which it belongs to, from 0.

        Returns:
            False if there is no session, and nothing was sent.

        Raises:
            ValueError: naming what cannot be sent.
        """
        if self._session is None:
            return False
        self._due = None
        self._post(self._session.sender.send_update(now, tick, selector, newest, gap, previous, stream))
        return True

    def propose_change(self, now: float, tick: int, body: bytes) -> bool:
        """Propose that both ends change something at one moment; `ChangeAnswered` follows.

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
        if self._session is None or self.state is not State.ENGAGED or self._session.sender.accord.is_proposing:
            return False
        self._session.sender.accord.propose(tick, body, now)
        self._due = None
        return True

    def answer_change(self, why_not: str | None) -> None:
        """Answer the change that the peer has proposed last: None to make it at its tick, or in short why not."""
        if self._session is not None:
            self._session.sender.accord.answer(why_not)
            self._due = None

    def close(self, now: float, reason: str) -> None:
        """Leave for good, and tell the peer why; the datagrams to send still hold the farewell.

        Raises:
            StateError: if closed already.
        """
        self._due = None
        self._turn(Trigger.CLOSE)
        if self._session is not None:
            self._post(self._session.sender.send_bye(now, reason))
        self._end_session()
        self._listener.settle()

    # --- time

    def next_timer(self) -> float | None:
        """When `handle_timer` has something to do [s]."""
        if self._due is None:
            self._due = self._find_due()
        return None if self._due == inf else self._due

    def _find_due(self) -> float:
        due = self._dialer.due
        if self._session is not None:
            is_engaged = self.state is State.ENGAGED
            due = min(due, self._session.sender.next_timer(is_engaged=is_engaged))
            due = min(due, self.silent_at)
        return due

    def handle_timer(self, now: float) -> None:
        """Do what is due: silence, calls, repeats, heartbeats. Early calls do no harm."""
        if self._due is None:
            self._due = self._find_due()
        if now < self._due:
            return
        self._due = None
        session = self._session
        if session is not None:
            if now >= self.silent_at:
                self._fall_silent(now)
            is_engaged = self.state is State.ENGAGED
            while (datagram := session.sender.handle_timer(now, is_engaged=is_engaged)) is not None:
                self._post(datagram)
        if now >= self._dialer.due:
            self._post(self._dialer.hello(now))

    def _fall_silent(self, now: float) -> None:
        self._turn(Trigger.FALL_SILENT)
        self._mailbox.tell(PeerSilent(is_heard=False))
        if self._role is Role.INITIATOR:
            self._call(now)

    def _call(self, now: float) -> None:
        self._dialer.start(now)
        self._post(self._dialer.hello(now))

    # --- the network

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        """Take one datagram that has come from `address`, whatever its bytes."""
        self._due = None
        if not data:
            self._mailbox.drop(DropReason.TRUNCATED)
            return
        kind = kind_of(data)
        if self._role is Role.INITIATOR and address != self._address:
            self._mailbox.drop(DropReason.FOREIGN_ADDRESS)
        elif kind in _HANDSHAKE:
            self._receive_handshake(kind, data, address, now)
        elif reason := length_fault(data, self._lengths):
            self._mailbox.drop(reason)
        else:
            self._receive_sealed(data, address, now)

    def _receive_handshake(self, kind: int, data: bytes, address: Address, now: float) -> None:
        is_initiator = self._role is Role.INITIATOR
        if self.state in (State.IDLE, State.CLOSED) or (kind == Kind.WELCOME) is not is_initiator:
            self._mailbox.drop(DropReason.UNEXPECTED)
        elif len(data) > LONGEST_DATAGRAM:
            self._mailbox.drop(DropReason.WRONG_LENGTH)
        elif is_initiator:
            self._receive_welcome(data, address, now)
        else:
            self._receive_hello(data, address, now)

    def _receive_hello(self, data: bytes, address: Address, now: float) -> None:
        reply = self._listener.receive(data, now, is_engaged=self.state is State.ENGAGED)
        if isinstance(reply, DropReason):
            self._mailbox.drop(reply)
            return
        self._mailbox.count(data)
        if reply.refusal is not None:
            self._mailbox.tell(Refused(reply.refusal))
        self._mailbox.post(reply.welcome, address)

    def _receive_welcome(self, data: bytes, address: Address, now: float) -> None:
        answer = self._dialer.receive(data)
        if isinstance(answer, DropReason):
            self._mailbox.drop(answer)
            return
        self._mailbox.count(data)
        if isinstance(answer, str):
            self._turn(Trigger.REFUSE)
            self._end_session()
            self._mailbox.tell(Refused(answer))
            return
        session = self._open_session(answer.protection, answer.peer_clock, now)
        session.clock.learn(answer.outward_delay, 0.0, 0.0)
        session.measure()
        self._establish(session, address, now)
        self._post(session.sender.send_heartbeat(now))

    def _receive_sealed(self, data: bytes, address: Address, now: float) -> None:
        match = self._match(data)
        if isinstance(match, DropReason):
            self._mailbox.drop(match)
            return
        session, opened = match
        if session is not self._session:
            self._listener.settle()
            self._establish(session, address, now)
        self._mailbox.count(data)
        is_newest = session.is_newest(opened)
        outcome = session.accept(opened, now)
        session.measure()
        self.heard_at = session.heard_at
        if session.heard_at == now:  # what is old or cannot be true moves nothing
            if is_newest:
                self._address = address
            if self.state is State.SILENT:
                self._turn(Trigger.HEAR)
                self._dialer.stop()
                self._mailbox.tell(PeerReturned())
        self._take(outcome, now)

    def _match(self, data: bytes) -> tuple[Session, Opened] | DropReason:
        """The session under whose keys a datagram is authentic; one on paper becomes the session by this."""
        session = self._session
        if session is not None and (opened := session.authenticate(data)) is not None:
            return session, opened
        for session in self._listener.pending:
            if (opened := session.authenticate(data)) is not None:
                return session, opened
        if self._former is not None and self._former.authenticate(data) is not None:
            return DropReason.WRONG_SESSION
        return DropReason.NO_SESSION if self._session is None else DropReason.BAD_TAG

    def _take(self, outcome: Outcome, now: float) -> None:
        if isinstance(outcome, DropReason):
            self._mailbox.drop(outcome)
        elif isinstance(outcome, UpdateReceived):
            self.statistics.updates_received[outcome.stream] += 1
            self._mailbox.tell(outcome)
        elif isinstance(outcome, PeerClosed) and outcome.reason.startswith("taken over by "):
            self._turn(Trigger.CLOSE)
            self._end_session()
            self._mailbox.tell(TakenOver(outcome.reason.removeprefix("taken over by ")))
        elif isinstance(outcome, PeerClosed):
            self._turn(Trigger.LEAVE)
            self._end_session()
            self._mailbox.tell(outcome)
            self.connect(now)
        elif outcome is not None:
            self._mailbox.tell(outcome)

    def _open_session(self, protection: Protection, peer_clock: float, now: float) -> Session:
        return Session(protection, self._parameters, self.statistics, peer_clock, now)

    def _establish(self, session: Session, address: Address, now: float) -> None:
        self._turn(Trigger.ESTABLISH)
        self._end_session()
        self._session = session
        self._address = address
        self.heard_at = now
        self._mailbox.tell(Connected(address, self._agreement))

    def _end_session(self) -> None:
        self._dialer.stop()
        if self._session is not None:
            self._former, self._session = self._session, None

    def _turn(self, trigger: Trigger) -> None:
        self.state = next_state(self.state, trigger)

    def _post(self, datagram: bytes) -> None:
        assert self._address is not None
        self._mailbox.post(datagram, self._address)
