"""One end of a link: states, sessions and queues; everything else is delegated.

Pure: driven by its owner (`send_update`), the network (`receive_datagram`) and time (`handle_timer`), each with
`now`, and answering through `datagrams_to_send`, `next_timer` and `next_event`. What a peer does wrong is an event
and a count, never an exception. Knows no codec: it carries integers that it does not interpret.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from math import inf

from weberlink.protocol.dialer import Dialer
from weberlink.protocol.direction import Direction
from weberlink.protocol.events import (
    Address,
    Connected,
    Event,
    PathAnswered,
    PathAsked,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    SessionExpired,
    TakenOver,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.handshake import INSTANCE_BYTES, PROTOCOL_VERSION, Caller, check_name, pack_agreement, read_map
from weberlink.protocol.listener import Listener
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.mailbox import Mailbox
from weberlink.protocol.path import Path
from weberlink.protocol.reasons import DropReason
from weberlink.protocol.roles import Role
from weberlink.protocol.security import Protection, Security
from weberlink.protocol.session import FADE_SHARE, LONGEST_SILENCE, Opened, OwnersOutcome, Parameters, Session
from weberlink.protocol.states import State, Trigger, next_state
from weberlink.protocol.statistics import Statistics
from weberlink.protocol.wire import LONGEST_CHANGE, LONGEST_DATAGRAM, TICK_BITS, Kind, kind_of, length_fault
from weberlink.update import Update

_HANDSHAKE = frozenset((Kind.HELLO, Kind.WELCOME))
TAKEN_OVER = "taken over by "
"""How the farewell to a master begins that another one has replaced; its name follows."""
ENCODING_REPORT_S = 0.02
ENCODING_REPORT_TICKS = 10
"""An encoder counts as running for so long, or for so many ticks, after its owner last said so."""
MOST_TICKS = 1 << TICK_BITS - 1
"""Ticks that the silence limit may span."""
QUIET_SHARE, LONGEST_QUIET = 0.2, 0.05
"""For what share of the silence limit, and for how long at most [s], nothing must come from the peer's address before
another one is used."""


class Endpoint:
    """One end of a link.

    The life of an initiator: `connect`, then `Connected` (or `Refused`, which is final), updates, `PeerSilent` and
    `PeerReturned` in the same session or `Connected` in a new one; after seconds of silence the session is over
    (`SessionExpired`). It calls again by itself whenever the peer is gone. A responder does the same from the other
    side and goes on listening, until `close`.

    It is ENGAGED only while each end hears the other (`weberlink.protocol.liveness`).

    Attributes, which the owner reads:
        state: where the conversation stands.
        liveness: when the ends last heard each other in the session, or in the last one.
        statistics: counters and measurements, which go on.
    """

    __slots__ = (
        "_address",
        "_agreement",
        "_dialer",
        "_due",
        "_encoding_reported_at",
        "_entropy",
        "_former",
        "_is_encoding",
        "_lengths",
        "_listener",
        "_mailbox",
        "_parameters",
        "_path",
        "_role",
        "_served",
        "_session",
        "liveness",
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
        incoming_parametric: Sequence[Collection[int]] = (),
        security: Security,
        entropy: Callable[[int], bytes],
        epoch: float,
        tick_period: float,
        silence: float = 0.1,
        peer: Address | None = None,
        version: int = PROTOCOL_VERSION,
        carries_credit: bool = False,
        name: str = "",
        expects: str = "",
        take_over: bool = False,
        stamp: Callable[[float], int] | None = None,
    ) -> None:
        """Compose one end.

        Args:
            role: the initiator calls `peer`; the responder answers whoever proves the key.
            agreement: dotted path to value; must be the same at both ends.
            outgoing_values, incoming_values: levels in a sample of each stream of each direction; one stream or two.
            incoming_parametric: by stream, the selectors whose updates carry model parameters.
            security: the suite, with its key.
            entropy: random bytes of a number, for keys and nonces; must be unpredictable where it matters.
            epoch: `now` of the owner's tick 0 [s].
            tick_period: of both ends [s], > 0.
            silence: loop age beyond which nothing is delivered, and beyond which the peer counts as gone; alike at both
                ends [s]. At most `LONGEST_SILENCE`, and at most 2^15 ticks.
            peer: whom an initiator calls.
            version: of the protocol; another one than this code's only to study a mismatch.
            carries_credit: whether every update and heartbeat, of both ends, carries the sender's `credit`; follows
                from something in the agreement.
            name: of this end, as the other end shows it; "" for that of its role.
            expects: name of the only peer that is spoken to; "" for any. An initiator keeps to the first that answers.
            take_over: whether an initiator replaces another master that the slave serves, in its first session.
            stamp: wall clock [ns] at `now` [s], for the stamps of an initiator's calls, which a responder remembers
                beyond this process; None to count `now`.

        Raises:
            ValueError: naming the argument.
        """
        if role is Role.INITIATOR and peer is None:
            raise ValueError("peer: an initiator must be told whom to call")
        if not (tick_period > 0.0 and silence > 0.0):
            raise ValueError(f"tick_period and silence must be positive, not {tick_period} and {silence}")
        if silence > min(LONGEST_SILENCE, tick_period * MOST_TICKS):
            raise ValueError(
                f"silence must be at most {min(LONGEST_SILENCE, tick_period * MOST_TICKS):g} s, not {silence}"
            )
        outgoing, incoming = (
            Direction(values, carries_credit=carries_credit, further_acks=len(others) - 1, parametric=parametric)
            for values, others, parametric in (
                (outgoing_values, incoming_values, ()),
                (incoming_values, outgoing_values, incoming_parametric),
            )
        )
        packed = pack_agreement(agreement)
        self._agreement: dict[str, object] = read_map(packed) or {}
        self._role = role
        self._address = peer
        self.state = State.IDLE
        self.statistics = Statistics()
        self._parameters = Parameters(outgoing, incoming, epoch, tick_period, silence)
        self._lengths = self._parameters.incoming.lengths(security.tag_size)
        name = check_name(name or role.value)
        expects = check_name(expects) if expects else ""
        self._served: Caller | None = None  # the master of the present session
        self._dialer = Dialer(
            security,
            entropy,
            packed,
            version,
            epoch,
            caller=Caller(name, entropy(INSTANCE_BYTES)),
            expects=expects,
            takes_over=take_over,
            stamp=stamp or _nanoseconds,
            silence=silence,
        )
        self._listener = Listener(
            security, entropy, self._agreement, version, epoch, self._open_session, name=name, expects=expects
        )
        self._entropy = entropy
        self._session: Session | None = None
        self._former: Session | None = None
        self.liveness = Liveness(epoch, silence, 0.0, -inf)
        self._path: Path | None = None
        self._encoding_reported_at: float | None = None
        self._is_encoding = True
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
        """When the loop age passes the limit if nothing more is heard [s]; infinite while the peer is not there."""
        if self._session is None or self.state is not State.ENGAGED:
            return inf
        return self._session.silent_at

    @property
    def heard_at(self) -> float:
        """When the newest fresh datagram came from the peer [s]; -inf before the first."""
        return self.liveness.heard_at

    @property
    def confirmed_at(self) -> float:
        """Departure of our newest datagram that the peer is known to have heard [s]; -inf before the first.

        The time since then is the loop age.
        """
        return self.liveness.confirmed_at

    def is_peer_encoding(self, now: float) -> bool:
        """Whether what the peer encodes may be acted on: each end hears the other, and the peer's encoder runs."""
        return self.state is State.ENGAGED and now <= self.liveness.encodes_until

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

    def latest_receivable_peer_time(self, now: float) -> float | None:
        """The part of the peer's clock that can have been heard by now [s]: its time less the least delay to here.

        What the peer did not send before then it had no need to send; what it does later is not known yet.
        """
        return None if self._session is None else self._session.clock.latest_receivable_peer_time(now)

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

    def report_encoding(self, now: float, *, is_encoding: bool) -> None:
        """Say in every tick whether the encoder of this end runs, which every datagram tells the peer.

        An owner that has once said so and stops saying it, as one whose ticks have stopped, counts as not encoding. One
        that never does counts as encoding.
        """
        self._encoding_reported_at = now
        if is_encoding is not self._is_encoding:
            self._is_encoding = is_encoding
            self._tell_encoding()

    def _tell_encoding(self) -> None:
        """See that the peer knows at once whether our encoder runs."""
        if self._session is None or self.state is not State.ENGAGED:
            return
        sender = self._session.sender
        if sender.said_encoding is not self._is_encoding:
            sender.heartbeats.asked()
            self._due = None

    def request_full_state(self) -> None:
        """The owner holds none of the peer's updates any more; the peer is told to send complete ones."""
        if self._session is not None:
            self._session.request_full_state()

    def send_update(self, now: float, update: Update, stream: int = 0) -> bool:
        """Send a new state of a stream to the peer, and see to it that it arrives.

        To a peer that has fallen silent the update is sent as well, and is repeated once the peer is back.

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
        if self._session is None or self.state is not State.ENGAGED or self._session.sender.negotiation.is_proposing:
            return False
        self._session.sender.negotiation.propose(tick, body, now)
        self._due = None
        return True

    def answer_change(self, refusal: str | None) -> None:
        """Answer the change that the peer has proposed last: None to make it at its tick, or in short why not."""
        if self._session is not None:
            self._session.sender.negotiation.answer(refusal)
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
            session, is_engaged = self._session, self.state is State.ENGAGED
            due = min(due, session.sender.next_timer(is_engaged=is_engaged, is_encoding=self._is_encoding))
            due = min(due, session.silent_at if is_engaged else session.expires_at)
        return due

    def handle_timer(self, now: float) -> None:
        """Do what is due: silence, calls, repeats, heartbeats. Early calls do no harm."""
        if self._due is None:
            self._due = self._find_due()
        if now < self._due:
            return
        self._due = None
        self._attend(now)
        session = self._session
        if session is not None:
            is_engaged = self.state is State.ENGAGED
            if is_engaged:
                self._watch_encoder(now)
                if self._is_encoding:
                    for stream in session.sender.give_up(now):
                        self._mailbox.tell(UpdateLost(stream))
            while (
                datagram := session.sender.handle_timer(now, is_engaged=is_engaged, is_encoding=self._is_encoding)
            ) is not None:
                self._post(datagram)
        if now >= self._dialer.due:
            self._post(self._dialer.hello(now))

    def _attend(self, now: float) -> None:
        """Leave the peer when the loop age has passed the limit, and the session some seconds later."""
        if self._session is None:
            return
        if now >= self.silent_at:
            self._turn(Trigger.FALL_SILENT)
            self._session.request_full_state()
            self._mailbox.tell(PeerSilent(now - self.heard_at < 0.5 * FADE_SHARE * self._parameters.silence))
            if self._role is Role.INITIATOR:
                self._call(now)
        if self.state is State.SILENT and now >= self._session.expires_at:
            self._turn(Trigger.EXPIRE)
            self._end_session()
            self._mailbox.tell(SessionExpired())
            self.connect(now)

    def _watch_encoder(self, now: float) -> None:
        limit = max(ENCODING_REPORT_S, ENCODING_REPORT_TICKS * self._parameters.tick_period)
        if self._encoding_reported_at is not None and now - self._encoding_reported_at > limit:
            self._is_encoding = False

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
        serving = None if self._session is None else self._served
        is_engaged = self.state is State.ENGAGED
        reply = self._listener.receive(data, address, now, serving=serving, is_engaged=is_engaged)
        if isinstance(reply, DropReason):
            self._mailbox.drop(reply)
            return
        self._mailbox.post(reply.welcome, address)
        if reply.refusal is None:
            self._mailbox.count(data)
            return
        self._mailbox.drop(DropReason.REFUSED)
        if self._session is None:
            self._mailbox.tell(Refused(reply.refusal))

    def _receive_welcome(self, data: bytes, address: Address, now: float) -> None:
        answer = self._dialer.receive(data)
        if isinstance(answer, DropReason):
            self._mailbox.drop(answer)
            return
        self._mailbox.count(data)
        if answer is None:
            return
        if isinstance(answer, str):
            self._turn(Trigger.REFUSE)
            self._end_session()
            self._mailbox.tell(Refused(answer))
            return
        hello_at = self._parameters.epoch + answer.peer_clock - answer.outward_delay
        if now - hello_at > self._parameters.silence:
            self._mailbox.drop(DropReason.STALE)
            return
        session = self._open_session(answer.protection, answer.peer_clock, now, hello_at)
        session.clock.learn(answer.outward_delay, 0.0, 0.0)
        session.measure()
        self._establish(session, address)
        self._post(session.sender.send_heartbeat(now))

    def _receive_sealed(self, data: bytes, address: Address, now: float) -> None:
        if self._session is not None and now >= self._session.expires_at:
            self._attend(now)  # this end has stood still; what has waited meanwhile may be of any age
        match = self._match(data)
        if isinstance(match, DropReason):
            self._mailbox.drop(match)
            return
        session, opened = match
        if session is not self._session and now - session.liveness.heard_at > self._parameters.silence:
            self._mailbox.drop(DropReason.STALE)
            return
        is_newest = session.is_newest(opened)
        outcome = session.accept(opened, now)
        if outcome is not DropReason.REPLAYED:
            self._mailbox.count(data)
        if session is not self._session and not self._confirm(session, now):
            self._mailbox.drop(outcome if isinstance(outcome, DropReason) else DropReason.STALE)
            return
        session.measure()
        self._locate(session, address, now, is_newest=is_newest)
        if session.is_fresh and self.state is State.SILENT and now < session.silent_at:
            self._turn(Trigger.HEAR)
            self._dialer.stop()
            self._tell_encoding()
            self._mailbox.tell(PeerReturned())
        if isinstance(outcome, PathAsked):
            self._mailbox.post(session.sender.send_path(now, outcome.token, is_answer=True), address)
        elif isinstance(outcome, PathAnswered):
            if self._path is not None:
                self._path.answer(outcome.token, now)
                self._address = self._path.address
        else:
            self._take(outcome, now)

    def _locate(self, session: Session, source: Address, now: float, *, is_newest: bool) -> None:
        """Take note of where an authentic datagram came from; an initiator knows where its peer is."""
        path = self._path
        if path is None:
            return
        path.hear(source, now, is_fresh=is_newest and session.is_fresh)
        self._address = path.address
        if (challenge := path.challenge(now)) is not None:
            token, target = challenge
            self._mailbox.post(session.sender.send_path(now, token, is_answer=False), target)

    def _confirm(self, session: Session, now: float) -> bool:
        """A session on paper becomes the session, if what has come under its keys is fresh."""
        if not session.is_fresh or now >= session.silent_at:
            return False
        called_from = self._change_master(session, now)
        self._establish(session, called_from)
        return True

    def _change_master(self, session: Session, now: float) -> Address:
        """A session on paper is confirmed: tell the master that it takes the place of; where the new one has called.

        It has received the WELCOME there, and so has proved the address.
        """
        caller, address = self._listener.origin_of(session)
        self._listener.settle()
        replaced = self._served
        self._served = caller
        if self._session is not None and replaced is not None and caller.instance != replaced.instance:
            self._post(self._session.sender.send_bye(now, TAKEN_OVER + caller.name))
        return address

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

    def _take(self, outcome: OwnersOutcome | DropReason | None, now: float) -> None:
        if isinstance(outcome, DropReason):
            self._mailbox.drop(outcome)
        elif isinstance(outcome, UpdateReceived):
            self.statistics.updates_received[outcome.stream] += 1
            self._mailbox.tell(outcome)
        elif isinstance(outcome, PeerClosed):
            self._take_farewell(outcome, now)
        elif outcome is not None:
            self._mailbox.tell(outcome)

    def _take_farewell(self, farewell: PeerClosed, now: float) -> None:
        if self._role is Role.INITIATOR and farewell.reason.startswith(TAKEN_OVER):
            self._turn(Trigger.CLOSE)  # to call again would be to take it back
            self._end_session()
            self._mailbox.tell(TakenOver(farewell.reason.removeprefix(TAKEN_OVER)))
            return
        self._turn(Trigger.LEAVE)
        self._end_session()
        self._mailbox.tell(farewell)
        self.connect(now)

    def _open_session(
        self, protection: Protection, peer_clock: float, now: float, confirmed_at: float = -inf
    ) -> Session:
        return Session(protection, self._parameters, self.statistics, peer_clock, now, confirmed_at=confirmed_at)

    def _establish(self, session: Session, address: Address) -> None:
        self._turn(Trigger.ESTABLISH)
        self._end_session()
        self._session = session
        self.liveness = session.liveness
        self._tell_encoding()
        self._address = address
        if self._role is Role.RESPONDER:
            self._path = Path(address, self._entropy, min(LONGEST_QUIET, QUIET_SHARE * self._parameters.silence))
        self._mailbox.tell(Connected(address, self._agreement))

    def _end_session(self) -> None:
        self._dialer.stop()
        self._path = None
        if self._session is not None:
            self._former, self._session = self._session, None

    def _turn(self, trigger: Trigger) -> None:
        self.state = next_state(self.state, trigger)

    def _post(self, datagram: bytes) -> None:
        assert self._address is not None
        self._mailbox.post(datagram, self._address)


def _nanoseconds(now: float) -> int:
    """A stamp from the owner's clock, where that is the only one (in virtual time)."""
    return max(0, round(now * 1e9))
