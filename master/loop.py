"""The operator's side of the loop, one tick at a time.

Owns the order of a tick: hear the peer, read the device, send the position if it must be sent, render the force at the
device's own position. Knows no clock, socket or file: `now` comes in, and the endpoint's datagrams are fetched by
whoever carries them, in real time or in virtual time.
"""

from collections.abc import Callable, Mapping
from math import ceil, inf, nan
from typing import TYPE_CHECKING

from weberlink.codec import Decoder, Encoder, Update
from weberlink.codec.predictors.model import UNFITTED
from weberlink.control.contract import LinkQuality, MasterControl
from weberlink.control.tuning import Tuning
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.master.devices.contract import Device, DeviceFault, ReportsTrouble
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter
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
from weberlink.telemetry.fault import Fault, FaultLedger
from weberlink.telemetry.link import counters, delays
from weberlink.telemetry.record import NO_ROTATION, RELEASED, UNKNOWN, Record

if TYPE_CHECKING:  # what a session of three degrees of freedom does not import
    from weberlink.master.rotation import HandRotation

CONNECT_PATIENCE = 1.0
"""A run that ends without a session after longer than this has failed, not completed [s]."""


class MasterLoop:
    """The master: device, position encoder, force decoder, safety, endpoint.

    Args:
        device: the haptic device, not yet open.
        encoder: of the forward (position) channel.
        decoder: of the backward (force) channel.
        control: the operator's side of the scheme that keeps a delayed loop stable.
        tuning: the settings that may change while a session lives.
        endpoint: the initiator's end of the session.
        gate: fades the force in and out.
        limiter: bounds the force.
        slew: bounds how fast the force changes.
        tick_period: of both sides, as agreed [s].
        horizon: how long a model is extrapolated in time past the last sign of the peer's encoder [s].
        device_limit: how long the device may go without a usable sample [s].
        stopwatch: seconds from anywhere, for the time spent coding; a constant in virtual time.
        button: of the device; only while it is held, the robot follows and force is displayed. None for always.
        rotation: the second stream; None for three degrees of freedom.
    """

    def __init__(
        self,
        *,
        device: Device,
        encoder: Encoder,
        decoder: Decoder,
        control: MasterControl,
        tuning: Tuning,
        endpoint: Endpoint,
        gate: ForceGate,
        limiter: ForceLimiter,
        slew: SlewLimiter,
        tick_period: float,
        horizon: float,
        device_limit: float,
        stopwatch: Callable[[], float],
        button: int | None = None,
        rotation: "HandRotation | None" = None,
    ) -> None:
        self.endpoint = endpoint
        self.device = device
        self.encoder = encoder
        self.decoder = decoder
        self.control = control
        self.tuning = tuning
        self._gate = gate
        self._limiter = limiter
        self._slew = slew
        self._slew_ticks = 0
        self._tick_period = tick_period
        self._pace = StallDetector(tick_period)
        self._horizon = horizon
        self._watchdog = Watchdog(device_limit)
        self._stopwatch = stopwatch
        self._button = button
        self.rotation = rotation
        self._stopping: str | None = None
        self._stopped = False
        self.failure: str | None = None
        """Why the run ends otherwise than by request; None while it does not."""
        self._faults = FaultLedger()
        self._opened_at = 0.0
        self._has_connected = False
        self._encodes = False
        self._is_engaged = False
        self._is_fresh = True
        self._is_enabled = button is None
        self._last_reading_at = nan
        self._position: Vector = ZERO
        self._buttons = 0
        self._decoded: Vector = ZERO
        self._heard_tick = 0.0
        self._fitted = UNFITTED
        self._output: Vector = ZERO
        self._tick = 0
        self._deadline = 0.0
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
        """Open the device and start to call the peer.

        Raises:
            DeviceFault: if the device cannot be opened.
        """
        self._opened_at = now
        self.device.open(now)
        self.endpoint.connect(now)

    def close(self) -> None:
        self.device.close()

    def tick(self, index: int, deadline: float, now: float) -> None:
        """Do the work of tick `index`, due at `deadline`, at `now` [s]."""
        self._tick, self._deadline = index, deadline
        self._sent = self._received = 0
        self._codec_time = 0.0
        elapsed = self._pace.tick(now)
        if self._pace.settling:
            self._settle(now)
        self._hear(now)
        self._retune(index, deadline)
        self._read(now)
        self._engage(now)
        self._observe(elapsed)
        if self._encodes:
            self._send(index, now)
        self._render(now)
        if self._stopping is not None and self._gate.gain == 0.0 and not self._stopped:
            self._leave(now, self._stopping)
            self._stopped = True

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
        """Begin to fade the force out; the session is closed when it is at zero."""
        if self._stopping is None and reason == "completed" and not self._has_connected:
            waited = now - self._opened_at
            if waited > CONNECT_PATIENCE:
                self.failure = f"the slave did not answer in {waited:.1f} s"
        self._stopping = self._stopping or reason

    def fail(self, now: float, error: BaseException) -> None:
        """Zero force and leave, at once; no tick follows."""
        self.device.command(ZERO, now)
        if self.rotation is not None:
            self.rotation.relax(now)
        self._leave(now, f"failed: {error}")

    def record(self, *, lateness_us: float = 0.0, work_us: float = 0.0, missed: int = 0) -> Record:
        """What happened in the tick just done, as telemetry writes it."""
        statistics, rotation = self.endpoint.statistics, self.rotation
        peer_at = self.endpoint.peer_time(self._deadline)
        model = self._fitted
        return Record._make(  # a call with so many arguments costs three times as much
            (
                self._deadline,
                nan if peer_at is None else peer_at,
                *self._position,
                *self._position,
                *self._decoded,
                *(self.encoder.predicted or UNKNOWN),
                *self._output,
                self.encoder.bound,
                self._tick,
                missed,
                self._slew_ticks,
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
                self.decoder.selected,
                self._sent,
                self._received,
                self._limiter.clipped or (rotation is not None and rotation.clipped),
                self._gate.ramping if self._is_enabled else RELEASED,
                model.kind,
                self.tuning.generation & 0xFF,
                self._buttons & 0xFF,
                self.encoder.mirror.selected,
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

    def _hear(self, now: float) -> None:
        while (event := self.endpoint.next_event()) is not None:
            self._take(event, now)

    def _take(self, event: Event, now: float) -> None:
        match event:
            case UpdateReceived():
                self._apply(event.update, event.stream)
            case Connected():
                self._begin()
            case PeerSilent(is_heard):
                self._faults.meet(Fault.UNHEARD if is_heard else Fault.SILENCE)
            case PeerReturned():
                self._faults.clear(Fault.SILENCE, Fault.UNHEARD)
                self._forget()
            case PeerClosed() | SessionExpired() | Refused() | TakenOver():
                self._part(event, now)
            case UpdateLost(stream):
                self._encoder_of(stream).restart()
            case ChangeProposed(tick, body):
                self.endpoint.answer_change(self.tuning.hear(tick, body))
            case ChangeAnswered(tick, body, why_not):
                self.tuning.settle(tick, body, why_not)
            case DatagramDropped():
                pass  # counted by the endpoint; the session lives on

    def _encoder_of(self, stream: int) -> Encoder:
        return self.encoder if not stream or self.rotation is None else self.rotation.encoder

    def _part(self, event: PeerClosed | SessionExpired | Refused | TakenOver, now: float) -> None:
        """The session is over: the gate fades the last force out, and the endpoint calls anew or the run ends."""
        match event:
            case TakenOver(name):
                self._give_up(Fault.TAKEN_OVER, f"taken over by {name}", now)
            case Refused(message):
                self._give_up(Fault.REFUSED, f"refused: {message}", now)

    def _begin(self) -> None:
        """A new session: nothing of the last one holds."""
        self._has_connected = True
        self._forget()
        self._is_fresh = True
        self.control.reset()
        self.tuning.reset()
        self._faults.clear(*Fault)

    def _forget(self) -> None:
        """Keep no sample and no force."""
        self.encoder.reset()
        self.decoder.reset()
        if self.rotation is not None:
            self.rotation.reset()
        self._fitted = UNFITTED
        self._gate.close()
        self._encodes = self._is_engaged = False

    def _give_up(self, fault: Fault, why: str, now: float) -> None:
        """The other end does not want this master: fade out, and end the run as failed."""
        self._faults.meet(fault)
        self.failure = self.failure or why
        self.stop(now, fault.name.lower().replace("_", " "))

    def _settle(self, now: float) -> None:
        """Meet a stall of this process: the device is asked anew before it counts as lost."""
        self._faults.clear(Fault.STALLED)
        if self._pace.stalled:
            self._faults.meet(Fault.STALLED)
            self._watchdog.feed(now)

    def _engage(self, now: float) -> None:
        """Decide whether this tick may send positions and display force; begin afresh when either begins again.

        To begin afresh is to send a complete update and to fade the force in from zero. A stall ends both for some
        ticks, so that the peer is told.
        """
        endpoint, button = self.endpoint, self._button
        self._is_enabled = button is None or bool(self._buttons >> button & 1)
        encodes = (
            endpoint.state is State.ENGAGED
            and self._is_enabled
            and not self._pace.settling
            and self._faults.active is not Fault.DEVICE
        )
        is_engaged = encodes and endpoint.is_peer_encoding(now) and self._stopping is None
        endpoint.report_encoding(now, is_encoding=encodes)
        if encodes is self._encodes and is_engaged is self._is_engaged and not self._pace.stalled:
            return
        begins = (encodes and not self._encodes) or (is_engaged and not self._is_engaged)
        if self._pace.stalled or (begins and not self._is_fresh):
            self.encoder.restart()
            if self.rotation is not None:
                self.rotation.encoder.restart()
            self.control.resume(endpoint.peer_credit)
            self._gate.close()
        self._is_fresh = self._is_fresh and not is_engaged
        self._encodes, self._is_engaged = encodes, is_engaged

    def _apply(self, update: Update, stream: int) -> None:
        began = self._stopwatch()
        try:
            if stream:
                assert self.rotation is not None
                self.rotation.decoder.apply(update)
            else:
                self.decoder.apply(update)
                newest = self.decoder.newest
                assert newest is not None
                self._fitted = self.decoder.record
                self.control.learn(self.decoder.surface, newest.value, newest.position)
                self._received += 1
        except ValueError:  # from a peer that agreed on this channel and does not keep to it
            self._faults.note(Fault.UPDATE)
        self._codec_time += self._stopwatch() - began

    def _read(self, now: float) -> None:
        """The device's position; the last good one while it gives none, until that has lasted too long."""
        if self._faults.active is Fault.DEVICE:
            return
        complaint = "gives no new sample"
        try:
            reading = self.device.latest(now)
        except DeviceFault as fault:
            self._lose_device(str(fault), now)
            return
        if not is_finite(reading.position):
            complaint = f"reports the position {reading.position}"
        elif self.rotation is not None and not self.rotation.read(reading.orientation):
            complaint = f"reports the orientation {reading.orientation}"
        elif reading.at != self._last_reading_at:
            self._last_reading_at = reading.at
            self._position = reading.position
            self._buttons = reading.buttons
            self._watchdog.feed(now)
        if reading.ended:
            self.stop(now, "completed")
        if self._watchdog.expired(now):
            trouble = self.device.trouble if isinstance(self.device, ReportsTrouble) else None
            why = f": {trouble}" if trouble else ""
            self._lose_device(f"{self.device.spec.name} {complaint}{why}", now)

    def _lose_device(self, complaint: str, now: float) -> None:
        self._faults.meet(Fault.DEVICE)
        self._gate.close()
        self.failure = f"device fault: {complaint}"
        self.stop(now, self.failure)

    def _observe(self, elapsed: float) -> None:
        """Book the work of the tick that has passed, and say in every datagram what was handed over."""
        endpoint = self.endpoint
        quality = LinkQuality(endpoint.rtt, endpoint.jitter)
        self.control.observe(self._position, elapsed, endpoint.peer_credit, quality)
        endpoint.credit = self.control.credit

    def _send(self, index: int, now: float) -> None:
        began = self._stopwatch()
        update = self.encoder.encode(index, self._position)
        turned = None if self.rotation is None else self.rotation.encode(index)
        self._codec_time += self._stopwatch() - began
        if update is not None:
            self.endpoint.send_update(now, update)
            self._sent = 1
        if turned is not None:
            self.endpoint.send_update(now, turned, stream=1)

    def _render(self, now: float) -> None:
        """The force at the device's own position now, without waiting for the network."""
        endpoint, step = self.endpoint, self._pace.step
        liveness = endpoint.liveness
        known_at = liveness.encoder_heard_at
        peer_time = (
            endpoint.latest_receivable_peer_time(min(now, known_at + self._horizon)) if known_at > -inf else None
        )
        if peer_time is not None:  # a session that is over leaves its last force, which fades
            self._heard_tick = peer_time / self._tick_period
        tick = self._heard_tick
        began = self._stopwatch()
        decoded = self.decoder.value(tick, self._position)
        if self.rotation is not None:
            self.rotation.decode(tick)
        self._codec_time += self._stopwatch() - began
        self._decoded = decoded if decoded is not None else ZERO
        limited = self._limiter.limit(self.control.render(self._decoded))
        is_open = self._gate.gain > 0.0
        slewed = self._slew.limit(limited, step) if is_open else self._slew.place(limited)
        out_of_touch = now - liveness.in_touch_at
        self._output = self._gate.pass_through(slewed, engaged=self._is_engaged, age=out_of_touch, elapsed=step)
        self.control.displayed(self._output)
        self.device.command(self._output, now)
        held_back = self._slew.limited
        if self.rotation is not None:
            held_back |= self.rotation.render(self._gate, now, step if is_open else None)
        self._slew_ticks += held_back
