"""The operator's end of the link: the hand's motion is sensed, received forces and torques are displayed."""

from collections.abc import Callable, Sequence
from itertools import zip_longest
from math import hypot, inf
from typing import Any, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.control.ends import AxesMaster, Control, MasterControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import Device, DeviceFault, DeviceReading
from weberlink.master.gate import HandContact, OutputGate
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row


class HandPosition:
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force, `force_bound` of its size [N]. No more
    than `free` [N] needs no contact.
    """

    def __init__(self, control: MasterControl, force_bound: Callable[[float], float], free: float = FREE_FORCE) -> None:
        self.value: Vector = ZERO
        self.command: Vector = ZERO
        """What was sampled last [m]."""
        self.displayed: Joints = ZERO
        """Force on the hand now [N], drag included."""
        self.touched: Joints = ZERO
        """Force of the contact as decoded [N]: in free motion, drag alone does not narrow the deadband."""
        self.asked = 0.0
        """Size of what the control scheme asks for [N]: no drag is larger than `free`, and a model that is felt before
        the robot touches must lead it there."""
        self._control = control
        self._force_bound = force_bound
        self._free = free

    def complaint(self, reading: DeviceReading) -> str | None:
        x, y, z = reading.position
        return None if x - x == y - y == z - z == 0.0 else f"reports the position {reading.position}"

    def take(self, reading: DeviceReading) -> None:
        self.value = reading.position

    def sample(self) -> tuple[Vector, Vector, float]:
        control = self._control
        self.command = command = control.command(self.value)
        force = hypot(*self.displayed)
        touches = force > LEAST_CONTACT and (self.asked > self._free or hypot(*self.touched) > LEAST_CONTACT)
        most = self._force_bound(force) / control.stiffness if touches else inf
        return command, ZERO, most


class Display:
    """What is felt of some channels: a force, a torque, or the torques of an arm.

    Of each channel it knows the number of axes; the first has the number `first`, here and in the gate. `write`
    commands the device; None where it cannot display this, and nothing is felt. `decoded` is before all limits, with
    nothing where nothing finite was decoded; `output` as commanded.
    """

    def __init__(
        self,
        control: MasterControl | AxesMaster,
        channels: Sequence[int],
        write: Callable[[Any, float], None] | None,
        first: int = 0,
    ) -> None:
        self._control: Any = control
        self._first, self._write = first, write
        self._nothing: list[Joints] = [(0.0,) * axes for axes in channels]
        self._none: Joints = (0.0,) * sum(channels)
        self.decoded = self.output = self._none

    def show(self, values: Sequence[Joints | None], gate: OutputGate, now: float, step: float) -> None:
        """Display what was decoded of all channels, as far as the gate lets it pass."""
        first, decoded = self._first, self._none
        if len(self._nothing) == 1:
            value = values[first]
            if value is not None and hypot(*value) < inf:
                decoded = value
            output = gate.passed(first, self._control.render(decoded), decoded, step)
        else:
            decoded, output = self._passed(values, gate, step)
        self.decoded, self.output = decoded, output
        self._control.displayed(output)
        if self._write is not None:
            self._write(output, now)

    def _passed(self, values: Sequence[Joints | None], gate: OutputGate, step: float) -> tuple[Joints, Joints]:
        """What was decoded of several channels, and what leaves of them."""
        decoded: Joints = ()
        for nothing, value in zip_longest(self._nothing, values):
            decoded += nothing if value is None or not hypot(*value) < inf else value
        wanted: Joints = self._control.render(decoded)
        output: Joints = ()
        axis = 0
        for index, nothing in enumerate(self._nothing):
            last = axis + len(nothing)
            output += gate.passed(index, wanted[axis:last], decoded[axis:last], step)
            axis = last
        return decoded, output

    def halt(self, now: float) -> None:
        """Display nothing, at once."""
        if self._write is not None:
            self._write(self._none, now)


@mypyc_attr(allow_interpreted_subclasses=True)
class OperatorPort(Port):
    """The operator's end; a subclass says what is sensed, booked and recorded.

    The first of the `controls` is told what lasts without a contact. Only while `button` is held, the robot follows and
    force is displayed; None for always. `slew_ticks` counts those in which a slew limit held something back.
    """

    kind: ClassVar[str] = "device"
    leads: ClassVar[bool] = True
    fault: ClassVar[type[Exception]] = DeviceFault

    def __init__(
        self,
        source: Any,
        *,
        displays: Sequence[Display],
        controls: Sequence[Control],
        endpoint: Endpoint,
        gate: OutputGate,
        button: int | None = None,
    ) -> None:
        super().__init__(source, controls)
        self.displays, self.gate = displays, gate
        self.enabled = button is None
        self.buttons = self.slew_ticks = 0
        self._endpoint = endpoint
        self._button = button
        self._contacts = [bound.contact for bound in gate.bounds if bound.contact is not None]

    @property
    def at_rest(self) -> bool:
        return self.gate.gain == 0.0

    def latest(self, now: float) -> Any:
        reading = self._source.latest(now)
        self.ended = reading.ended
        return reading

    def accept(self, reading: Any) -> bool:
        self.buttons = buttons = reading.buttons
        if self._button is not None:
            self.enabled = bool(buttons >> self._button & 1)
        return False

    def reset(self) -> None:
        self.restart()

    def restart(self) -> None:
        self.gate.close()
        self.unfounded = False

    def actuate(
        self,
        values: Sequence[Any],
        now: float,
        elapsed: float,  # noqa: ARG002
        step: float,
        *,
        engaged: bool,
    ) -> None:
        gate = self.gate
        gate.fade(engaged=engaged, age=now - self._endpoint.liveness.in_touch_at, step=step)
        for display in self.displays:
            display.show(values, gate, now, step)
        self.slew_ticks += gate.held_back
        unfounded = False
        for contact in self._contacts:
            unfounded = unfounded or contact.limiter.unfounded
        if unfounded and not self.unfounded:  # at fault, the scheme begins anew
            self.controls[0].resume(self._endpoint.credit.known)
        self.unfounded = unfounded

    def report(self, row: Row, *, is_led: bool) -> None:  # noqa: ARG002 - this end leads
        row.slew_ticks, row.clipped = self.slew_ticks, self.gate.clipped
        row.ramping = self.gate.ramping if self.enabled else RELEASED
        row.buttons = self.buttons & 0xFF

    def halt(self, now: float) -> None:
        for display in self.displays:
            display.halt(now)


class HandPort(OperatorPort):
    """A haptic device. `hand` is the sensor of the position channel; `turning` the control of torques, and what gives
    the rotation of the handle so far [rad].
    """

    def __init__(
        self,
        device: Device,
        *,
        displays: Sequence[Display],
        control: MasterControl,
        endpoint: Endpoint,
        hand: HandPosition,
        gate: OutputGate,
        button: int | None = None,
        turning: tuple[AxesMaster, Callable[[], Vector]] | None = None,
    ) -> None:
        controls: list[Control] = [control] if turning is None else [control, turning[0]]
        super().__init__(device, displays=displays, controls=controls, endpoint=endpoint, gate=gate, button=button)
        self.hand, self._control, self._turning = hand, control, turning
        contact = gate.bounds[0].contact
        self._contact = contact if isinstance(contact, HandContact) else None
        self._was_doubtful = False
        self._tick = 0.0

    def restart(self) -> None:
        super().restart()
        self._was_doubtful = False

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        endpoint, control = self._endpoint, self._control
        self._tick = tick
        control.observe(self.hand.value, elapsed, tick, endpoint.credit.known, endpoint.clock.rtt)
        if self._turning is not None:
            turning, turned = self._turning
            turning.observe(turned(), elapsed)
        return control.credit

    def actuate(self, values: Sequence[Any], now: float, elapsed: float, step: float, *, engaged: bool) -> None:
        contact = self._contact
        if contact is not None:
            contact.note_command(self.hand.command, self._tick, self.gate.bounds[0].asked, now)
        super().actuate(values, now, elapsed, step, engaged=engaged)
        hand, force = self.hand, self.displays[0]
        hand.displayed, hand.touched, hand.asked = force.output, force.decoded, self.gate.bounds[0].asked
        if contact is not None:
            # The scheme lets go of a model whose force lasts without a contact. The robot's end is silent while the
            # model of its newest update is right, which is lost by this: so it is asked for a complete one.
            if contact.limiter.doubtful and not self._was_doubtful:
                self._control.refute()
                self._endpoint.request_full_state()
            self._was_doubtful = contact.limiter.doubtful

    def report(self, row: Row, *, is_led: bool) -> None:
        super().report(row, is_led=is_led)
        force: Any = self.displays[0]
        row.position, row.raw = self.hand.value, self.hand.command
        row.decoded, row.output = force.decoded, force.output
        if len(self.displays) > 1:
            torque: Any = self.displays[1]
            row.rotation_decoded, row.rotation_output = torque.decoded, torque.output
