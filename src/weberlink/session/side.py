"""The side loop: what either end of a session does in a tick, in real or in virtual time."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import ceil, hypot, inf, isnan, nan
from typing import Any, NamedTuple

from weberlink.codec.outgoing import OutgoingChannel
from weberlink.control.contract import CREDIT_STEP
from weberlink.control.port import Port
from weberlink.geometry.vector import ZERO
from weberlink.order import EMERGENCY
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import (
    ChangeAnswered,
    ChangeProposed,
    DatagramDropped,
    DropReason,
    Event,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    StopAsked,
    TakenOver,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.states import State
from weberlink.realtime.stall import StallDetector
from weberlink.session.channels import IncomingChannel, Rows
from weberlink.session.tuning import MARGIN_TICKS, Tuning, change_margin
from weberlink.telemetry.fault import Fault, FaultLedger
from weberlink.telemetry.record import ALL, FORCE
from weberlink.telemetry.row import Row

CONNECT_PATIENCE = 1.0  # a run that ends without a session after longer than this has failed, not completed [s]

_ENGAGED = State.ENGAGED
_WITHOUT_SESSION = (State.CONNECTING, State.LISTENING)
_DEVICE, _UNFOUNDED, _NO_FAULT = Fault.DEVICE, Fault.UNFOUNDED, Fault.NONE
_UNDELIVERED = (Fault.UNDELIVERED, Fault.UNDELIVERED_SECOND)


class PeerFacts(NamedTuple):
    """What a side knows of its peer in words."""

    name: str = ""  # of the peer of the present session, or of the last one
    refusal: str = ""  # why the last call was refused, while there is no session
    farewell: str = ""  # the reason that the peer gave when it left the last session
    # Number of the key of a master, which does not tell the key, and what it is good for; "" without one
    key: str = ""
    right: str = ""


class Parts(NamedTuple):
    """What a side senses, actuates and codes, and which settings of that may change."""

    port: Port
    outgoing: Sequence[OutgoingChannel]
    incoming: Sequence[IncomingChannel]
    tuning: Tuning


class Side:
    """One end of the system: a port, its channels, and the endpoint that links it with the other end.

    Times are on the clock of the caller, which also fetches the endpoint's datagrams.

    Args:
        tick_period: of both sides, as agreed [s].
        horizon: how long a model is extrapolated past the last sign of the peer's encoder [s].
        patience: longest time without a new usable reading of the device or robot [s].
        stopwatch: a clock [s], for the time spent in the codec; a constant in virtual time.
        playout: how much later than an update that took the least delay every update is used [ticks]; 0 to use each at
            once.
    """

    def __init__(
        self,
        parts: Parts,
        endpoint: Endpoint,
        *,
        tick_period: float,
        horizon: float,
        patience: float,
        stopwatch: Callable[[], float],
        playout: int = 0,
    ) -> None:
        port, outgoing, incoming, tuning = parts
        self.port, self.outgoing, self.incoming, self.tuning = port, outgoing, incoming, tuning
        self.endpoint = endpoint
        self.failure: str | None = None  # why the run ends otherwise than by request; None while it does not
        self.stopped = False
        self.index = 0
        self.deadline = 0.0
        self.codec_time = 0.0  # time that the codec took since the last record [s]
        self.engaged = False  # whether the updates of the peer are acted on
        self.peer = PeerFacts()  # replaced when there is news
        self.pace = StallDetector(tick_period)
        self._leads = port.leads
        self._tick_period, self._horizon = tick_period, horizon
        self._patience, self._stopwatch = patience, stopwatch
        self._stopping: str | None = None
        self._faults = FaultLedger()
        self._opened_at = 0.0
        self._session = 0  # number of the session, as the endpoint counts them; 0 before the first
        self._encodes = False
        self._is_fresh, self._is_paused = True, False
        self._is_unfounded, self._undelivered = False, 0
        self._last_reading_at = nan
        self._sensed_at = inf  # when a usable reading came last, or the first was asked for; inf before that
        self._peer_tick = 0.0
        self._credit = 0  # energy that this end has told the peer of, or will
        self._playout = playout
        self._waiting: deque[tuple[float, UpdateReceived]] = deque()  # updates that are not to be used yet
        self._row = Row()
        self._rows = Rows(outgoing, incoming, port)
        self.layout = self._rows.layout  # of the records of this side
        self._datagrams = -1  # sent, received and refused, as in the row
        self.send_at_once: Callable[[float], None] | None = None
        """Sends what the endpoint has ready at a time [s], so that an update leaves before the rest of the tick."""
        endpoint.told, endpoint.on_update = self.told, None if playout else self._apply

    @property
    def outcome(self) -> str | None:
        """How the run ends, once that is decided: the failure, or the reason given to `stop`."""
        return self.failure or self._stopping

    @property
    def faults(self) -> dict[str, int]:
        return self._faults.counts

    @property
    def drops(self) -> dict[str, int]:
        """Number of datagrams refused, by reason."""
        return {str(reason): count for reason, count in self.endpoint.statistics.dropped.items()}

    def open(self, now: float) -> None:
        """Open the device or robot, and call the peer or listen.

        Raises:
            RuntimeError: the device or robot cannot be opened.
        """
        self._opened_at = now
        self.port.open(now)
        self.endpoint.connect(now)

    def close(self) -> None:
        self.port.close()

    def tick(self, index: int, deadline: float, now: float) -> None:
        """Do the work of tick `index`, due at `deadline`, at `now` [s]."""
        self.index, self.deadline = index, deadline
        elapsed = self.pace.tick(now)
        if self.pace.settling:
            self._settle(now)
        endpoint = self.endpoint
        if endpoint.events or endpoint.sessions != self._session:
            self._receive(now)
        if self.tuning.agreed:
            peer_time = endpoint.clock.peer_time(deadline)
            self._guarded(self.tuning.advance, index, None if peer_time is None else peer_time / self._tick_period)
        # The tick of the peer for which this tick decodes: now, but not long past its encoder's last sign.
        encoder_heard_at = endpoint.liveness.encoder_heard_at
        if encoder_heard_at > -inf:
            until = encoder_heard_at + self._horizon
            peer_time = endpoint.clock.latest_receivable_peer_time(now if now < until else until)
            if peer_time is not None:  # a session that is over leaves its last force, which fades
                self._peer_tick = peer_time / self._tick_period
        # What took less than the least delay and the play-out has waited until its tick has come.
        while self._waiting and self._waiting[0][1].update.tick <= self._peer_tick - self._playout:
            left_at, event = self._waiting.popleft()
            if endpoint.liveness.is_fresh(now - left_at, endpoint.liveness.generation):
                self._apply(event)
            else:  # this process stood still meanwhile: nothing is used that is older than the limit
                endpoint.request_full_state()
        if self._leads:
            self._sense(now)
            self._engage(now)
            self._send(index, now, elapsed)
            self._actuate(now, elapsed)
        else:
            self._engage(now)
            self._actuate(now, elapsed)
            self._sense(now)
            self._send(index, now, elapsed)
        if self._stopping is not None and not self.stopped and self.port.at_rest:
            self._leave(now, self._stopping)

    def propose(self, change: Mapping[str, object], now: float) -> str | None:
        """Ask the peer for other settings from one tick on; why not, or None and `tuning.result` follows."""
        complaint = self.tuning.complaint(change)
        if complaint is not None:
            return complaint
        if self.endpoint.state is not State.ENGAGED or self.endpoint.sessions != self._session:
            return "no session: the other side is not there"
        body = self.tuning.propose(change)
        ahead = change_margin(self.endpoint.clock.rtt, self.endpoint.clock.jitter)
        tick = self.index + MARGIN_TICKS + ceil(ahead / self._tick_period)
        if not self.endpoint.propose_change(now, tick, body):
            raise AssertionError("the tuning allows one change at a time")
        return None

    def stop(self, now: float, reason: str) -> None:
        """Leave the session: the robot's end at once, the operator's end when the force has faded to zero."""
        if self._leads and self._stopping is None and reason == "completed" and self._session == 0:
            waited = now - self._opened_at
            if waited > CONNECT_PATIENCE:
                self.failure = f"the slave did not answer in {waited:.1f} s"
        self._stopping = self._stopping or reason
        if not self._leads and not self.stopped:
            self.port.release(retreat=False)
            self._leave(now, reason)

    def give_up(self, now: float, why: str) -> None:
        """Leave as `stop` does, and end the run as failed: there will be no session."""
        self.failure = self.failure or why
        self.stop(now, why)

    def emergency(self, now: float, by: str = "") -> None:
        """Zero force or hold at once, without a fade; leave in the next tick. The run ends as failed."""
        self.port.restart()  # closes the gate of the force
        self.port.halt(now)
        self.give_up(now, f"{EMERGENCY} by {by}" if by else EMERGENCY)

    def fail(self, now: float, error: BaseException) -> None:
        """Zero force or hold, and leave, at once; no tick follows."""
        self.port.halt(now)
        self._leave(now, f"failed: {error}")

    def told(self) -> dict[str, object]:
        """What who watches over the link is told of this end, besides the session."""
        row = self._row
        force = 0.0 if self.incoming[0].decoder.is_arm else hypot(*row.raw[FORCE])
        round_trip = row.rtt_us * 1e-3
        measured = {} if isnan(round_trip) else {"round_trip_ms": round(round_trip, 1)}
        return {"fault": self._faults.active.name.lower(), "force_n": round(force, 3), **measured}

    def record(self) -> tuple[float, ...]:
        """The telemetry of the tick just done, in virtual time: the values of a record with all axes and streams."""
        self._fill(0.0, 0.0, 0)
        return ALL.values(self._row)

    def values(self, lateness_us: float, work_us: float, missed: int) -> tuple[float, ...]:
        """The telemetry of the tick just done: the values of a record of this side's `layout`."""
        self._fill(lateness_us, work_us, missed)
        return self.layout.values(self._row)

    def _fill(self, lateness_us: float, work_us: float, missed: int) -> None:
        row, endpoint, port = self._row, self.endpoint, self.port
        statistics = endpoint.statistics
        self._rows.fill(row, statistics)
        peer_at = endpoint.clock.peer_time(self.deadline)
        row.at = self.deadline
        row.peer_at = nan if peer_at is None else peer_at
        row.tick = self.index
        row.ticks_missed = missed
        row.lateness_us = lateness_us
        row.work_us = work_us
        row.codec_us = self.codec_time * 1e6
        self.codec_time = 0.0
        datagrams = statistics.sent + statistics.overflowed + statistics.received + statistics.drops
        if datagrams != self._datagrams:  # else none of these has changed
            self._datagrams = datagrams
            row.datagrams_sent = statistics.sent
            row.datagrams_received = statistics.received
            row.datagrams_lost = statistics.lost
            row.datagrams_dropped = statistics.drops
            row.bytes_sent = statistics.bytes_sent
            row.updates_sent = statistics.updates_sent[0]
            row.updates_received = statistics.updates_received[0]
            row.repeats = statistics.repeats
            row.heartbeats = statistics.heartbeats
            row.rtt_us = nan if statistics.rtt is None else statistics.rtt * 1e6
            row.one_way_us = nan if statistics.one_way is None else statistics.one_way * 1e6
            row.jitter_us = nan if statistics.rtt is None else endpoint.clock.jitter * 1e6
            row.incoming_loss = statistics.incoming_loss
            row.outgoing_loss = statistics.outgoing_loss
            row.peer_burst = statistics.incoming_burst
        known = endpoint.credit.known
        row.energy = port.controls[0].energy
        row.credit = CREDIT_STEP * (known if known > self._credit else self._credit)
        row.state, row.fault = endpoint.state.value, self._faults.active
        row.weber, row.settings = self.tuning.settings.weber, self.tuning.generation & 0xFF
        port.report(row, is_led=self.engaged or self.pace.settling or endpoint.state is not _ENGAGED)

    def _leave(self, now: float, reason: str) -> None:
        self.stopped = True
        if self.endpoint.state is not State.CLOSED:  # a refusal has closed it already
            self.endpoint.close(now, reason)

    # --- what the peer says

    def _receive(self, now: float) -> None:
        endpoint = self.endpoint
        if endpoint.sessions != self._session:
            self._begin()
        while endpoint.events:
            event = endpoint.events.popleft()
            if not isinstance(event, UpdateReceived):
                self._on_event(event, now)
            elif self._playout:
                self._waiting.append((now - event.age, event))
            else:
                self._apply(event)

    def _apply(self, event: UpdateReceived) -> bool:
        """Apply an update, as it comes, so that the next tick needs no time for it; False if it must wait for that."""
        # A tick does nothing before it takes the updates, so what a decoder holds is not looked at in between.
        if self.endpoint.sessions != self._session:
            return False
        began, channel = self._stopwatch(), self.incoming[event.stream]
        try:  # as `_guarded`, without a call
            channel.decoder.apply(event.update)
            channel.received += 1
            if channel.learner is not None:
                newest: Any = channel.decoder.newest  # an update leaves a sample and a model of it
                model: Any = channel.decoder.model
                channel.learner.learn(model.surface(), newest.value, newest.position)
        except Exception:
            self._on_bad_contents()
        self.codec_time += self._stopwatch() - began
        return True

    def _on_event(self, event: Event, now: float) -> None:
        """Other events need nothing: `_receive` and `_engage` see the state, and the endpoint counts what it drops."""
        faults = self._faults
        match event:
            case PeerSilent(is_heard):
                faults.clear(Fault.UNHEARD)
                faults.meet(Fault.UNHEARD if is_heard else Fault.SILENCE)
            case PeerReturned():
                faults.clear(Fault.SILENCE, Fault.UNHEARD)
                self._forget()
            case UpdateLost(stream):
                self.outgoing[stream].encoder.restart()
            case ChangeProposed():
                self._guarded(self._answer, event, now)
            case ChangeAnswered(tick, body, refusal):
                self._guarded(self.tuning.on_answer, tick, body, refusal)
            case _:
                self._on_farewell(event, now)

    def _on_farewell(self, event: Event, now: float) -> None:
        """An event that says why there is no session, or why it ends."""
        match event:
            case PeerClosed(farewell):
                self.peer = self.peer._replace(farewell=farewell)
            case DatagramDropped(reason):
                if reason is DropReason.UNPROVEN and self.endpoint.state in _WITHOUT_SESSION:
                    self._faults.meet(Fault.UNPROVEN)
            case StopAsked(name):
                self.emergency(now, name)
            case TakenOver(name):
                self._faults.meet(Fault.TAKEN_OVER)
                self.give_up(now, f"taken over by {name}")
            case Refused(message):
                self.peer = self.peer._replace(refusal=message)
                self._faults.meet(Fault.REFUSED)
                if self._leads:  # a slave waits for another call
                    self.give_up(now, f"refused: {message}")

    def _guarded(self, take: Callable[..., Any], *contents: Any) -> Any:
        """Let something take contents of the peer; None if they made it raise."""
        try:
            return take(*contents)
        except Exception:
            self._on_bad_contents()
            return None

    def _on_bad_contents(self) -> None:
        """The one boundary to a peer that holds the keys and does not keep to what it has agreed to."""
        # Whatever its contents raise is its fault, and the loop goes on without all that it holds of the peer.
        self._faults.note(Fault.UPDATE)
        self._forget()
        self.endpoint.request_full_state()

    def _answer(self, proposal: ChangeProposed, now: float) -> None:
        # The tick of the peer at which nearly every answer that leaves now has arrived. The mapping of its clock errs
        # by half the asymmetry of the delays, so half a round trip more is exact.
        clock = self.endpoint.clock
        peer_time, rtt, answered_at = clock.peer_time(now), clock.rtt, inf
        if peer_time is not None and rtt is not None:
            answered_at = (peer_time + 0.5 * rtt + clock.jitter) / self._tick_period + 0.5 * MARGIN_TICKS
        refusal = self.tuning.on_proposal(proposal.tick, proposal.body, answered_at)
        self.endpoint.answer_change(proposal, refusal)

    def _begin(self) -> None:
        """Begin a new session: nothing of the last one holds but a trip, which concerns the robot's contact."""
        endpoint, is_first = self.endpoint, self._session == 0
        grant = endpoint.peer_grant
        self.peer = PeerFacts(endpoint.peer_name, key=grant.number, right=grant.right.value if grant.number else "")
        self._forget(is_first=is_first)
        self._session, self._is_fresh = endpoint.sessions, True
        for control in self.port.controls:
            control.reset()
        self.tuning.reset()
        self._faults.clear(*(fault for fault in Fault if fault is not Fault.TRIPPED))

    def _forget(self, *, is_first: bool = False) -> None:
        self._waiting.clear()
        for outgoing in self.outgoing:
            outgoing.encoder.reset()
            if not is_first:  # the peer must prove that it holds something: send it, even if it is nothing
                outgoing.encoder.restart()
        for incoming in self.incoming:
            incoming.decoder.reset()
        self.port.reset()
        self._encodes = self.engaged = self._is_paused = False

    # --- the parts of a tick

    def _settle(self, now: float) -> None:
        """After a stall of this process, ask the device or robot anew before it counts as lost."""
        self._faults.clear(Fault.STALLED)
        if self.pace.stalled:
            self._faults.meet(Fault.STALLED)
            self._sensed_at = now
        if self._faults.active is not _DEVICE:
            self.port.settle(now)

    def _sense(self, now: float) -> None:
        """Read the sensors; the last good samples stay while there are none, until that has lasted too long."""
        if self._faults.active is _DEVICE:
            return
        port = self.port
        try:
            reading = port.latest(now)
        except port.fault as fault:
            self._lose(str(fault), now)
            return
        if self._leads and reading.ended:
            self.stop(now, "completed")
        # A time that is NaN differs from every other one, as if there were news for ever.
        at = reading.at
        complaint = None if at - at == 0.0 else f"reports the time {at}"
        for channel in self.outgoing:
            complaint = channel.complaint(reading) or complaint
        if complaint is None and at != self._last_reading_at:
            self._last_reading_at = at
            for channel in self.outgoing:
                channel.take(reading)
            self._sensed_at = now
            if port.accept(reading):
                self._faults.meet(Fault.TRIPPED)
            return
        if self._sensed_at == inf:
            self._sensed_at = now
        if now - self._sensed_at > self._patience:
            why = f": {port.trouble}" if port.trouble else ""
            self._lose(f"{port.name} {complaint or 'gives no new sample'}{why}", now)

    def _lose(self, complaint: str, now: float) -> None:
        self._faults.meet(Fault.DEVICE)
        self._encodes = False
        self.port.restart()
        self.give_up(now, f"{self.port.kind} fault: {complaint}")

    def _engage(self, now: float) -> None:
        """Decide whether this tick may encode, and act on the peer's updates; begin afresh when either begins again."""
        # To begin afresh is to send complete updates and to fade in from zero. A stall ends both for some ticks, so
        # that the peer is told.
        pace, port, undelivered = self.pace, self.port, self.endpoint.undelivered(now)
        if undelivered != self._undelivered:
            self._undelivered = undelivered
            self._faults.clear(*_UNDELIVERED)
            if undelivered:
                self._faults.meet(_UNDELIVERED[undelivered - 1])
        encodes = (
            self.endpoint.state is _ENGAGED
            and port.enabled
            and not pace.settling
            and self._faults.active is not _DEVICE
            # What ended a moment ago fades out first: to begin afresh closes the gate at once.
            and (self._encodes or port.at_rest)
        )
        engaged = encodes and self.endpoint.may_follow(now) and self._stopping is None
        engaged = engaged and (self.engaged or port.at_rest)
        encoded, was_engaged = self._encodes, self.engaged
        if self._leads:  # told before energy is booked: what is said now carries the credit of the last tick
            self.endpoint.report_encoding(now, is_encoding=encodes)
        if encodes is encoded and engaged is was_engaged and not pace.stalled:
            return
        self._encodes, self.engaged = encodes, engaged
        begins = (engaged and not was_engaged) or (self._leads and encodes and not encoded)
        if (pace.stalled and self._leads) or (begins and not self._is_fresh):
            # After a release or a stall, hand and robot may be elsewhere.
            self._restart(anew=pace.stalled or not self._is_paused)
        # A pause: the operator still leads, but the encoder of the robot is not heard. The robot releases then, so only
        # the operator's end may continue with its contact and energy.
        holds = self._leads and encodes and not engaged and not pace.stalled
        self._is_paused = holds and (was_engaged or self._is_paused)
        if was_engaged and not engaged and not self._leads and not pace.settling:
            # The master no longer leads: whatever it sent is void.
            self._waiting.clear()
            for channel in self.incoming:
                channel.decoder.reset()
            self.endpoint.request_full_state()
            port.release(retreat=True)
        self._is_fresh = self._is_fresh and not engaged

    def _restart(self, *, anew: bool) -> None:
        """Fade in from zero, and send complete updates; `anew` resets the control scheme too."""
        for channel in self.outgoing:
            channel.encoder.restart()
        if anew:
            for control in self.port.controls:
                control.resume(self.endpoint.credit.known)
        if self._leads:  # the scheme has forgotten a model that the peer may hold for known
            self.endpoint.request_full_state()
        self.port.restart()

    def _send(self, index: int, now: float, elapsed: float) -> None:
        endpoint = self.endpoint
        if not self._leads:
            endpoint.report_encoding(now, is_encoding=self._encodes)
        self._credit = credit = self.port.account(elapsed, self._peer_tick, encodes=self._encodes)
        if credit != endpoint.credit.granted:
            endpoint.grant(credit)
        if not self._encodes:
            for channel in self.outgoing:
                channel.update = None
                position, _ = channel.sample(index)
                channel.encoder.idle(index, channel.value, position)
            return
        began = self._stopwatch()
        for channel in self.outgoing:
            position, most = channel.sample(index)
            channel.update = channel.encoder.encode(index, channel.sampled, position, most)
        self.codec_time += self._stopwatch() - began
        for stream, channel in enumerate(self.outgoing):
            if channel.update is not None:
                endpoint.send_update(now, channel.update, stream=stream)
                if self.send_at_once is not None:
                    self.send_at_once(now)

    def _actuate(self, now: float, elapsed: float) -> None:
        """Decode every channel for this very moment, less the play-out, without waiting for the network, and act."""
        began = self._stopwatch()
        values, tick = [], self._peer_tick - self._playout
        for channel in self.incoming:
            value, place = None, channel.place
            try:  # as `_guarded`, without a call
                value = channel.value(tick, ZERO if place is None else place.value)
            except Exception:
                self._on_bad_contents()
            values.append(value)
        self.codec_time += self._stopwatch() - began
        self.port.actuate(values, now, elapsed, self.pace.step, engaged=self.engaged)
        faults, port = self._faults, self.port
        if port.unfounded is not self._is_unfounded:
            self._is_unfounded = port.unfounded
            (faults.meet if self._is_unfounded else faults.clear)(_UNFOUNDED)
        if faults.active is not _NO_FAULT and not port.tripped:
            faults.clear(Fault.TRIPPED)
