"""One end of a link, sans I/O: handshake, timers, and received datagrams.

Its owner drives it with `now` as an argument: by `receive_datagram`, `handle_timer` and the methods of `Conversation`.
It answers through `datagrams_to_send`, `next_timer` and `next_event`. A peer's fault is an event, never an exception.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf

from weberlink.protocol.conversation import Conversation, session_parameters
from weberlink.protocol.dialer import Dialer
from weberlink.protocol.events import (
    Address,
    DropReason,
    PathAnswered,
    PathAsked,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    SessionExpired,
    TakenOver,
    UpdateReceived,
)
from weberlink.protocol.handshake import (
    INSTANCE_BYTES,
    PROTOCOL_VERSION,
    Caller,
    LocalEnd,
    check_name,
    pack_agreement,
    read_map,
)
from weberlink.protocol.listener import Listener
from weberlink.protocol.liveness import FADE_SHARE
from weberlink.protocol.retransmission import copies_needed
from weberlink.protocol.round_trip import in_ms, rounded_up
from weberlink.protocol.security import Protection, Security
from weberlink.protocol.session import Opened, Outcome, OwnersOutcome, Session
from weberlink.protocol.states import Role, State, Trigger
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind, kind_of, length_fault
from weberlink.update import UpdateForm

_HANDSHAKE = frozenset((int(Kind.HELLO), int(Kind.WELCOME)))
_PATH = (PathAsked, PathAnswered)
# The class of an enumeration is slow to ask for a member.
_SILENT = State.SILENT
TAKEN_OVER = "taken over by "
"""First words of the farewell to a master that another one has replaced; its name follows."""


class Endpoint(Conversation):
    """One end of a link.

    The life of an initiator: `connect`, then `Connected` (or `Refused`, which is final), updates, `PeerSilent` and
    `PeerReturned` in the same session or `Connected` in a new one; after seconds of silence the session is over
    (`SessionExpired`). It calls again by itself whenever the peer is gone. A responder listens until `close`.

    The state is ENGAGED only while each end hears the other (`weberlink.protocol.liveness`). A link with a longer round
    trip than both ends allow gets no session: the initiator measures it, and after a second it ends with `Refused`.
    """

    def __init__(
        self,
        *,
        role: Role,
        agreement: Mapping[str, object],
        outgoing: Sequence[Sequence[UpdateForm]],
        incoming: Sequence[Sequence[UpdateForm]],
        security: Security,
        entropy: Callable[[int], bytes],
        epoch: float,
        tick_period: float,
        silence: float = 0.1,
        longest_round_trip: float = 0.4,
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
            outgoing, incoming: by stream (one or two), what its updates carry, by selector.
            security: the suite, with its key.
            entropy: returns that many random bytes, for keys and nonces; must be unpredictable where it matters.
            epoch: `now` of the owner's tick 0 [s].
            tick_period: of both ends [s], > 0.
            silence: time without a fresh datagram after which the peer counts as gone [s]; at most `LONGEST_SILENCE`
                and 2^15 ticks.
            longest_round_trip: of a session [s]; the smaller value of the two ends holds, at most `LONGEST`.
            peer: whom an initiator calls.
            version: of the protocol; another one than this code's only to study a mismatch.
            carries_credit: whether every update and heartbeat, of both ends, carries the sender's `credit`.
            name: of this end, as the other end shows it; "" for that of its role.
            expects: name of the only peer that is accepted; "" for any. An initiator keeps to the first that answers.
            take_over: whether an initiator replaces another master that the slave serves, in its first session.
            stamp: wall clock [ns] at `now` [s]; a responder remembers the stamps of calls. None to count `now`.

        Raises:
            ValueError: naming the argument.
        """
        if role is Role.INITIATOR and peer is None:
            raise ValueError("peer: an initiator must be told whom to call")
        parameters = session_parameters(
            outgoing,
            incoming,
            carries_credit=carries_credit,
            epoch=epoch,
            tick_period=tick_period,
            silence=silence,
            longest_round_trip=longest_round_trip,
            opens=role is Role.INITIATOR,
        )
        packed = pack_agreement(agreement)
        super().__init__(role, parameters, read_map(packed) or {}, entropy, peer)
        self._calls = role is Role.INITIATOR
        self._lengths = parameters.incoming.lengths(security.tag_size)
        self._served: Caller | None = None  # the master of the present session
        end = LocalEnd(
            security,
            entropy,
            packed,
            version,
            epoch,
            check_name(name or role.value),
            check_name(expects) if expects else "",
            longest_round_trip,
        )
        self._dialer = Dialer(
            end,
            entropy(INSTANCE_BYTES),
            takes_over=take_over,
            stamp=stamp or (lambda now: max(0, round(now * 1e9))),
            patience=silence + longest_round_trip,
        )
        self._listener = Listener(end, self._open_session)

    @property
    def peer_name(self) -> str:
        """Name of the peer of the present session, or of the last one; "" before the first."""
        if self._calls:
            return self._dialer.expects
        return "" if self._served is None else self._served.name

    def connect(self, now: float) -> None:
        """Begin: an initiator calls, a responder listens.

        Raises:
            StateError: if begun before.
        """
        self._due = None
        if self.role is Role.INITIATOR:
            self._turn(Trigger.DIAL)
            self._call(now)
        else:
            self._turn(Trigger.LISTEN)

    def close(self, now: float, reason: str) -> None:
        """Leave for good, and tell the peer why; the farewell is among the datagrams to send.

        Raises:
            StateError: if closed already.
        """
        self._due = None
        self._turn(Trigger.CLOSE)
        if self._session is not None:
            # Nothing is heard or repeated from here on, so a lossy link gets copies at once.
            for _ in range(1 + copies_needed(self.statistics.outgoing_loss, self.statistics.outgoing_burst)):
                self._post(self._session.sender.send_bye(now, reason))
        self._end_session()
        self._listener.settle()

    # --- time

    def next_timer(self) -> float | None:
        """Time of the next action of `handle_timer` [s]; None if there is none."""
        if self._due is None:
            self._due = min(self._dialer.due, self._session_due())
        return None if self._due == inf else self._due

    def handle_timer(self, now: float) -> None:
        """Do what is due: silence, calls, repeats, heartbeats. Early calls do no harm."""
        due = self.next_timer()
        if due is None or now < due:
            return
        self._due = None
        self._watch_silence(now)
        self._send_due(now)
        if now >= self._dialer.due:
            self._post(self._dialer.hello(now))

    def _watch_silence(self, now: float) -> None:
        """Fall silent when a limit is passed, and end the session some seconds later."""
        if self._session is None:
            return
        if now >= self.silent_at:
            self._session.silent_since = self.silent_at
            self._turn(Trigger.FALL_SILENT)
            self._session.request_full_state()
            self._is_peer_heard = now - self.liveness.heard_at < 0.5 * FADE_SHARE * self._parameters.silence
            self._mailbox.tell(PeerSilent(self._is_peer_heard))
            if self.role is Role.INITIATOR:
                self._call(now)
        if now >= self._deaf_at:
            self._is_peer_heard = False
            self._mailbox.tell(PeerSilent(is_heard=False))
        if self.state is State.SILENT and now >= self._session.expires_at:
            self._turn(Trigger.EXPIRE)
            self._end_session()
            self._mailbox.tell(SessionExpired())
            self.connect(now)

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
        if self._calls and address != self.peer:
            self._mailbox.drop(DropReason.FOREIGN_ADDRESS)
        elif kind in _HANDSHAKE:
            self._receive_handshake(kind, data, address, now)
        elif reason := length_fault(data, self._lengths):
            self._mailbox.drop(reason)
        else:
            self._receive_sealed(data, address, now)

    def _receive_handshake(self, kind: int, data: bytes, address: Address, now: float) -> None:
        is_initiator = self.role is Role.INITIATOR
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
        round_trip = now - hello_at
        if in_ms(round_trip) > in_ms(answer.longest_round_trip):
            self._dialer.find_too_long(round_trip, now)
            self._mailbox.drop(DropReason.STALE)
            return
        session = self._open_session(answer.protection, answer.longest_round_trip, answer.peer_clock, now, hello_at)
        session.liveness.agree(min(rounded_up(round_trip), answer.longest_round_trip), now)
        session.clock.learn(answer.outward_delay, 0.0, 0.0)
        session.measure()
        self._establish(session, address)
        self._post(session.sender.send_heartbeat(now))

    def _receive_sealed(self, data: bytes, address: Address, now: float) -> None:
        session = self._session
        if session is not None and now >= session.expires_at:
            self._watch_silence(now)  # this process has stood still; datagrams that waited may be of any age
            session = self._session
        opened = None if session is None else session.authenticate(data)
        if session is None or opened is None:
            self._receive_other(data, address, now)
            return
        outcome = session.accept(opened, now)
        if outcome is not DropReason.REPLAYED:
            self._mailbox.count(data)
        self._follow(session, outcome, address, now)

    def _receive_other(self, data: bytes, address: Address, now: float) -> None:
        """Take a datagram that is not of the present session: the first of a pending one makes that the present one."""
        match = self._match_pending(data)
        if isinstance(match, DropReason):
            self._mailbox.drop(match)
            return
        session, opened = match
        if now - session.liveness.heard_at > self._parameters.silence + self._parameters.longest_round_trip:
            self._mailbox.drop(DropReason.STALE)
            return
        outcome = session.accept(opened, now)
        if outcome is not DropReason.REPLAYED:
            self._mailbox.count(data)
        if not self._confirm(session, now):
            self._mailbox.drop(outcome if isinstance(outcome, DropReason) else DropReason.STALE)
            return
        self._follow(session, outcome, address, now)

    def _follow(self, session: Session, outcome: Outcome, address: Address, now: float) -> None:
        """Do what an authentic datagram of the present session leads to."""
        self._dialer.confirm()
        session.measure()
        if self._path is not None:
            self._locate(self._path, session, address, now)
        if self.state is _SILENT and session.is_fresh and now < session.silent_at:
            self._turn(Trigger.HEAR)
            session.silent_since = inf
            self._is_peer_heard = False
            self._dialer.stop()
            self._tell_encoding()
            self._mailbox.tell(PeerReturned())
        if isinstance(outcome, _PATH):
            self._take_path(session, outcome, address, now)
        elif outcome is not None:
            self._take(outcome, now)

    def _match_pending(self, data: bytes) -> tuple[Session, Opened] | DropReason:
        """The pending session under whose keys a datagram is authentic."""
        for session in self._listener.pending:
            if (opened := session.authenticate(data)) is not None:
                return session, opened
        if self._former is not None and self._former.authenticate(data) is not None:
            return DropReason.WRONG_SESSION
        return DropReason.NO_SESSION if self._session is None else DropReason.BAD_TAG

    def _confirm(self, session: Session, now: float) -> bool:
        """Make a pending session the present one, if its datagram was fresh, and tell the master that it replaces.

        The master has received the WELCOME at the address that it called from, and so has proved that address.
        """
        if not session.is_fresh or now >= session.silent_at:
            return False
        caller, address = self._listener.confirm(session)
        replaced, self._served = self._served, caller
        if self._session is not None and replaced is not None and caller.instance != replaced.instance:
            self._post(self._session.sender.send_bye(now, TAKEN_OVER + caller.name))
        self._establish(session, address)
        return True

    def _take(self, outcome: OwnersOutcome | DropReason, now: float) -> None:
        if isinstance(outcome, UpdateReceived):
            self.statistics.updates_received[outcome.stream] += 1
            self._mailbox.tell(outcome)
        elif isinstance(outcome, DropReason):
            self._mailbox.drop(outcome)
        elif isinstance(outcome, PeerClosed):
            self._take_farewell(outcome, now)
        else:
            self._mailbox.tell(outcome)

    def _take_farewell(self, farewell: PeerClosed, now: float) -> None:
        if self.role is Role.INITIATOR and farewell.reason.startswith(TAKEN_OVER):
            self._turn(Trigger.CLOSE)  # calling again would take the slave back
            self._end_session()
            self._mailbox.tell(TakenOver(farewell.reason.removeprefix(TAKEN_OVER)))
            return
        self._turn(Trigger.LEAVE)
        self._end_session()
        self._mailbox.tell(farewell)
        self.connect(now)

    def _open_session(
        self, protection: Protection, longest: float, peer_clock: float, now: float, confirmed_at: float = -inf
    ) -> Session:
        return Session(
            protection,
            self._parameters,
            self.statistics,
            peer_clock,
            now,
            longest_round_trip=longest,
            confirmed_at=confirmed_at,
        )

    def _end_session(self) -> None:
        self._dialer.stop()
        super()._end_session()
