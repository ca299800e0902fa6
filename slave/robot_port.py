"""The teleoperator's end of the link: the robot follows the operator, and what it feels is sensed."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from operator import attrgetter
from typing import Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.codec.predictors.contract import Hold
from weberlink.control.contract import UNREACHED_S, Control, SlaveControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.protocol.endpoint import Endpoint
from weberlink.slave.guard import Guard
from weberlink.slave.robots.contract import RobotFault, RobotReading
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row


class Unreached:
    """Notices a contact that the operator feels by a model, and that the robot does not reach.

    The encoder compares what the robot feels with the model where the robot is, and the operator's end evaluates the
    same model where the hand is. Both agree as long as the robot follows. One that is held back (by a trip or its
    workspace) is where the model states nothing, so that a force would last on the hand which nothing touches. From
    then on what the robot feels is coded for the place to which the `port` is led in this `channel` [m]: that takes the
    model back. Less than the `least` force [N] states no contact, but may be left over within the deadband.
    """

    def __init__(self, mirror: Decoder, port: Any, channel: int, least: float, tick_period: float) -> None:
        self._mirror = mirror
        self._port, self._channel = port, channel
        self._least, self._least_squared = least, least * least
        self._most = round(UNREACHED_S / tick_period)
        self._ticks = 0

    def place(self, tick: int, value: Joints, position: Vector) -> Vector:
        """The position [m] for which a sample is coded: a force, as it is shown [N], where it is felt [m]."""
        x, y, z = value
        may_be_felt = type(self._mirror.model) is not Hold and x * x + y * y + z * z <= self._least_squared
        led = self._port.led(self._channel) if may_be_felt else None
        if led is None or led == position or norm(self._mirror.stated(tick, led)) <= self._least:
            self._ticks = 0
            return position
        self._ticks += 1
        return position if self._ticks <= self._most and self._port.follows else led


class ContactForce(OutgoingChannel):
    """The force of the environment on the robot [N], as far as it may be `shown`, and the command that belongs to it.

    A robot of stiffness k that rests at x under a force F is commanded to x - F / k. A moving one lags behind its
    command, but this point lies on the same static line at any speed. So predictors fit one line to all samples.
    """

    def __init__(self, encoder: Encoder, stiffness: float) -> None:
        super().__init__(encoder, ZERO)
        self.rest: Vector = ZERO  # The command at which the robot would rest with this force where it is [m]
        self.shown: Callable[[Joints], Joints] | None = None
        self.unreached: Unreached | None = None
        self.place = attrgetter("position", "force")
        self._compliance = 1.0 / stiffness

    def complaint(self, reading: RobotReading) -> str | None:
        (x, y, z), (u, v, w) = reading.position, reading.force
        if not x - x == y - y == z - z == 0.0:
            return f"reports the position {reading.position}"
        return None if u - u == v - v == w - w == 0.0 else f"reports the force {reading.force}"

    def take(self, reading: RobotReading) -> None:
        self.value = reading.force
        (x, y, z), (u, v, w), compliance = reading.position, reading.force, self._compliance
        self.rest = (x - compliance * u, y - compliance * v, z - compliance * w)

    def sample(self, tick: int) -> tuple[Vector, float]:
        self.sampled = shown = self.value if self.shown is None else self.shown(self.value)
        return self.rest if self.unreached is None else self.unreached.place(tick, shown, self.rest), inf

    def held(self, reading: RobotReading, guard: Guard) -> Joints:  # noqa: ARG002
        self.take(reading)
        return self.rest


class RobotPort(Port):
    """The robot's end: the tip of a robot that a hand leads, or the axes of an arm that another arm leads.

    `sensors` are those of what is felt, part by part; the first also knows which readings cannot be used, gives where
    the robot is and what it feels (`place`), and the command that holds it there (`held`). The `tool` turns with the
    hand, as the second incoming channel says (`weberlink.slave.rotation.ToolOrientation`); None without six degrees of
    freedom. `control`: of the scheme; None where an arm is led. `by_button`: the operator leads only while holding a
    button. `applied` is the last command, `commanded` the decoded one that was last followed; `where` the robot is and
    what is `felt` of the environment are as measured.
    """

    def __init__(
        self,
        robot: Any,
        *,
        guard: Guard,
        sensors: Sequence[Any],
        endpoint: Endpoint,
        control: SlaveControl | None = None,
        tool: Any = None,
        by_button: bool = False,
        fault: type[Exception] = RobotFault,
    ) -> None:
        super().__init__(robot, (control or Control(),), fault)
        self.guard, self._command, self._by_button = guard, robot.command, by_button
        self.applied = self.where = self.felt = self.commanded = guard.held
        self.is_overloaded = False
        self.tool = tool
        self._point: Any = None if tool is None else robot.point
        self._stay: Any = getattr(robot, "stay", None)
        self._control, self._endpoint = control, endpoint
        self._led: Sequence[Any] = ()
        self._sensor = sensors[0]
        for sensor in sensors:
            sensor.shown = self.shown

    @property
    def tripped(self) -> bool:
        return self.guard.tripped

    @property
    def follows(self) -> bool:
        """Whether no contact that was too strong keeps the robot from following."""
        return not (self.is_overloaded or self.tripped)

    def open(self, now: float) -> None:
        super().open(now)
        reading = self.latest(now)
        problem = self._sensor.complaint(reading)
        if problem is not None:
            self.close()
            raise self.fault(f"{self.name} {problem}")
        self.where, self.felt = self._sensor.place(reading)
        self.applied = self.where
        self.guard.place(self.where)

    def accept(self, reading: Any) -> bool:
        self.where, self.felt = self._sensor.place(reading)
        self.is_overloaded = self.guard.is_overloaded(self.felt)
        if not self.is_overloaded or self.guard.tripped:
            return False
        self.guard.trip(self.felt, self.where)
        return True

    def settle(self, now: float) -> None:
        """Hold the robot where it is now: in contact, with the force that it presses with."""
        with suppress(self.fault):  # the side meets it in this very tick, as it does a reading that is not finite
            reading = self.latest(now)
            if self._sensor.complaint(reading) is None:
                self.where, self.felt = self._sensor.place(reading)
                self.guard.place(self._sensor.held(reading, self.guard))
        if self.tool is not None:
            self.tool.reset()

    def reset(self) -> None:
        self.guard.reset()
        if self.tool is not None:
            self.tool.reset()

    def release(self, *, retreat: bool) -> None:
        if retreat:
            self.guard.retreat(self.felt, self.where)
        else:
            self.guard.release()
        if self.tool is not None:
            self.tool.release()

    def shown(self, felt: Joints) -> Joints:
        """What may be shown of a force or torques: all, once the robot is where the operator is in every channel."""
        share = self.guard.share if self.tool is None else self.guard.share * self.tool.share
        return felt if share == 1.0 else tuple([value * share for value in felt])

    def led(self, channel: int) -> Vector | None:
        """Where the operator leads a hand's robot in a channel, whether it follows or not; None for nowhere."""
        led: Vector | None = self._led[channel] if self._led else None
        return led

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002
        control = self._control
        if control is None:
            return 0
        if encodes:
            applied: Any = self.applied
            control.observe(applied, self._sensor.value)
        return control.credit

    def _wanted(self, values: Sequence[Any], elapsed: float) -> Joints | None:
        """What the operator commands; None for nothing, of any part."""
        commanded: Joints | None = values[0]
        if commanded is None:
            return None
        control = self._control
        if control is not None:
            self.commanded = commanded
            endpoint = self._endpoint
            goal: Any = commanded
            applied: Any = self.applied
            return control.follow(goal, applied, elapsed, endpoint.credit.known, endpoint.clock.rtt)
        for value in values[1:]:
            if value is None:
                return None
            commanded += value
        return commanded

    def actuate(self, values: Sequence[Any], now: float, elapsed: float, step: float, *, engaged: bool) -> None:
        self._led = values if engaged else ()
        wanted = self._wanted(values, elapsed) if engaged and not self.is_overloaded else None
        if wanted is None:
            self.applied = self.guard.hold(step)
        else:
            self.applied = self.guard.follow(wanted, self.where, self.felt, step)
        self._command(self.applied, now)
        if self.tool is not None:
            self.tool.touches = self.guard.touches
            self._point(self.tool.move(values[1] if engaged and self.follows else None, step), now)

    def report(self, row: Row, *, is_led: bool) -> None:
        guard, tool = self.guard, self.tool
        clipped, ramping = guard.clipped, guard.share < 1.0
        row.position, row.output = self.where if self._control is None else self.commanded, self.applied
        if tool is not None:
            clipped, ramping = clipped or tool.clipped, ramping or tool.share < 1.0
            row.position += tool.commanded
            row.output += tool.applied
        row.contact_ticks, row.clipped = guard.contact_ticks, clipped
        row.ramping = ramping if is_led or not self._by_button else RELEASED

    def halt(self, now: float) -> None:
        self._command(self.applied, now)
        if self.tool is not None:
            self._point(self.tool.hold(0.0), now)
        if self._stay is not None:
            self._stay()
