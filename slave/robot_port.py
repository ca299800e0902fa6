"""The teleoperator's end of the link: the robot follows the operator, and what it feels is sensed."""

from collections.abc import Sequence
from contextlib import suppress
from math import inf
from typing import ClassVar, Final, Protocol

from weberlink.control.ends import SlaveControl
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.protocol.endpoint import Endpoint
from weberlink.slave.robots.contract import Robot, RobotFault, RobotReading
from weberlink.slave.safety import CommandGuard, PressLimit
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.row import Row


class ChannelFollower(Protocol):
    """Makes the robot follow an incoming channel other than the position, for example an orientation."""

    @property
    def applied(self) -> Vector:
        """What the robot was last commanded, in the form of the channel."""

    @property
    def clipped(self) -> bool:
        """Whether the last command was limited."""

    @property
    def ramping(self) -> bool:
        """Whether less than all of what is felt may be shown."""

    def shown(self, felt: Vector) -> Vector:
        """The part of a force or torque that may be shown to the operator now."""

    def move(self, commanded: Vector | None, step: float, now: float) -> None:
        """Follow the decoded value for `step` more seconds; hold where there is None."""

    def halt(self, now: float) -> None:
        """Hold, at once."""

    def reset(self) -> None:
        """Begin anew: approach what is commanded, and show nothing until there."""

    def release(self) -> None:
        """Nobody leads any more: hold."""


class ContactForce:
    """The force of the environment on the robot [N], as far as it may be shown, and the command that belongs to it.

    A robot of stiffness k that rests at x under a force F is commanded to x - F / k. A moving one lags behind its
    command, but this point lies on the same static line at any speed. So predictors fit one line to all samples.

    Args:
        port: that has the robot.
        stiffness: of the robot towards its command [N/m]; infinite for an ideal one, which is at its command.
    """

    def __init__(self, port: "RobotPort", stiffness: float) -> None:
        self.value: Vector = ZERO
        self.rest: Vector = ZERO
        """The command at which the robot would rest with this force where it is [m]."""
        self._port = port
        self._compliance = 1.0 / stiffness

    def complaint(self, reading: RobotReading) -> str | None:
        if not is_finite(reading.position):
            return f"reports the position {reading.position}"
        return None if is_finite(reading.force) else f"reports the force {reading.force}"

    def take(self, reading: RobotReading) -> None:
        self.value = reading.force
        (x, y, z), (u, v, w), compliance = reading.position, reading.force, self._compliance
        self.rest = (x - compliance * u, y - compliance * v, z - compliance * w)

    def sample(self) -> tuple[Vector, Vector, float]:
        return self._port.shown(self.value), self.rest, inf


class RobotPort:
    """A robot behind its guard; a `weberlink.session.port.Port`.

    Args:
        robot: not yet open.
        guard: bounds the commanded position.
        followers: one per incoming channel beside the position.
        control: the teleoperator's end of the control scheme.
        endpoint: measures the link.
        press_limit: bounds the force with which the robot presses.
        trip_force: contact force above which the robot stops following and backs off [N].
        by_button: whether the operator leads only while holding a button; for telemetry.
    """

    kind: Final = "robot"
    leads: Final = False
    fault: ClassVar[type[RobotFault]] = RobotFault
    enabled: Final = True
    at_rest: Final = True
    unfounded: Final = False
    ended: Final = False

    def __init__(
        self,
        *,
        robot: Robot,
        guard: CommandGuard,
        followers: Sequence[ChannelFollower],
        control: SlaveControl,
        endpoint: Endpoint,
        press_limit: PressLimit,
        trip_force: float,
        by_button: bool = False,
    ) -> None:
        self.robot, self.followers, self._control, self._by_button = robot, followers, control, by_button
        self.controls = (control,)
        self.name = robot.spec.name
        self.force = ContactForce(self, robot.spec.stiffness_n_m)
        self.commanded: Vector = ZERO
        """The decoded position that was last followed [m]."""
        self._led: Sequence[Vector | None] = ()
        self.applied: Vector = ZERO
        """The commanded position after control and guard [m]."""
        self._guard = guard
        self._press_limit = press_limit
        self.contact_ticks = 0
        """Ticks in which the press limit held the robot back."""
        self._endpoint = endpoint
        # A reading that saturates at the limit is not above it.
        self._trip_squared = (trip_force * (1.0 + 1e-9)) ** 2
        self._is_overloaded = False
        self._where: Vector = ZERO
        # Bound here: both are called in every tick.
        self.latest = robot.latest
        self.shown = self._shown_in_all if followers else guard.shown

    @property
    def follows(self) -> bool:
        """Whether no contact that was too strong keeps the robot from following."""
        return not (self._is_overloaded or self._guard.tripped)

    def led(self, channel: int) -> Vector | None:
        """Where the operator leads the robot in an incoming channel, whether it follows or not; None for nowhere."""
        return self._led[channel] if self._led else None

    @property
    def trouble(self) -> str | None:
        trouble: str | None = getattr(self.robot, "trouble", None)
        return trouble

    @property
    def tripped(self) -> bool:
        return self._guard.tripped

    @property
    def clipped(self) -> bool:
        clipped = self._guard.clipped
        for follower in self.followers:
            clipped |= follower.clipped
        return clipped

    @property
    def ramping(self) -> bool:
        ramping = self._guard.ramping
        for follower in self.followers:
            ramping |= follower.ramping
        return ramping

    def _shown_in_all(self, felt: Vector) -> Vector:
        """What may be shown of a force or torque: all, once the robot is where the operator is in every channel."""
        shown = self._guard.shown(felt)
        for follower in self.followers:
            shown = follower.shown(shown)
        return shown

    def open(self, now: float) -> None:
        self.robot.open(now)
        reading = self.robot.latest(now)
        problem = self.force.complaint(reading)
        if problem is not None:
            self.robot.close()
            raise RobotFault(f"{self.name} {problem}")
        self.applied = self._where = reading.position
        self._guard.place(self.applied)

    def close(self) -> None:
        self.robot.close()

    def accept(self, reading: RobotReading) -> bool:
        self._where = reading.position
        x, y, z = reading.force
        self._is_overloaded = x * x + y * y + z * z > self._trip_squared
        trips = self._is_overloaded and not self._guard.tripped
        if trips:
            self._guard.trip(reading.force, self._where)
            for follower in self.followers:
                follower.release()
        return trips

    def settle(self, now: float) -> None:
        """Hold the robot where it is now: in contact, with the force that it presses with."""
        with suppress(RobotFault):  # the side meets it in this very tick, as it does a reading that is not finite
            reading = self.robot.latest(now)
            if self.force.complaint(reading) is None:
                self._where = reading.position
                self.force.take(reading)
                self._guard.place(self.force.rest)
        for follower in self.followers:
            follower.reset()

    def reset(self) -> None:
        self._guard.reset()
        for follower in self.followers:
            follower.reset()

    def restart(self) -> None: ...

    def release(self, *, retreat: bool) -> None:
        if retreat:
            self._guard.release(self.force.value, self._where)
        else:
            self._guard.release()
        for follower in self.followers:
            follower.release()

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:  # noqa: ARG002
        if encodes:
            self._control.observe(self.applied, self.force.value)
        return self._control.credit

    def actuate(
        self, values: Sequence[Vector | None], now: float, elapsed: float, step: float, *, engaged: bool
    ) -> None:
        guard, follows = self._guard, engaged and not self._is_overloaded
        commanded = values[0] if follows else None
        self._led = values if engaged else ()
        if commanded is None:
            self.applied = guard.hold(step)
            self._press_limit.forget()
        else:
            self.commanded = commanded
            endpoint = self._endpoint
            wanted = self._control.follow(commanded, self.applied, elapsed, endpoint.credit.known, endpoint.clock.rtt)
            goal = self._press_limit.bounded(wanted, self.applied, self._where, self.force.value, step)
            self.contact_ticks += goal != wanted
            self.applied = guard.follow(goal, step)
        self.robot.command(self.applied, now)
        if self.followers:
            follows = follows and not guard.tripped
            for follower, value in zip(self.followers, values[1:], strict=True):
                follower.move(value if follows else None, step, now)

    def report(self, row: Row, *, is_led: bool) -> None:
        row.position, row.output = self.commanded, self.applied
        row.contact_ticks, row.clipped = self.contact_ticks, self.clipped
        row.ramping = self.ramping if is_led or not self._by_button else RELEASED
        if self.followers:
            row.rotation_output = self.followers[0].applied

    def halt(self, now: float) -> None:
        self.robot.command(self.applied, now)
        for follower in self.followers:
            follower.halt(now)
