"""The operator's end of the link: the hand's motion is sensed, received forces and torques are displayed."""

from collections.abc import Callable, Sequence
from math import hypot, inf
from typing import Any, ClassVar

from weberlink.codec import Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT, AxesMaster, MasterControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.gate import OutputGate
from weberlink.protocol.endpoint import Endpoint
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row


class HandPosition(OutgoingChannel):
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force: `weber` of it, or `floor` [N]. No more
    than `free` [N] needs no contact.
    """

    def __init__(
        self, encoder: Encoder, control: MasterControl, weber: float, floor: float, free: float = FREE_FORCE
    ) -> None:
        super().__init__(encoder, ZERO)
        self.way: Vector = ZERO
        self.control = control
        self.weber, self._floor, self._free = weber, floor, free
        self.felt: Any = None  # the `Display` of the force

    def complaint(self, reading: DeviceReading) -> str | None:
        x, y, z = reading.position
        return None if x - x == y - y == z - z == 0.0 else f"reports the position {reading.position}"

    def take(self, reading: DeviceReading) -> None:
        self.value = self.way = reading.position

    def sample(self, tick: int) -> tuple[Vector, float]:  # noqa: ARG002
        control, felt = self.control, self.felt
        self.sampled = control.command(self.value)
        force = hypot(*felt.output)
        # No drag is larger than `free`, and in free motion it alone does not narrow the deadband; but a model that is
        # felt before the robot touches must lead it there.
        if force > LEAST_CONTACT and (felt.asked > self._free or hypot(*felt.decoded) > LEAST_CONTACT):
            return ZERO, max(self.weber * force, self._floor) / control.stiffness
        return ZERO, inf


class Display:
    """What is felt of some channels: a force, a torque, or the torques of an arm.

    `sensors` sense its axes, channel by channel: it does work over their `way` [m, or rad]. The first channel has the
    number `first`, here and in the gate. `write` commands the device; None where it cannot display this, and nothing is
    felt. `decoded` is before all limits, with nothing where nothing finite was decoded; `output` as commanded; `asked`
    the size of what the scheme asks for, of the first channel.
    """

    def __init__(
        self,
        control: MasterControl | AxesMaster,
        sensors: Sequence[Any],
        write: Callable[[Any, float], None] | None,
        first: int = 0,
    ) -> None:
        self.control: Any = control
        self.sensors, self._first, self._write = sensors, first, write
        self._nothing: list[Joints] = [(0.0,) * len(sensor.value) for sensor in sensors]
        self._none: Joints = (0.0,) * sum(map(len, self._nothing))
        self.decoded = self.output = self._none
        self.asked = 0.0

    def show(self, values: Sequence[Joints | None], gate: OutputGate, now: float, step: float) -> None:
        """Display what was decoded of all channels, as far as the gate lets it pass."""
        first, axis = self._first, 0
        decoded: Joints = ()
        output: Joints = ()
        for index, nothing in enumerate(self._nothing, first):
            value = values[index]
            decoded += nothing if value is None or not hypot(*value) < inf else value
        wanted: Joints = self.control.render(decoded)
        if len(self._nothing) == 1:
            output = gate.passed(first, wanted, decoded, step)
        else:
            for index, nothing in enumerate(self._nothing, first):
                last = axis + len(nothing)
                output += gate.passed(index, wanted[axis:last], decoded[axis:last], step)
                axis = last
        self.decoded, self.output, self.asked = decoded, output, gate.bounds[first].asked
        self.control.displayed(output)
        if self._write is not None:
            self._write(output, now)

    def halt(self, now: float) -> None:
        """Display nothing, at once."""
        if self._write is not None:
            self._write(self._none, now)


class OperatorPort(Port):
    """The operator's end: a haptic device, or an arm in the frame of its follower.

    The first of the `displays` gives energy, and its control is told what lasts without a contact. Only while `button`
    is held, the robot follows and force is displayed; None for always. `slew_ticks` counts those in which a slew limit
    held something back.
    """

    kind: ClassVar[str] = "device"
    leads: ClassVar[bool] = True

    def __init__(
        self,
        source: Any,
        *,
        displays: Sequence[Display],
        endpoint: Endpoint,
        gate: OutputGate,
        button: int | None = None,
        fault: type[Exception] = DeviceFault,
    ) -> None:
        super().__init__(source, [display.control for display in displays], fault)
        self.displays, self.gate = displays, gate
        self.enabled = button is None
        self.buttons = self.slew_ticks = 0
        self._endpoint = endpoint
        self._button = button
        self._contacts = [bound.contact for bound in gate.bounds if bound.contact is not None]
        self._tick = 0.0

    @property
    def at_rest(self) -> bool:
        return self.gate.gain == 0.0

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

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - energy is booked in every tick
        self._tick, credit, rtt = tick, self._endpoint.credit.known, self._endpoint.clock.rtt
        for display in self.displays:
            way: Joints = ()
            for sensor in display.sensors:
                way += sensor.way
            display.control.observe(way, elapsed, tick, credit, rtt)
        return self.controls[0].credit

    def actuate(
        self,
        values: Sequence[Any],
        now: float,
        elapsed: float,  # noqa: ARG002
        step: float,
        *,
        engaged: bool,
    ) -> None:
        gate, contacts = self.gate, self._contacts
        for contact in contacts:
            contact.begin(self._tick, now)
        gate.fade(engaged=engaged, age=now - self._endpoint.liveness.in_touch_at, step=step)
        for display in self.displays:
            display.show(values, gate, now, step)
        self.slew_ticks += gate.held_back
        unfounded = False
        for contact in contacts:
            unfounded = contact.end() or unfounded
        if unfounded and not self.unfounded:  # at fault, the scheme begins anew
            self.controls[0].resume(self._endpoint.credit.known)
        self.unfounded = unfounded

    def report(self, row: Row, *, is_led: bool) -> None:  # noqa: ARG002 - this end leads
        row.slew_ticks, row.clipped = self.slew_ticks, self.gate.clipped
        row.ramping = self.gate.ramping if self.enabled else RELEASED
        row.buttons = self.buttons & 0xFF
        decoded: Joints = ()
        output: Joints = ()
        for display in self.displays:
            decoded += display.decoded
            output += display.output
        row.decoded, row.output = decoded, output

    def halt(self, now: float) -> None:
        for display in self.displays:
            display.halt(now)
