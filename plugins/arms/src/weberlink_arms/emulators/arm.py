"""An emulated arm with servos on a bus, whatever they are: time, faults, and joints that do not act on each other.

Mechanics advance on a fixed grid of steps, and requests and watchdogs take effect when they are due, independent of
when `advance` is called. Temperature, backlash and cables are not modelled.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from math import copysign, inf, pi, sin
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink.hardware.emulator import Emulator
from weberlink.options import Options
from weberlink_arms.emulators.bus import EmulatedBus, EmulatedServo
from weberlink_arms.servo.layout import ArmLayout
from weberlink_arms.servo.packet import Framing

GAP_S = 1.0  # longest time per call; the rest of a longer silence is skipped
# Periods of the hand's motion [s]; different, so that the axes pass through many combinations.
HAND_S = (4.0, 5.0, 6.0, 7.0, 8.0, 3.0)


class Wall(Options):
    """Something that an axis meets at an angle."""

    joint: str = Field(description="name of the axis")
    angle_rad: float = Field(ge=-6.3, le=6.3, description="where it begins")
    stiffness_nm_rad: float = Field(default=20.0, gt=0.0, le=200.0)
    below: bool = Field(default=False, description="the wall lies at smaller angles")

    def depth(self, angle: float) -> float:
        """How far an axis is in it, positive toward larger angles [rad]; 0 outside."""
        beyond = angle - self.angle_rad
        return min(beyond, 0.0) if self.below else max(beyond, 0.0)


class EmulatedBusOptions(Options):
    """Options of an emulated bus."""

    LAYOUT: ClassVar[ArmLayout]
    HIGHEST_ID: ClassVar[int]
    BAUD_RATES: ClassVar[tuple[int, ...]]

    ids: tuple[int, ...] | None = Field(default=None, description="of the servos; those of LeRobot if not given")
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]")

    @property
    def bus_ids(self) -> tuple[int, ...]:
        return self.ids or self.LAYOUT.ids

    @model_validator(mode="after")
    def check_bus(self) -> Self:
        ids, count = self.bus_ids, len(self.LAYOUT.ids)
        if len(ids) != count or len(set(ids)) != count or not all(0 <= id_ <= self.HIGHEST_ID for id_ in ids):
            raise ValueError(f"ids: expected {count} different ones from 0 to {self.HIGHEST_ID}, got {ids}")
        if self.baud not in self.BAUD_RATES:
            raise ValueError(f"baud: expected one of {', '.join(map(str, self.BAUD_RATES))}, got {self.baud}")
        return self


class JointArmOptions(EmulatedBusOptions):
    """Options of an emulated arm. Lists have one entry for each axis, the gripper last."""

    start_rad: tuple[float, ...] | None = Field(
        default=None, description="angles when power comes on; 0, and the gripper half open, if not given"
    )
    hand_n_m_rad: float = Field(default=0.0, ge=0.0, le=50.0, description="stiffness of the hand on each axis")
    hand_rad: tuple[float, ...] = Field(
        default=(0.0,) * 6, description="amplitudes of the hand's motion about the start"
    )
    hand_s: tuple[Annotated[float, Field(gt=0.0, le=1e3)], ...] = Field(
        default=HAND_S, description="periods of that motion"
    )
    walls: tuple[Wall, ...] = Field(default=(), description="what the axes meet")

    @property
    def start(self) -> Joints:
        """[rad]"""
        layout = self.LAYOUT
        return self.start_rad or (*(0.0,) * len(layout.joints), 0.5 * layout.upper[-1])

    @model_validator(mode="after")
    def check(self) -> Self:
        layout, count = self.LAYOUT, len(self.LAYOUT.ids)
        for name in ("start_rad", "hand_rad", "hand_s"):
            values = getattr(self, name)
            if values is not None and len(values) != count:
                raise ValueError(f"{name}: expected {count} values ({', '.join(layout.axes)}), got {len(values)}")
        for name, low, angle, high in zip(layout.axes, layout.lower, self.start, layout.upper, strict=True):
            if not low <= angle <= high:
                raise ValueError(f"start_rad: expected {low:.2f} to {high:.2f} rad for {name}, got {angle}")
        for wall in self.walls:
            if wall.joint not in layout.axes:
                raise ValueError(f"walls: expected a joint of {', '.join(layout.axes)}, got {wall.joint}")
        return self


class Joint:
    """An axis in motion: rotor and link as one inertia, dry and viscous friction, stops, walls, and a person's hand.

    Each step is linearly implicit Euler, stable for any stiffness.
    """

    def __init__(
        self, options: JointArmOptions, axis: int, inertia: float, coulomb: float, viscous: float, stop: float,
        stop_damper: float, hand_damper: float,
    ) -> None:  # fmt: skip
        """Inertia [kg m^2], friction [N m], [N m s], and stiffness [N m/rad] and dampers [N m s] of stops and hand."""
        layout = options.LAYOUT
        self.angle = self._start = options.start[axis]  # [rad]
        self.velocity = 0.0  # [rad/s]
        self.push = 0.0  # torque of a person besides the hand [N m]
        self.outside = 0.0  # torque of hand, person and walls [N m]
        self._inertia, self._coulomb, self._viscous = inertia, coulomb, viscous
        self._lower, self._upper = layout.lower[axis], layout.upper[axis]
        self._stop, self._stop_damper = stop, stop_damper
        self._walls = [wall for wall in options.walls if wall.joint == layout.axes[axis]]
        self._hand, self._hand_damper = options.hand_n_m_rad, hand_damper
        self._amplitude, self._period = options.hand_rad[axis], options.hand_s[axis]

    def turn(self, torque: float, time: float, step: float) -> None:
        """Move on by a step [s] under the torque of motor and weight [N m], `time` after the beginning [s]."""
        angle, spring, damper, push = self.angle, 0.0, 0.0, self.push
        if self._hand > 0.0:
            spring, damper = self._hand, self._hand_damper
            push += spring * (self._start + self._amplitude * sin(2.0 * pi * time / self._period) - angle)
        for wall in self._walls:
            if depth := wall.depth(angle):
                spring += wall.stiffness_nm_rad
                push -= wall.stiffness_nm_rad * depth
        if not self._lower <= angle <= self._upper:
            beyond = angle - (self._lower if angle < self._lower else self._upper)
            spring, damper, push = spring + self._stop, damper + self._stop_damper, push - self._stop * beyond
        inertia = self._inertia + step * (self._viscous + damper + step * spring)
        momentum = self._inertia * self.velocity + step * (torque + push)
        self.velocity = copysign(max(0.0, abs(momentum) - step * self._coulomb), momentum) / inertia
        self.outside = push - (damper + step * spring) * self.velocity
        self.angle += step * self.velocity


class ArmEmulator(Emulator, ABC):
    """See `weberlink.hardware.emulator`.

    `servos` are in the order of the joints, the gripper last; `baud` is the rate of the bus [bit/s].
    """

    transport: ClassVar[str] = "serial"
    NUMBERED: ClassVar[Mapping[str, int]]  # faults of one servo, and the least number that it may have
    STEP: ClassVar[float]  # of integration [s]

    def __init__(self, framing: Framing, servos: Sequence[EmulatedServo], baud: int) -> None:
        super().__init__()
        self.fault_values = {name: range(least, len(servos) + 1) for name, least in self.NUMBERED.items()}
        self.fault_values["wrong_model"] = range(0x10000)
        self.bus = EmulatedBus(framing, servos, baud)
        self.servos: Any = servos
        self._steps: int | None = None
        self._began = 0
        self.motor_nm = [0.0] * len(servos)  # torques of the motors on the axes [N m]

    @abstractmethod
    def _step(self, time: float) -> None:
        """Advance the mechanics by `STEP`, `time` after the beginning [s]."""

    @abstractmethod
    def _fail(self, name: str, value: float) -> None:
        """Cause a fault of this kind of arm."""

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "dead":
                self.bus.dead = {self.servos[int(value) - 1].id} if value >= 1 else set()
            case "restart":
                self.bus.restart()
                for servo in self.servos:
                    servo.restart(self._now)
            case "wrong_model":
                for servo in self.servos:
                    servo.rename(int(value))
            case _:
                self._fail(name, value)

    def _performed(self) -> None:
        """Called after every request."""

    def _deadline(self) -> float:
        """When a watchdog would trip next."""
        return inf

    def _watch(self, now: float) -> None:
        """Let watchdogs trip that are due."""

    def receive(self, data: bytes, now: float) -> None:
        self.advance(now)
        self.bus.receive(data, now)

    def advance(self, now: float) -> None:
        if self._steps is None:
            self._steps = self._began = int(now / self.STEP)
        self._now = now
        super().advance(now)
        while True:
            request, deadline = self.bus.next_request, self._deadline()
            due = min(request, deadline)
            if due > now:
                break
            self._move_to(due)
            if request <= deadline:
                self.bus.perform(due)
                self._performed()
            else:
                self._watch(due)
        self._move_to(now)

    def replies(self, now: float) -> list[bytes]:
        return self.bus.leaving(now)

    def next_timer(self) -> float | None:
        soonest = min(self.bus.next_request, self.bus.next_reply, self._deadline())
        return soonest if soonest < inf else None

    def _move_to(self, now: float) -> None:
        """Advance the mechanics to a time, on the grid of steps."""
        assert self._steps is not None
        end = int(now / self.STEP)
        begin = max(self._steps, end - round(GAP_S / self.STEP))
        self._steps = max(end, self._steps)
        for number in range(begin, end):
            self._step((number - self._began) * self.STEP)
