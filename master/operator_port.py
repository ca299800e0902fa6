"""The operator's end of the link: the hand's motion is sensed, received forces and torques are displayed."""

from collections.abc import Callable, Sequence
from math import hypot, inf
from typing import Any, ClassVar

from weberlink.codec.decoder import Decoder
from weberlink.codec.sample import Sample
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT, UNREACHED_S
from weberlink.control.ends import AxesMaster, Control, MasterControl
from weberlink.control.sent import SentCommands
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.master.devices.contract import Device, DeviceFault, DeviceReading
from weberlink.master.operator_end import OperatorEnd
from weberlink.master.safety import ContactLimiter, ForceGate, ForceLimiter, SlewLimiter
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row

LOOK_S = 0.005
"""A force lasts for so long until the received model is asked for a contact, and a correction of the model is waited
for so much longer than the round trip and its jitter [s]."""


class HandPosition:
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force.

    Args:
        control: the operator's end of the control scheme.
        force_bound: deadband of a force of this size [N].
        free: largest force that needs no contact [N].
    """

    def __init__(self, control: MasterControl, force_bound: Callable[[float], float], free: float = FREE_FORCE) -> None:
        self.value: Vector = ZERO
        self.command: Vector = ZERO
        """What was sampled last [m]."""
        self.displayed: Vector = ZERO
        """Force on the hand now [N], drag included."""
        self.touched: Vector = ZERO
        """Force of the contact as decoded [N]: in free motion, drag alone does not narrow the deadband."""
        self.asked = 0.0
        """Size of what the control scheme asks for [N]: no drag is larger than `free`, and a model that is felt before
        the robot touches must lead it there."""
        self._control = control
        self._force_bound = force_bound
        self._free = free

    def complaint(self, reading: DeviceReading) -> str | None:
        position = reading.position
        return None if is_finite(position) else f"reports the position {position}"

    def take(self, reading: DeviceReading) -> None:
        self.value = reading.position

    def sample(self) -> tuple[Vector, Vector, float]:
        control = self._control
        self.command = command = control.command(self.value)
        shown, touched = self.displayed, self.touched
        force = hypot(shown[0], shown[1], shown[2])
        touches = force > LEAST_CONTACT and (
            self.asked > self._free or hypot(touched[0], touched[1], touched[2]) > LEAST_CONTACT
        )
        most = self._force_bound(force) / control.stiffness if touches else inf
        return command, ZERO, most


class ContactWatch:
    """Bounds the force on the hand by whether the robot's end states a contact.

    It states one by an update whose sample has a force; and while it is silent, by the received model, at the place
    that its silence is about: where the robot was commanded to a round trip ago, since by now a correction of the model
    for that place would have come. A robot that is elsewhere says so (`weberlink.session.channels.Unreached`).

    Args:
        limiter: takes the time.
        decoder: of the force.
        endpoint: measures the link.
        least: smallest force that states a contact [N]: less may be left over within the deadband.
        sent: the commands so far.
        delay: what look-ahead and play-out add to the round trip [s].
        playout: how much later than received an update is used [ticks].
    """

    def __init__(
        self,
        limiter: ContactLimiter,
        decoder: Decoder,
        endpoint: Endpoint,
        *,
        least: float,
        sent: SentCommands,
        delay: float,
        playout: int,
    ) -> None:
        self.limiter, self._decoder, self._endpoint = limiter, decoder, endpoint
        self._least = least
        self._sent = sent
        self._delay = delay
        self._playout = playout
        self._tick = self._claimed = 0.0
        self._newest_sample: Sample | None = None
        self._is_new = False

    def reset(self) -> None:
        self.limiter.reset()
        self._sent.reset()
        self._claimed = 0.0

    def follow(self, command: Vector, tick: float) -> None:
        """Take in the command of this tick [m], and the present tick of the other side."""
        self._sent.add(command)
        self._tick = tick
        newest = self._decoder.newest
        self._is_new, self._newest_sample = newest is not self._newest_sample, newest

    def bounded(self, output: Vector, asked: float, elapsed: float) -> Vector:
        """What may be displayed of a force that needs a contact, or after one that had none.

        Args:
            output: that is to be displayed [N].
            asked: its size before slew limit and gate [N].
            elapsed: time since the last call [s].
        """
        rtt = self._endpoint.clock.rtt
        round_trip = None if rtt is None else rtt + self._delay
        stated, claimed = self._heard(elapsed, round_trip)
        most = self.limiter.bound(asked, elapsed, round_trip, stated=stated, claimed=claimed)
        length = hypot(output[0], output[1], output[2])
        if length <= most:
            return output
        share = most / length
        return (share * output[0], share * output[1], share * output[2])

    def _heard(self, elapsed: float, round_trip: float | None) -> tuple[float, float]:
        """How long ago the robot's end stated a contact at the latest, and for how long a model claims one [s]."""
        newest = self._newest_sample
        if self._is_new and newest is not None and hypot(*newest.value) > self._least:
            self._claimed = UNREACHED_S
            return 0.0, 0.0
        if self.limiter.lasted < LOOK_S:
            return inf, 0.0
        self._claimed = self._claimed + elapsed if self._models(round_trip) else 0.0
        if self._claimed < UNREACHED_S + LOOK_S:
            return inf, self._claimed
        return UNREACHED_S, 0.0

    def _models(self, round_trip: float | None) -> bool:
        """Whether the received model states a contact where the robot was as the newest news of it left."""
        waited = 0.0 if round_trip is None else round_trip + self._endpoint.clock.jitter + LOOK_S
        x, y, z = self._decoder.stated(self._tick - self._playout, self._sent.ago(waited))
        return hypot(x, y, z) > self._least


class Display:
    """Limits a received force [N] or torque [N m] and displays it.

    Args:
        limiter: bounds the magnitude.
        slew: bounds the rate of change.
        write: commands the device; None where it cannot display this, and nothing is felt.
        control: renders the force or torque that the decoder gives; None to display it as it is.
        contact: ends what no contact founds; None for what is displayed as it is decoded.

    Attributes:
        decoded: before all limits.
        asked: size of what is to be displayed, before the slew limit.
        output: as commanded.
    """

    def __init__(
        self,
        limiter: ForceLimiter,
        slew: SlewLimiter,
        write: Callable[[Vector, float], None] | None,
        control: MasterControl | AxesMaster | None = None,
        contact: ContactWatch | None = None,
    ) -> None:
        self.limiter, self.slew, self._write, self._control, self.contact = limiter, slew, write, control, contact
        self.decoded: Vector = ZERO
        self.asked = 0.0
        self.output: Vector = ZERO

    def show(self, decoded: Vector, gain: float, step: float | None, now: float) -> bool:
        """Display a value.

        Args:
            decoded: the value.
            gain: the share of it that the gate lets through, 0..1.
            step: time that the slew limit may go on [s]; None where the gate was closed before this tick.
            now: [s].

        Returns:
            Whether the slew limit held it back.
        """
        self.decoded = decoded
        control, slew = self._control, self.slew
        wanted: Any = decoded if control is None else control.render(decoded)  # three values, of a force or a torque
        limited = self.limiter.limit(wanted)
        self.asked = asked = hypot(limited[0], limited[1], limited[2])
        slewed = slew.place(limited) if step is None else slew.limit(limited, step)
        output = slewed if gain == 1.0 else (slewed[0] * gain, slewed[1] * gain, slewed[2] * gain)
        contact = self.contact
        if contact is not None and step is not None and not (contact.limiter.quiet and asked <= contact.limiter.free):
            output = contact.bounded(output, asked, step)
        self.output = output
        if control is not None:
            control.displayed(output)
        if self._write is not None:
            self._write(output, now)
        return slew.limited

    def halt(self, now: float) -> None:
        """Display nothing, at once."""
        if self._write is not None:
            self._write(ZERO, now)


class OperatorPort(OperatorEnd):
    """A haptic device; a `weberlink.session.port.Port`.

    Args:
        device: not yet open.
        displays: one per incoming channel, the force first.
        control: the operator's end of the control scheme.
        endpoint: measures the link.
        hand: the sensor of the position channel.
        gate: fades all displays in and out.
        button: only while it is held, the robot follows and force is displayed; None for always.
        turning: the operator's end for torques, and what gives the rotation of the handle so far [rad]; None without
            torques.
    """

    fault: ClassVar[type[DeviceFault]] = DeviceFault

    def __init__(
        self,
        *,
        device: Device,
        displays: Sequence[Display],
        control: MasterControl,
        endpoint: Endpoint,
        hand: HandPosition,
        gate: ForceGate,
        button: int | None = None,
        turning: tuple[AxesMaster, Callable[[], Vector]] | None = None,
    ) -> None:
        super().__init__(device, gate, button)
        self.device, self.displays, self._control, self._turning = device, displays, control, turning
        self.controls: Sequence[Control] = [control] if turning is None else [control, turning[0]]
        self.hand = hand
        self._endpoint = endpoint
        self._was_doubtful = False
        self._contact = displays[0].contact
        self._tick = 0.0

    def _forget(self) -> None:
        super()._forget()
        if self._contact is not None:
            self._contact.reset()
        self._was_doubtful = False

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        endpoint, control = self._endpoint, self._control
        self._tick = tick
        control.observe(self.hand.value, elapsed, tick, endpoint.credit.known, endpoint.clock.rtt)
        if self._turning is not None:
            turning, turned = self._turning
            turning.observe(turned(), elapsed)
        return control.credit

    def actuate(
        self,
        values: Sequence[Vector | None],
        now: float,
        elapsed: float,  # noqa: ARG002
        step: float,
        *,
        engaged: bool,
    ) -> None:
        gate = self.gate
        slew_step = step if gate.gain > 0.0 else None
        gain = gate.update(engaged=engaged, age=now - self._endpoint.liveness.in_touch_at, elapsed=step)
        contact = self._contact
        if contact is not None:
            contact.follow(self.hand.command, self._tick)
        held_back = clipped = False
        for display, value in zip(self.displays, values):  # noqa: B905 - strict costs as much as the loop
            held_back |= display.show(value or ZERO, gain, slew_step, now)
            clipped |= display.limiter.clipped
        hand, force = self.hand, self.displays[0]
        hand.displayed, hand.touched, hand.asked = force.output, force.decoded, force.asked
        self.slew_ticks += held_back
        self.clipped = clipped
        if contact is not None and (contact.limiter.doubtful or self._was_doubtful):
            self._doubt(contact.limiter)

    def _doubt(self, limiter: ContactLimiter) -> None:
        """Have the scheme let go of a model whose force lasts without a contact; at fault, have it begin anew.

        The robot's end is silent while the model of its newest update is right, which the scheme has lost by this. So
        it is asked for a complete update.
        """
        if limiter.doubtful and not self._was_doubtful:
            self._control.refute()
            self._endpoint.request_full_state()
        if limiter.unfounded and not self.unfounded:
            self._control.resume(self._endpoint.credit.known)
        self._was_doubtful, self.unfounded = limiter.doubtful, limiter.unfounded

    def report(self, row: Row, *, is_led: bool) -> None:  # noqa: ARG002 - this end leads
        force = self.displays[0]
        row.position, row.raw = self.hand.value, self.hand.command
        row.decoded, row.output = force.decoded, force.output
        row.slew_ticks, row.clipped = self.slew_ticks, self.clipped
        row.ramping = self.gate.ramping if self.enabled else RELEASED
        row.buttons = self.buttons & 0xFF
        if len(self.displays) > 1:
            torque = self.displays[1]
            row.rotation_decoded, row.rotation_output = torque.decoded, torque.output

    def halt(self, now: float) -> None:
        for display in self.displays:
            display.halt(now)
