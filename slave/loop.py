"""The teleoperator's side of the loop, one tick at a time.

Owns the order of a tick: hear the peer, command the robot to the decoded position, read what it feels, send the force
if it must be sent. Knows no clock, socket or file: `now` comes in, and the endpoint's datagrams are fetched by whoever
carries them, in real time or in virtual time.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from math import ceil, nan
from typing import TYPE_CHECKING

from weberlink.codec import Decoder, Encoder, Update
from weberlink.codec.predictors.model import UNFITTED
from weberlink.control.contract import LinkQuality, SlaveControl
from weberlink.control.tuning import Tuning
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import (
    ChangeAnswered,
    ChangeProposed,
    Connected,
    DatagramDropped,
    Event,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    SessionExpired,
    TakenOver,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.states import State
from weberlink.realtime.stall import StallDetector
from weberlink.realtime.watchdog import Watchdog
from weberlink.slave.robots.contract import Explaining, Robot, RobotFault
from weberlink.slave.safety import CommandGuard
from weberlink.telemetry.fault import Fault, FaultLedger
from weberlink.telemetry.link import counters, delays
from weberlink.telemetry.record import NO_ROTATION, RELEASED, UNKNOWN, Record

if TYPE_CHECKING:  # what a session of three degrees of freedom does not import
    from weberlink.slave.rotation import ToolRotation


class SlaveLoop:
    """The slave: robot, position decoder, force encoder, safety, endpoint.

    Args:
        robot: the teleoperator, not yet open.
        encoder: of the backward (force) channel.
        decoder: of the forward (position) channel.
        control: the teleoperator's side of the scheme that keeps a delayed loop stable.
        tuning: the settings that may change while a session lives.
        endpoint: the responder's end of the session.
        guard: bounds what the robot is commanded.
        tick_period: of both sides, as agreed [s].
        horizon: how long a motion is extrapolated past the last sign of the peer's encoder [s].
        robot_limit: how long the robot may go without a usable sample [s].
        trip_force: contact force above which the robot stops following and backs off [N].
        stopwatch: seconds from anywhere, for the time spent coding; a constant in virtual time.
        by_button: whether the master leads only while its operator holds a button; for the record alone.
        rotation: the second stream; None for three degrees of freedom.
    """

    def __init__(
        self,
        *,
        robot: Robot,
        encoder: Encoder,
        decoder: Decoder,
        control: SlaveControl,
        tuning: Tuning,
        endpoint: Endpoint,
        guard: CommandGuard,
        tick_period: float,
        horizon: float,
        robot_limit: float,
        trip_force: float,
        stopwatch: Callable[[], float],
        by_button: bool = False,
        rotation: "ToolRotation | None" = None,
    ) -> None:
        self.endpoint = endpoint
        self.robot = robot
        self.encoder = encoder
        self.decoder = decoder
        self.control = control
        self.tuning = tuning
        self._guard = guard
        self._tick_period = tick_period
        self._pace = StallDetector(tick_period)
        self._horizon = horizon
        # A reading that saturates at the limit is not above it.
        self._trip_squared = (trip_force * (1.0 + 1e-9)) ** 2
        self._is_overloaded = False
        self._watchdog = Watchdog(robot_limit)
        self._stopwatch = stopwatch
        self._by_button = by_button
        self.rotation = rotation
        self._stopped = False
        self._stopping: str | None = None
        self.failure: str | None = None
        """Why the run ends otherwise than by request; None while it does not."""
        self._faults = FaultLedger()
        self._is_led = False
        self._is_fresh = True
        self._last_reading_at = nan
        self._commanded: Vector = ZERO
        self._applied: Vector = ZERO
        self._force: Vector = ZERO
        self._where: Vector = ZERO
        self._tick = 0
        self._deadline = 0.0
        self._held: Vector | None = None
        self._fitted = UNFITTED
        self._sent = 0
        self._received = 0
        self._codec_time = 0.0

    @property
    def stopped(self) -> bool:
        return self._stopped

    @property
    def outcome(self) -> str | None:
        """How the run ends, once that is decided: the failure, or the reason given to `stop`."""
        return self.failure or self._stopping

    @property
    def faults(self) -> dict[str, int]:
        """How often each fault occurred, by name."""
        return self._faults.counts

    def open(self, now: float) -> None:
        """Open the robot and listen.

        Raises:
            RobotFault: if the robot cannot be opened.
        """
        self.robot.open(now)
        self._applied = self._where = self.robot.latest(now).position
        self._guard.place(self._applied)
        self.endpoint.connect(now)

    def close(self) -> None:
        self.robot.close()

    def tick(self, index: int, deadline: float, now: float) -> None:
        """Do the work of tick `index`, due at `deadline`, at `now` [s]."""
        self._tick, self._deadline = index, deadline
        self._sent = self._received = 0
        self._codec_time = 0.0
        elapsed = self._pace.tick(now)
        if self._pace.settling:
            self._settle(now)
        self._hear()
        self._retune(index, deadline)
        self._engage(now)
        self._move(now, elapsed)
        self._feel(now)
        encodes = self.endpoint.state is State.ENGAGED and not self._pace.settling
        self.endpoint.report_encoding(now, is_encoding=encodes)
        if encodes:
            self._send(index, now)
        else:
            self._held = self.encoder.mirror.value(index, self._applied)

    def propose(self, change: Mapping[str, object], now: float) -> str | None:
        """Ask the peer for other settings from one tick on; why not, or None and `tuning.verdict` follows."""
        why_not = self.tuning.complaint(change)
        if why_not is not None:
            return why_not
        if self.endpoint.state is not State.ENGAGED:
            return "no session: the other side is not there"
        tick = self._tick + ceil(self.tuning.lead(self.endpoint.rtt) / self._tick_period)
        if not self.endpoint.propose_change(now, tick, self.tuning.ask(change)):
            raise AssertionError("one change at a time is what the tuning sees to")
        return None

    def stop(self, now: float, reason: str) -> None:
        """Leave the session; the robot holds where it is."""
        if self._stopped:
            return
        self._stopping = reason
        self._guard.release()
        self._leave(now, reason)
        self._stopped = True

    def fail(self, now: float, error: BaseException) -> None:
        """Hold and leave, at once; no tick follows."""
        self.robot.command(self._applied, now)
        if self.rotation is not None:
            self.rotation.hold(now)
        self._leave(now, f"failed: {error}")

    def record(self, *, lateness_us: float = 0.0, work_us: float = 0.0, missed: int = 0) -> Record:
        """What happened in the tick just done, as telemetry writes it."""
        statistics, rotation = self.endpoint.statistics, self.rotation
        peer_at = self.endpoint.peer_time(self._deadline)
        model = self._fitted
        held = self._held
        return Record._make(  # a call with so many arguments costs three times as much
            (
                self._deadline,
                nan if peer_at is None else peer_at,
                *self._commanded,
                *self._force,
                *(held if held is not None else ZERO),
                *(self.encoder.predicted or UNKNOWN),
                *self._applied,
                self.encoder.bound,
                self._tick,
                missed,
                0,
                *counters(statistics),
                lateness_us,
                work_us,
                self._codec_time * 1e6,
                *delays(statistics),
                self.control.tank,
                *model.surface,
                model.size,
                model.stiffness,
                self.endpoint.state.value,
                self._faults.active,
                self.control.active,
                self.encoder.mirror.selected,
                self._sent,
                self._received,
                self._guard.clipped or (rotation is not None and rotation.guard.clipped),
                self._ramping,
                model.kind,
                self.tuning.generation & 0xFF,
                0,
                self.decoder.selected,
                *(
                    NO_ROTATION
                    if rotation is None
                    else rotation.record(self._tick, statistics.updates_sent[1], statistics.updates_received[1])
                ),
            )
        )

    def _retune(self, index: int, deadline: float) -> None:
        if self.tuning.pending is not None:
            peer_time = self.endpoint.peer_time(deadline)
            self.tuning.advance(index, None if peer_time is None else peer_time / self._tick_period)

    def _leave(self, now: float, reason: str) -> None:
        if self.endpoint.state is not State.CLOSED:  # which a refusal has brought about already
            self.endpoint.close(now, reason)

    def _hear(self) -> None:
        while (event := self.endpoint.next_event()) is not None:
            self._take(event)

    def _take(self, event: Event) -> None:
        match event:
            case UpdateReceived():
                self._apply(event.update, event.stream)
            case Connected():
                self._begin()
            case PeerSilent(is_heard):
                self._faults.meet(Fault.UNHEARD if is_heard else Fault.SILENCE)
            case Refused():
                self._faults.note(Fault.REFUSED)  # of whoever called; the session, if there is one, lives on
            case PeerReturned():
                self._faults.clear(Fault.SILENCE, Fault.UNHEARD)
                self._forget()
            case UpdateLost(stream):
                self._encoder_of(stream).restart()
            case ChangeProposed(tick, body):
                self.endpoint.answer_change(self.tuning.hear(tick, body))
            case ChangeAnswered(tick, body, why_not):
                self.tuning.settle(tick, body, why_not)
            case PeerClosed() | SessionExpired() | TakenOver() | DatagramDropped():
                pass  # `_engage` sees by the state that nobody leads any more; the endpoint counts what it drops

    def _begin(self) -> None:
        """A new session: nothing of the last one holds but a trip, which is between the robot and what it touches."""
        self._forget()
        self._is_fresh = True
        self.control.reset()
        self.tuning.reset()
        self._faults.clear(*(fault for fault in Fault if fault is not Fault.TRIPPED))

    def _forget(self) -> None:
        """Keep no sample, and show no force until the robot is where it is commanded."""
        self.encoder.reset()
        self.decoder.reset()
        self._fitted = UNFITTED
        self._guard.reset()
        if self.rotation is not None:
            self.rotation.reset()
        self._is_led = False

    def _encoder_of(self, stream: int) -> Encoder:
        return self.encoder if not stream or self.rotation is None else self.rotation.encoder

    def _settle(self, now: float) -> None:
        """After a stall of this process the robot may be elsewhere: hold it where it is until it has been read anew."""
        self._faults.clear(Fault.STALLED)
        if self._pace.stalled:
            self._faults.meet(Fault.STALLED)
            self._watchdog.feed(now)  # it is asked anew before it counts as lost
        self._is_led = False
        if self._faults.active is Fault.DEVICE:
            return
        with suppress(RobotFault):  # which `_feel` meets in this very tick
            where = self.robot.latest(now).position
            if is_finite(where):
                self._where = where
                self._guard.place(where)
        if self.rotation is not None:
            self.rotation.guard.reset()

    def _engage(self, now: float) -> None:
        """Decide whether the master leads the robot in this tick; begin afresh when it does again, let go when it ends.

        To begin afresh is to send a complete update, to approach, and to fade in what is shown.
        """
        if self._pace.settling:
            return
        is_led = self.endpoint.is_peer_encoding(now) and self._faults.active is not Fault.DEVICE
        if is_led is self._is_led:
            return
        self._is_led = is_led
        if not is_led:
            self.decoder.reset()
            self.endpoint.request_full_state()
            self._guard.release(self._force, self._where)
            if self.rotation is not None:
                self.rotation.decoder.reset()
                self.rotation.guard.release()
        elif self._is_fresh:
            self._is_fresh = False
        else:
            self.encoder.restart()
            if self.rotation is not None:
                self.rotation.encoder.restart()
            self.control.resume(self.endpoint.peer_credit)

    @property
    def _ramping(self) -> int:
        """Of the record: whether less than all of the force is shown, and whether that is the operator's wish."""
        if self._by_button and self.endpoint.state is State.ENGAGED and not (self._is_led or self._pace.settling):
            return RELEASED
        return self._guard.ramping or (self.rotation is not None and self.rotation.guard.ramping)

    def _apply(self, update: Update, stream: int) -> None:
        began = self._stopwatch()
        try:
            if stream:
                assert self.rotation is not None
                self.rotation.decoder.apply(update)
            else:
                self.decoder.apply(update)
                self._received += 1
        except ValueError:  # from a peer that agreed on this channel and does not keep to it
            self._faults.note(Fault.UPDATE)
        self._codec_time += self._stopwatch() - began

    def _move(self, now: float, elapsed: float) -> None:
        """Command the robot: where the decoder says while the peer is there, otherwise as the guard holds."""
        commanded = turned = None
        if self._is_led and not self._is_overloaded:
            peer_time = self.endpoint.latest_receivable_peer_time(
                min(now, self.endpoint.liveness.encoder_heard_at + self._horizon)
            )
            tick = (peer_time or 0.0) / self._tick_period
            began = self._stopwatch()
            commanded = self.decoder.value(tick)
            turned = None if self.rotation is None else self.rotation.decoder.value(tick)
            self._codec_time += self._stopwatch() - began
        step = self._pace.step
        if commanded is None:
            self._applied = self._guard.hold(step)
        else:
            self._commanded = commanded
            self._applied = self._guard.follow(self._controlled(commanded, elapsed), step)
        if self._faults.active is not Fault.NONE and not self._guard.tripped:
            self._faults.clear(Fault.TRIPPED)
        self.robot.command(self._applied, now)
        if self.rotation is not None:
            self.rotation.move(None if self._guard.tripped else turned, step, now)

    def _controlled(self, commanded: Vector, elapsed: float) -> Vector:
        """Where the control lets the robot go."""
        endpoint = self.endpoint
        quality = LinkQuality(endpoint.rtt, endpoint.jitter)
        return self.control.follow(commanded, self._applied, elapsed, endpoint.peer_credit, quality)

    def _feel(self, now: float) -> None:
        """The robot's force; the last good one while it gives none, until that has lasted too long."""
        if self._faults.active is Fault.DEVICE:
            return
        complaint = "gives no new sample"
        try:
            reading = self.robot.latest(now)
        except RobotFault as fault:
            self._lose_robot(str(fault), now)
            return
        if not is_finite(reading.force):
            complaint = f"reports the force {reading.force}"
        elif self.rotation is not None and not self.rotation.feel(reading.torque):
            complaint = f"reports the torque {reading.torque}"
        elif reading.at != self._last_reading_at:
            self._last_reading_at = reading.at
            self._force, self._where = reading.force, reading.position
            self._watchdog.feed(now)
            x, y, z = reading.force
            self._is_overloaded = x * x + y * y + z * z > self._trip_squared
            if self._is_overloaded and not self._guard.tripped:
                self._faults.meet(Fault.TRIPPED)
                self._guard.trip(self._force, self._where)
                if self.rotation is not None:
                    self.rotation.guard.release()
        if self._watchdog.expired(now):
            trouble = self.robot.trouble if isinstance(self.robot, Explaining) else None
            why = f": {trouble}" if trouble else ""
            self._lose_robot(f"{self.robot.spec.name} {complaint}{why}", now)

    def _lose_robot(self, complaint: str, now: float) -> None:
        self._faults.meet(Fault.DEVICE)
        self.failure = f"robot fault: {complaint}"
        self.stop(now, self.failure)

    def _send(self, index: int, now: float) -> None:
        """Send the force that may be shown: a zero while the robot is on its way is an update like any other."""
        self.control.observe(self._applied, self._force)
        self.endpoint.credit = self.control.credit
        began = self._stopwatch()
        update = self.encoder.encode(index, self._shown(self._force), self._applied)
        turned = None if self.rotation is None else self.rotation.encode(index, self._shown(self.rotation.torque))
        self._codec_time += self._stopwatch() - began
        self._held = self.encoder.predicted
        if update is not None:
            newest = self.encoder.mirror.newest
            assert newest is not None
            self._held = newest.value
            self.endpoint.send_update(now, update)
            self._sent = 1
            self._fitted = self.encoder.mirror.record
        if turned is not None:
            self.endpoint.send_update(now, turned, stream=1)

    def _shown(self, felt: Vector) -> Vector:
        """What may be shown of a force or torque: all, once position and orientation are where the operator's are."""
        shown = self._guard.shown(felt)
        return shown if self.rotation is None else self.rotation.guard.shown(shown)
