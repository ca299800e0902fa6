"""The operator's end of the link: the hand's motion is sensed, received forces and torques are displayed."""

from collections.abc import Callable, Sequence
from math import hypot, inf
from typing import ClassVar

from weberlink.control.contract import LEAST_CONTACT, MasterControl
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.master.devices.contract import Device, DeviceFault, DeviceReading
from weberlink.master.operator_end import OperatorEnd
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row

GRIP_S = 0.1
"""Time with full force after which a grip is settled [s]: the hand has come to rest, and the stiffness of a contact is
known, which takes some samples of its force."""


class HandPosition:
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force.

    Args:
        control: the operator's end of the control scheme.
        force_bound: deadband of a force of this size [N].
    """

    def __init__(self, control: MasterControl, force_bound: Callable[[float], float]) -> None:
        self.value: Vector = ZERO
        self.command: Vector = ZERO
        """What was sampled last [m]."""
        self.displayed: Vector = ZERO
        """Force on the hand now [N], drag included."""
        self.touched: Vector = ZERO
        """Force of the contact as decoded [N]: in free motion, drag alone does not narrow the deadband."""
        self._control = control
        self._force_bound = force_bound

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
        touches = force > LEAST_CONTACT and hypot(touched[0], touched[1], touched[2]) > LEAST_CONTACT
        most = self._force_bound(force) / control.stiffness if touches else inf
        return command, ZERO, most


class Display:
    """Limits a received force [N] or torque [N m] and displays it.

    Args:
        limiter: bounds the magnitude.
        slew: bounds the rate of change.
        write: commands the device; None where it cannot display this, and nothing is felt.
        control: renders the force that the decoder gives; None to display it as it is.

    Attributes:
        decoded: before all limits.
        output: as commanded.
    """

    def __init__(
        self,
        limiter: ForceLimiter,
        slew: SlewLimiter,
        write: Callable[[Vector, float], None] | None,
        control: MasterControl | None = None,
    ) -> None:
        self.limiter, self.slew, self._write, self._control = limiter, slew, write, control
        self.decoded: Vector = ZERO
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
        limited = self.limiter.limit(decoded if control is None else control.render(decoded))
        slewed = slew.place(limited) if step is None else slew.limit(limited, step)
        self.output = output = slewed if gain == 1.0 else (slewed[0] * gain, slewed[1] * gain, slewed[2] * gain)
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
    """A haptic device; a `weberlink.control.port.Port`.

    Args:
        device: not yet open.
        displays: one per incoming channel, the force first.
        control: the operator's end of the control scheme.
        endpoint: measures the link.
        hand: the sensor of the position channel.
        gate: fades all displays in and out.
        button: only while it is held, the robot follows and force is displayed; None for always.
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
    ) -> None:
        super().__init__(device, gate, button)
        self.device, self.displays, self.control = device, displays, control
        self.hand = hand
        self._endpoint = endpoint
        self._settles_for = 0.0  # full force for so long until the grip counts as settled [s]

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        endpoint, control = self._endpoint, self.control
        control.observe(self.hand.value, elapsed, tick, endpoint.peer_credit, endpoint)
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
        if not self.enabled:
            self._settles_for = GRIP_S
        if self._settles_for > 0.0:
            self._grip(values[0] or ZERO, gain)
            if gain == 1.0:
                self._settles_for -= step
        held_back = clipped = False
        for display, value in zip(self.displays, values):  # noqa: B905 - strict costs as much as the loop
            held_back |= display.show(value or ZERO, gain, slew_step, now)
            clipped |= display.limiter.clipped
        self.hand.displayed, self.hand.touched = self.displays[0].output, self.displays[0].decoded
        self.slew_ticks += held_back
        self.clipped = clipped

    def _grip(self, force: Vector, gain: float) -> None:
        """Tell the control what the contact stores in which the operator takes or leaves the handle."""
        strength = min(hypot(force[0], force[1], force[2]), self.displays[0].limiter.most)
        self.control.grip(0.5 * strength * strength / self.control.stiffness, gain)

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
