"""The teleoperator's end of the link: the robot follows the operator, and what it feels is sensed."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.control.ends import Control, SlaveControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.protocol.endpoint import Endpoint
from weberlink.slave.guard import Guard
from weberlink.slave.robots.contract import OrientedRobot, Robot, RobotFault, RobotReading
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row

if TYPE_CHECKING:
    from weberlink.slave.rotation import ToolOrientation


@mypyc_attr(allow_interpreted_subclasses=True)
class TeleoperatorPort(Port):
    """The robot's end; a subclass says what is wanted, sensed and recorded.

    `command` and `point` take a command, or an orientation of the `tool`, and the time [s]; the tool turns with the
    hand, as the second incoming channel says, None without six degrees of freedom. `by_button`: the operator leads only
    while holding a button. `applied` is the last command; `where` the robot is and what is `felt` of the environment
    are as measured, `is_overloaded` whether that is above its limit.
    """

    fault: ClassVar[type[Exception]] = RobotFault

    def __init__(
        self,
        robot: Any,
        *,
        guard: Guard,
        command: Callable[[Any, float], None],
        controls: Sequence[Control],
        by_button: bool = False,
        tool: "ToolOrientation | None" = None,
        point: Any = None,
    ) -> None:
        super().__init__(robot, controls)
        self.guard, self._command, self._by_button = guard, command, by_button
        self.applied = self.where = self.felt = guard.held
        self.is_overloaded = False
        self.tool, self._point = tool, point
        self._led: Sequence[Any] = ()
        self._sensor: Any = None
        """Of the first channel: it knows which readings cannot be used."""

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
        self._take(reading)
        self.applied = self.where
        self.guard.place(self.where)

    def _take(self, reading: Any) -> None:
        """Take in where the robot is and what it feels."""
        raise NotImplementedError

    def accept(self, reading: Any) -> bool:
        self._take(reading)
        self.is_overloaded = self.guard.is_overloaded(self.felt)
        if not self.is_overloaded or self.guard.tripped:
            return False
        self.guard.trip(self.felt, self.where)
        self.tripped = True
        if self.tool is not None:
            self.tool.release()
        return True

    def settle(self, now: float) -> None:
        """Hold the robot where it is now: in contact, with the force that it presses with."""
        with suppress(self.fault):  # the side meets it in this very tick, as it does a reading that is not finite
            reading = self.latest(now)
            if self._sensor.complaint(reading) is None:
                self._take(reading)
                self.guard.place(self._settled(reading))
        if self.tool is not None:
            self.tool.reset()

    def _settled(self, reading: Any) -> Joints:
        """The command that holds the robot where it is."""
        raise NotImplementedError

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

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002 - of schemes that keep one
        return self.controls[0].credit

    def _wanted(self, values: Sequence[Any], elapsed: float) -> Joints | None:
        """What the operator commands; None for nothing."""
        raise NotImplementedError

    def actuate(self, values: Sequence[Any], now: float, elapsed: float, step: float, *, engaged: bool) -> None:
        self._led = values if engaged else ()
        wanted = self._wanted(values, elapsed) if engaged and not self.is_overloaded else None
        if wanted is None:
            self.applied = self.guard.hold(step)
        else:
            self.applied = self.guard.follow(wanted, self.where, self.felt, step)
            self.tripped = self.guard.tripped
        self._command(self.applied, now)
        if self.tool is not None:
            self.tool.touches = self.guard.touches
            self._point(self.tool.move(values[1] if engaged and self.follows else None, step), now)

    def report(self, row: Row, *, is_led: bool) -> None:
        guard = self.guard
        row.contact_ticks, row.clipped = guard.contact_ticks, guard.clipped
        row.ramping = guard.share < 1.0 if is_led or not self._by_button else RELEASED

    def halt(self, now: float) -> None:
        self._command(self.applied, now)
        if self.tool is not None:
            self._point(self.tool.hold(0.0), now)


class ContactForce:
    """The force of the environment on the robot [N], as far as it may be shown, and the command that belongs to it.

    A robot of stiffness k that rests at x under a force F is commanded to x - F / k. A moving one lags behind its
    command, but this point lies on the same static line at any speed. So predictors fit one line to all samples.
    """

    def __init__(self, port: "RobotPort", stiffness: float) -> None:
        self.value: Vector = ZERO
        self.rest: Vector = ZERO
        """The command at which the robot would rest with this force where it is [m]."""
        self._port = port
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

    def sample(self) -> tuple[Joints, Vector, float]:
        return self._port.shown(self.value), self.rest, inf


class RobotPort(TeleoperatorPort):
    """A robot that a hand leads."""

    def __init__(
        self,
        robot: Robot,
        *,
        guard: Guard,
        control: SlaveControl,
        endpoint: Endpoint,
        tool: "ToolOrientation | None" = None,
        by_button: bool = False,
    ) -> None:
        point = robot.point if isinstance(robot, OrientedRobot) else None
        super().__init__(
            robot, guard=guard, command=robot.command, controls=(control,), by_button=by_button, tool=tool, point=point
        )
        self._control, self._endpoint = control, endpoint
        self.force = self._sensor = ContactForce(self, robot.spec.stiffness_n_m)
        self.commanded: Any = ZERO
        """The decoded position that was last followed [m]."""

    def led(self, channel: int) -> Vector | None:
        """Where the operator leads the robot in an incoming channel, whether it follows or not; None for nowhere."""
        led: Vector | None = self._led[channel] if self._led else None
        return led

    def _take(self, reading: RobotReading) -> None:
        self.where, self.felt = reading.position, reading.force

    def _settled(self, reading: RobotReading) -> Joints:
        self.force.take(reading)
        return self.force.rest

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002
        if encodes:
            applied: Any = self.applied
            self._control.observe(applied, self.force.value)
        return self._control.credit

    def _wanted(self, values: Sequence[Any], elapsed: float) -> Joints | None:
        commanded = values[0]
        if commanded is None:
            return None
        self.commanded = commanded
        endpoint = self._endpoint
        applied: Any = self.applied
        return self._control.follow(commanded, applied, elapsed, endpoint.credit.known, endpoint.clock.rtt)

    def report(self, row: Row, *, is_led: bool) -> None:
        super().report(row, is_led=is_led)
        applied: Any = self.applied
        row.position, row.output = self.commanded, applied
        tool = self.tool
        if tool is not None:
            row.rotation_output = tool.applied
            row.clipped, row.ramping = row.clipped or tool.clipped, row.ramping or tool.ramping
