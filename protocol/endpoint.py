"""One end of a link, sans I/O: its state, handshake, timers, and received datagrams.

Its owner drives it with `now` as an argument. It answers through `datagrams_to_send`, `next_timer` and `next_event`. A
peer's fault is an event, never an exception.
"""

from collections import deque
from collections.abc import Callable, Mapping
from math import inf
from typing import Final

from weberlink.protocol import events, wire
from weberlink.protocol.address import AddressCheck
from weberlink.protocol.counters import Credit
from weberlink.protocol.events import Address, DropReason, Event
from weberlink.protocol.handshake import Dialer, Hello, Listener
from weberlink.protocol.keys import Grant
from weberlink.protocol.liveness import FADE_SHARE, Liveness
from weberlink.protocol.local_end import LocalEnd
from weberlink.protocol.session import Outcome, Session
from weberlink.protocol.states import State, moved
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import Kind
from weberlink.text import one_line
from weberlink.update import Update

QUEUED_DATAGRAMS: Final = 64
QUEUED_EVENTS: Final = 256
"""A full queue drops its oldest entry; dropped datagrams fill half of the events at most."""
ENCODING_REPORT_S: Final = 0.02
ENCODING_REPORT_TICKS: Final = 10
"""How long an encoder counts as running after its owner last reported it: the longer of the two."""
QUIET_SHARE: Final = 0.2
LONGEST_QUIET: Final = 0.05
"""How long nothing must come from the peer's address before another one is used: a share of the silence limit, and the
longest time [s]."""
TAKEN_OVER: Final = "taken over by "  # begins the farewell to a master that another one has replaced; its name follows
# Farewell to a master whose key was removed, or has another right now.
WITHDRAWN: Final = "the key of this master may not drive any more"
STOP_COPIES: Final = 3  # answers to who asked to stop: none is asked for again, as this end is gone then
_HANDSHAKE = frozenset((int(Kind.HELLO), int(Kind.WELCOME)))
# The class of an enumeration is slow to ask for a member.
_ENGAGED, _SILENT = State.ENGAGED, State.SILENT


class Endpoint:
    """One end of a link.

    The life of an initiator: `connect`, then `Connected` (or `Refused`, which is final), updates, `PeerSilent` and
    `PeerReturned` in the same session or `Connected` in a new one; after seconds of silence the session is over
    (`SessionExpired`). It calls again by itself whenever the peer is gone. A responder listens until `close`.

    The state is ENGAGED only while each end hears the other (`weberlink.protocol.liveness`). A link with a longer round
    trip than both ends allow gets no session: the initiator measures it, and after a second it ends with `Refused`.

    Attributes:
        role, name: of this end.
        state: of the conversation.
        peer: where the peer is, or was last; None for a responder before the first call.
        sessions: number of sessions that have begun.
        liveness: when the ends last heard each other in the session, or in the last one.
        clock: mapping to the peer's clock, round trip and jitter of the session; of nothing measured without one.
        credit: counts that each end has granted to the other in the session (`grant`).
        statistics: counters over all sessions, and present measurements.
        events: that wait to be taken, the oldest first.
        peer_grant: what the key of the master of the session, or of the last one, is good for.
        told: gives what the owner adds to what a watcher is told; texts and numbers.
        on_update: takes an update as it comes, if no event waits; False to have it as an event. Must not raise.
        on_heard: takes the number and the arrival [s] of each authentic datagram that is no replay, and the token of
            the question of `ask` that it answers, else b"".
    """

    def __init__(self, end: LocalEnd, peer: Address | None = None) -> None:
        """Compose an endpoint, the only one of `end`. `peer` is whom an initiator calls; ValueError without one."""
        if end.calls and peer is None:
            raise ValueError("peer: an initiator must be told whom to call")
        self._end = end
        self._calls = end.calls
        self.role, self.name, self.statistics = end.role, end.name, end.statistics
        self.state = State.IDLE
        self.peer = peer
        self.sessions = 0
        self.liveness = Liveness(end.epoch, end.silence, 0.0, -inf, streams=len(end.incoming))
        self.clock = self._no_clock = Clock(end.epoch, 0.0, end.epoch)
        self.credit = Credit()
        self.events: deque[Event] = deque()
        self.peer_grant = Grant()
        self.told: Callable[[], Mapping[str, object]] = dict
        self.on_update: Callable[[events.UpdateReceived], bool] | None = None
        self.on_heard: Callable[[int, float, bytes], None] | None = None
        self._encoding_report = max(ENCODING_REPORT_S, ENCODING_REPORT_TICKS * end.tick_period)
        self._encoding_reported_at: float | None = None
        self._is_encoding = True
        self._shortest, self._longest = (size + end.security.tag_size for size in end.receives.lengths)
        self._datagrams: list[tuple[bytes, Address]] = []
        self._session: Session | None = None
        self._former: Session | None = None
        self._address: AddressCheck | None = None
        self._served: Hello | None = None  # the master of the present session
        self._stopper: tuple[bytes, Address] | None = None  # the answer to who asked to stop, and where to
        self._is_peer_heard = False  # true while silent if datagrams of the peer still came as silence fell
        self._due: float | None = None  # read several times a tick; None when it may have changed
        self._dialer, self._listener = Dialer(end), Listener(end, self._told)

    # --- what the owner reads

    def next_event(self) -> Event | None:
        """Take the oldest event; None if there is none."""
        return self.events.popleft() if self.events else None

    def datagrams_to_send(self) -> list[tuple[bytes, Address]]:
        """Take everything to be sent, oldest first."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    @property
    def peer_name(self) -> str:
        """Name of the peer of the present session, or of the last one; "" before the first."""
        if self._calls:
            return self._dialer.expects
        return "" if self._served is None else self._served.name

    @property
    def silent_at(self) -> float:
        """Time at which a limit is passed if nothing more is heard [s]; infinite while not engaged."""
        return self.liveness.silent_at if self.state is _ENGAGED else inf

    def may_follow(self, now: float) -> bool:
        """Whether the peer's updates may be executed: each end hears the other, the peer's encoder runs, and each end
        holds the newest updates of all streams of the other, or lacks them for no longer than the limits allow."""
        liveness = self.liveness
        is_current = now <= liveness.encodes_until and now <= liveness.held_until
        return is_current and self.state is _ENGAGED and not liveness.is_opening

    def undelivered(self, now: float) -> int:
        """Number of the stream, from 1, of which updates of one direction have not come through for longer than S + 2
        R, although the ends hear each other; 0 for none."""
        if now <= self.liveness.undelivered_at or self.state is not _ENGAGED or self._session is None:
            return 0
        return self._session.late_stream(now)

    # --- what the owner sends

    def send_update(self, now: float, update: Update, stream: int = 0) -> bool:
        """Send a new state of a stream to the peer, and repeat it until it arrives; its tick is counted from the epoch.

        A silent peer is sent the update too; it is repeated once the peer is back. False if there is no session, and
        nothing was sent; ValueError names what cannot be sent."""
        if self._session is None:
            return False
        self._due = None
        if not self._is_encoding:
            self._set_encoding(now, is_encoding=True)
        self._post(self._session.send_update(now, update, stream))
        return True

    def report_encoding(self, now: float, *, is_encoding: bool) -> None:
        """Report in every tick whether the encoder of this end runs, which every datagram tells the peer.

        An owner that has reported and then stops counts as not encoding; one that never reports counts as encoding."""
        self._encoding_reported_at = now
        if is_encoding is not self._is_encoding:
            self._set_encoding(now, is_encoding=is_encoding)
            self._tell_encoding()

    def _set_encoding(self, now: float, *, is_encoding: bool) -> None:
        self._is_encoding = is_encoding
        self.liveness.count_from(now if is_encoding else inf)  # what is not repeated cannot be held

    def grant(self, count: int) -> None:
        """Tell the peer a cumulative count, in every datagram; it is 0 when a session begins, and stays 0 without one.
        ValueError if it would fall."""
        session = self._session
        if session is not None and session.credit.granted != count:
            session.credit.grant(count)
            if not session.heartbeats.is_credit_wanted:
                session.heartbeats.is_credit_wanted = True
                self._due = None

    def request_full_state(self) -> None:
        """Tell the peer that the owner holds none of its updates any more, so that it sends complete ones."""
        if self._session is not None:
            self._session.request_full_state()

    def ask(self, now: float, token: bytes) -> bool:
        """Send a question of `wire.TOKEN_BYTES`, which the peer answers at once; False if there is no session, and
        nothing was sent. It stamps the answer when it leaves, so that it tells the delay of both directions."""
        if self._session is None:
            return False
        self._due = None
        self._post(self._session.send(now, wire.PATH, token))
        return True

    def request_answer(self) -> None:
        """Ask the peer for an answer at once, which shows whether an update of it is missing."""
        if self._session is not None:
            self._session.heartbeats.ask()
            self._due = None

    def propose_change(self, now: float, tick: int, body: bytes) -> bool:
        """Propose that both ends change something at the same tick; `ChangeAnswered` follows.

        The tick is ours, far enough ahead for the answer to come back; the body is what is to change, 1 to
        `LONGEST_CHANGE` bytes, else ValueError. False, and nothing is proposed, without an engaged peer or while an
        earlier proposal waits for its answer."""
        if not 1 <= len(body) <= wire.LONGEST_CHANGE:
            raise ValueError(f"a change takes 1 to {wire.LONGEST_CHANGE} bytes, not {len(body)}")
        if self._session is None or self.state is not _ENGAGED or self._session.negotiation.is_proposing:
            return False
        self._session.negotiation.propose(tick, body, now)
        self._due = None
        return True

    def answer_change(self, proposal: events.ChangeProposed, refusal: str | None) -> None:
        """Answer a change that the peer has proposed, unless its session is over or it has proposed another one since.

        `proposal` is the event itself, which belongs to its session; `refusal` None to accept it, else a short reason.
        """
        if self._session is not None:
            self._session.negotiation.answer(proposal, refusal)
            self._due = None

    # --- its life

    def connect(self, now: float) -> None:
        """Begin: an initiator calls, a responder listens; StateError if begun before."""
        self._due = None
        self.state = moved(self.state, State.CONNECTING if self._calls else State.LISTENING)
        if self._calls:
            self._post(self._dialer.call(now))

    def close(self, now: float, reason: str) -> None:
        """Leave for good, and tell the peer why; the farewell is among the datagrams to send. StateError if closed."""
        self._due = None
        self.state = moved(self.state, State.CLOSED)
        self._part(now, reason)
        if self._stopper is not None:
            for _ in range(STOP_COPIES):
                self._post(*self._stopper)
        self._end_session()
        self._listener.settle()

    def check_keys(self, now: float) -> None:
        """End what began under keys that the suite does not hold any more, or that are not good for driving now."""
        self._due = None
        self._listener.settle()
        if self._calls or self._session is None or self._end.security.holds(self.peer_grant):
            return
        self._part(now, WITHDRAWN)
        self._leave(events.PeerClosed(WITHDRAWN), now)

    def _part(self, now: float, reason: str) -> None:
        if self._session is not None:  # nothing is heard or repeated from then on, so a lossy link gets copies at once
            for _ in range(1 + self._session.copies):
                self._post(self._session.send(now, wire.BYE, wire.cut(reason)))

    def next_timer(self) -> float | None:
        """Time of the next action of `handle_timer` [s]; None if there is none."""
        if self._due is None:
            due, session = self._dialer.due, self._session
            if session is not None:
                ends_at = session.liveness.silent_at if self.state is _ENGAGED else session.expires_at
                sends_at = session.next_timer(is_encoding=self._is_encoding)
                deaf_at = session.liveness.heard_at + self._end.silence if self._is_peer_heard else inf
                due = min(due, sends_at, ends_at, deaf_at)
            self._due = due
        return None if self._due == inf else self._due

    def handle_timer(self, now: float) -> None:
        """Do what is due: silence, calls, repeats, heartbeats. Early calls do no harm."""
        due = self._due if self._due is not None else self.next_timer()  # of most ticks it is known
        if due is None or now < due:
            return
        self._due = None
        self._watch_silence(now)
        session = self._session
        if session is not None:
            if self.state is _ENGAGED and self._is_encoding:
                if self._encoding_reported_at is not None and now - self._encoding_reported_at > self._encoding_report:
                    self._set_encoding(now, is_encoding=False)
                else:
                    for stream in session.take_lost(now):
                        self._tell(events.UpdateLost(stream))
            while data := session.handle_timer(now, is_encoding=self._is_encoding):
                self._post(data)
        if now >= self._dialer.due:
            self._post(self._dialer.hello(now))

    def _watch_silence(self, now: float) -> None:
        session, silence = self._session, self._end.silence
        if session is None:
            return
        if now >= self.silent_at:
            session.silent_since = self.silent_at
            self.state = moved(self.state, _SILENT)
            session.request_full_state()
            self._is_peer_heard = now - self.liveness.heard_at < 0.5 * FADE_SHARE * silence
            self._tell(events.PeerSilent(self._is_peer_heard))
            if self._calls:
                self._post(self._dialer.call(now))
        if self._is_peer_heard and now >= self.liveness.heard_at + silence:
            self._is_peer_heard = False
            self._tell(events.PeerSilent(is_heard=False))
        if self.state is _SILENT and now >= session.expires_at:
            self._leave(events.SessionExpired(), now)

    def _tell_encoding(self) -> None:
        session = self._session
        if session is not None and self.state is _ENGAGED and session.said_encoding is not self._is_encoding:
            session.heartbeats.is_answer_wanted = True
            self._due = None

    # --- the network

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        """Take one datagram that has come from `address`, whatever its bytes."""
        self._due = None
        if not data:
            self._drop(DropReason.TRUNCATED)
            return
        if self._calls and address != self.peer:
            self._drop(DropReason.FOREIGN_ADDRESS)
            return
        if data[0] in _HANDSHAKE:
            self._on_handshake(data, address, now)
            return
        if not self._shortest <= len(data) <= self._longest:
            self._drop(DropReason.TRUNCATED if len(data) < self._shortest else DropReason.WRONG_LENGTH)
            return
        session = self._session
        if session is not None and now >= session.expires_at:
            self._watch_silence(now)  # this process has stood still; datagrams that waited may be of any age
            session = self._session
        outcome = None if session is None else session.receive(data, now)
        if session is None or outcome is DropReason.BAD_TAG:
            self._on_foreign(data, address, now)
        else:
            self._on_authentic(session, outcome, address, now)

    def _on_handshake(self, data: bytes, address: Address, now: float) -> None:
        if self.state in (State.IDLE, State.CLOSED) or (data[0] == Kind.WELCOME) is not self._calls:
            self._drop(DropReason.UNEXPECTED)
            return
        if len(data) > wire.LONGEST_DATAGRAM:
            self._drop(DropReason.WRONG_LENGTH)
            return
        if self._calls:
            self._on_welcome(data, address, now)
            return
        serving = None if self._session is None else self._served
        reply = self._listener.on_hello(data, address, now, serving=serving, is_engaged=self.state is _ENGAGED)
        if isinstance(reply, DropReason):
            self._drop(reply)
            return
        welcome, refusal, stopper = reply
        if stopper:
            self._stopper = welcome, address
            self._tell(events.StopAsked(stopper))
        else:
            self._post(welcome, address)
        if refusal is None:
            self.statistics.received += 1
            return
        self._drop(DropReason.REFUSED)
        if self._session is None:
            self._tell(events.Refused(one_line(refusal, wire.LONGEST_DATAGRAM)))

    def _told(self) -> dict[str, object]:
        """What a watcher is told, besides our name."""
        serves = self._served if self._session is not None else None
        return {"state": self.state.name.lower(), "serves": "" if serves is None else serves.name, **self.told()}

    def _on_welcome(self, data: bytes, address: Address, now: float) -> None:
        answer = self._dialer.on_welcome(data, now)
        # Any other was not opened.
        self.statistics.received += not isinstance(answer, DropReason) or answer is DropReason.STALE
        if isinstance(answer, DropReason):
            self._drop(answer)
        elif isinstance(answer, Session):
            self._establish(answer, address)
            self._post(answer.send_heartbeat(now))
        elif isinstance(answer, events.Told):
            self._leave(answer, now, for_good=True)
        elif answer is not None:
            self._leave(events.Refused(one_line(answer, wire.LONGEST_DATAGRAM)), now, for_good=True)

    def _on_foreign(self, data: bytes, address: Address, now: float) -> None:
        """Take a datagram that is not of the present session: the first of a pending one makes that the present one."""
        pending = next((each for each in self._listener.pending if each.session.is_authentic(data)), None)
        if pending is None:
            if self._former is not None and self._former.is_authentic(data):
                self._drop(DropReason.WRONG_SESSION)
            else:
                self._drop(DropReason.NO_SESSION if self._session is None else DropReason.BAD_TAG)
            return
        session, caller, replaced = pending.session, pending.hello, self._served
        if now - session.liveness.heard_at > self._end.silence + self._end.longest_round_trip:
            self._drop(DropReason.STALE)
            return
        outcome = session.receive(data, now)
        if not session.is_fresh or now >= session.liveness.silent_at:
            self._drop(outcome if isinstance(outcome, DropReason) else DropReason.STALE)
            return
        self._listener.confirm(pending)
        self._served, self.peer_grant = caller, pending.grant
        if self._session is not None and replaced is not None and caller.instance != replaced.instance:
            self._post(self._session.send(now, wire.BYE, wire.cut(TAKEN_OVER + caller.name)))
        # The master has received the WELCOME at the address that it called from, and so has proved that address.
        self._establish(session, pending.address)
        self._on_authentic(session, outcome, address, now)

    def _on_authentic(self, session: Session, outcome: Outcome, address: Address, now: float) -> None:
        self._dialer.has_served = True
        session.measure()
        check = self._address
        if check is not None:
            check.on_datagram(address, now, is_fresh=session.is_newest and session.is_fresh)
            self.peer = check.address
            if (challenge := check.challenge(now)) is not None:
                self._post(session.send(now, wire.PATH, challenge[0]), challenge[1])
        if self.state is _SILENT and session.is_fresh and now < session.liveness.silent_at:
            self.state = moved(self.state, _ENGAGED)
            session.silent_since = inf
            session.liveness.resume(now)
            session.prove()
            self._is_peer_heard = False
            self._dialer.stop()
            self._tell_encoding()
            self._tell(events.PeerReturned())
        if self.on_heard is not None and outcome is not DropReason.REPLAYED:
            token = outcome.token if isinstance(outcome, events.PathProbe) and outcome.is_answer else b""
            self.on_heard(session.sequence, now, token)
        if isinstance(outcome, DropReason):
            self._drop(outcome)
        elif isinstance(outcome, events.UpdateReceived):
            self.statistics.updates_received[outcome.stream] += 1
            if self.on_update is None or self.events or not self.on_update(outcome):
                self._tell(outcome)
        elif isinstance(outcome, events.PathProbe) and not outcome.is_answer:
            self._post(session.send(now, wire.PATH, outcome.token, mark=True), address)
        elif outcome is not None:
            self._on_message(outcome, now)

    def _on_message(
        self, outcome: events.PathProbe | events.PeerClosed | events.ChangeProposed | events.ChangeAnswered, now: float
    ) -> None:
        if isinstance(outcome, events.PathProbe):
            if self._address is not None:
                self._address.on_answer(outcome.token, now)
                self.peer = self._address.address
        elif isinstance(outcome, events.PeerClosed):
            if self._calls and outcome.reason.startswith(TAKEN_OVER):  # calling again would take the slave back
                self._leave(events.TakenOver(outcome.reason.removeprefix(TAKEN_OVER)), now, for_good=True)
            elif self._calls and outcome.reason == WITHDRAWN:
                self._leave(events.Refused(outcome.reason), now, for_good=True)
            else:
                self._leave(outcome, now)
        else:
            self._tell(outcome)

    # --- sessions

    def _establish(self, session: Session, address: Address) -> None:
        self.state = moved(self.state, _ENGAGED)
        self._end_session()
        self._session = session
        if self.sessions > 0:
            session.prove()
        self.sessions += 1
        self.liveness, self.clock, self.credit = session.liveness, session.clock, session.credit
        self._tell_encoding()
        self.peer = address
        if not self._calls:
            quiet = min(LONGEST_QUIET, QUIET_SHARE * self._end.silence)
            self._address = AddressCheck(address, self._end.entropy, quiet)
        self.events.clear()  # what has not been read of the session before is void
        self.events.append(events.Connected(address, self._end.agreement))

    def _leave(self, why: Event, now: float, *, for_good: bool = False) -> None:
        """End the session, because of the peer; call or listen again, unless it is for good."""
        self.state = moved(self.state, State.CLOSED if for_good else State.IDLE)
        self._end_session()
        self._tell(why)
        if not for_good:
            self.connect(now)

    def _end_session(self) -> None:
        self._dialer.stop()
        self._address = None
        self._is_peer_heard = False
        if self._session is not None:
            self._former, self._session = self._session, None
            self.clock, self.credit = self._no_clock, Credit()

    # --- queues

    def _post(self, datagram: bytes, address: Address | None = None) -> None:
        """Send to an address, or to the peer, whose address is known as soon as there is a session, or a call."""
        to, statistics = address or self.peer, self.statistics
        if to is None:
            return
        if len(self._datagrams) >= QUEUED_DATAGRAMS:
            del self._datagrams[0]
            statistics.overflowed += 1
        self._datagrams.append((datagram, to))
        statistics.sent += 1
        statistics.bytes_sent += len(datagram)

    def _tell(self, event: Event) -> None:
        if len(self.events) >= QUEUED_EVENTS:
            self.events.popleft()
        self.events.append(event)

    def _drop(self, reason: DropReason) -> None:
        self.statistics.dropped[reason] += 1
        self.statistics.drops += 1
        if len(self.events) < QUEUED_EVENTS // 2:
            self.events.append(events.DatagramDropped(reason))
