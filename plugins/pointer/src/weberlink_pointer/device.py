"""A hand on a handle, led by a pointer: a mouse, a finger or a gamepad in another process gives the target."""

from dataclasses import replace
from math import hypot, inf
from typing import ClassVar

from pydantic import Field

from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, quaternion, toward, vector
from weberlink.geometry.vector import ZERO, Vector, confined, cube, distance, interpolate, scale, subtract
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.hand_device import HandDevice
from weberlink.master.devices.hand_options import HandOptions
from weberlink.master.devices.operator import OperatorOptions, motion_of
from weberlink_pointer.target_link import POINTER, PointerTarget, TargetSocket, TargetSource, unpack

HELD = 1  # bit of the button in a reading


class PointerOptions(OperatorOptions):
    """Options of `pointer`. The hand is lighter and softer than that of `operator`, and more than critically damped:
    the handle is never faster than its intention, and stops at a wall while the pointer goes on.
    """

    hand: HandOptions = HandOptions(mass_kg=0.1, damping_n_s_m=8.0, stiffness_n_m=150.0)
    tremor_m: float = Field(
        default=0.0, ge=0.0, le=0.01, description="RMS per axis of the free hand, 8 to 12 Hz; a person has one already"
    )
    smooth_ms: float = Field(
        default=10.0,
        ge=0.1,
        le=1000.0,
        description="time constant of the filter that makes a motion of the targets, which come at 30 to 125 Hz",
    )
    speed_m_s: float = Field(default=0.5, ge=1e-3, le=10.0, description="largest speed of the intended position")
    reach_m: float = Field(
        default=0.04, ge=1e-4, le=1.0, description="farthest that the intended position is from the handle"
    )
    turn_rad_s: float = Field(
        default=3.0, ge=1e-2, le=100.0, description="largest angular speed of the intended orientation, with a wrist"
    )
    silence_ms: float = Field(
        default=100.0, ge=10.0, le=5000.0, description="a pointer that has sent nothing for longer has let go"
    )
    scripted: bool = Field(
        default=False, description="follow the script, as if held, until the pointer first holds the handle"
    )


class PointerIntention:
    """Where the hand means to be: it follows the target by a critically damped filter of second order.

    Its speed is at most `speed_m_s`, and it is at most `reach_m` from the handle. So however the target jumps, the
    hand pulls with at most `reach_m` times its stiffness, and meets a wall with at most `speed_m_s`.
    """

    def __init__(self, options: PointerOptions) -> None:
        self._rate = 1e3 / options.smooth_ms
        self._speed, self._reach, self._box = options.speed_m_s, options.reach_m, cube(options.workspace_m)
        self.place(options.home_m)

    def place(self, position: Vector) -> None:
        """Be at a position [m], at rest."""
        self.position, self._velocity = position, ZERO

    def follow(self, target: Vector, handle: Vector, step: float) -> None:
        """Move on by a step [s] towards a target [m], while the handle is at `handle` [m]."""
        (x, y, z), (u, v, w), rate = self.position, self._velocity, self._rate
        a, b, c = confined(target, self._box)
        # Implicit Euler, so that it is stable at any step: v' = (v + r^2 h (target - x)) / (1 + r h)^2.
        pull, faded = rate * rate * step, (1.0 + rate * step) ** -2
        u, v, w = (u + pull * (a - x)) * faded, (v + pull * (b - y)) * faded, (w + pull * (c - z)) * faded
        way = step * min(1.0, self._speed / max(hypot(u, v, w), 1e-9))
        before, there = self.position, (x + way * u, y + way * v, z + way * w)
        far = distance(there, handle)
        if far > self._reach:
            there = interpolate(handle, there, self._reach / far)
        self.position, self._velocity = there, scale(subtract(there, before), 1.0 / step)


class TurnIntention:
    """How a hand means to turn the handle: it follows a target by a filter of first order, at a bounded speed.

    `smooth` is the time constant of the filter [s], > 0, and `speed` the largest angular speed [rad/s].
    """

    def __init__(self, smooth: float, speed: float) -> None:
        self._smooth, self._speed = smooth, speed
        self.orientation: Quaternion = IDENTITY

    @property
    def rotation(self) -> Vector:
        """The rotation vector of the orientation [rad]."""
        return vector(self.orientation)

    def follow(self, target: Vector, step: float) -> None:
        """Move on by a step [s] towards a rotation vector [rad], on the shortest way."""
        goal = quaternion(target)
        share = step / (self._smooth + step)  # implicit Euler, as of `PointerIntention`
        angle = min(share * angle_between(self.orientation, goal), self._speed * step)
        self.orientation = toward(self.orientation, goal, angle)


class PointerDevice(HandDevice):
    """A hand that follows the targets of a source while they are held, and is still while they are not.

    Button 0 is pressed while the newest target is held and not older than `silence_ms`. On release the hand lets go of
    where it meant to be: it stays where the handle is, turned as it is. With `scripted`, a script moves it until it is
    first held. Only targets turn a wrist. Without a `source` it is the socket of this process.
    """

    Options: ClassVar[type[PointerOptions]] = PointerOptions
    NAME: ClassVar[str] = "pointer"

    def __init__(
        self, options: PointerOptions, tick_period: float, source: TargetSource[PointerTarget] | None = None
    ) -> None:
        super().__init__(self.NAME, options, self._intended, tick_period, self._turned)
        self.spec = replace(self.spec, buttons=1)
        self._pointer, self._silence = options, options.silence_ms * 1e-3
        self._source = TargetSocket(POINTER, unpack) if source is None else source
        self._script = motion_of(options.script, options.home_m, options.repeat)[0]
        self._begin()

    def _begin(self) -> None:
        self._lead = PointerIntention(self._pointer)
        self._turn_lead: TurnIntention | None = None
        if self._pointer.wrist is not None:
            self._turn_lead = TurnIntention(self._pointer.smooth_ms * 1e-3, self._pointer.turn_rad_s)
        self._target, self._rotation = self._pointer.home_m, ZERO
        self._is_scripted, self._is_held = self._pointer.scripted, False
        self._held_until = self._looked_at = -inf
        self._time = self._turned_at = 0.0

    def open(self, now: float) -> None:
        try:
            self._source.open()
        except OSError as error:
            raise DeviceFault(f"{self.spec.name}: its socket cannot be opened: {error.strerror or error}") from None
        self._begin()
        super().open(now)

    def close(self) -> None:
        self._source.close()
        super().close()

    def latest(self, now: float) -> DeviceReading:
        if now > self._looked_at:
            self._looked_at = now
            self._take_target(now)
        reading = super().latest(now)
        pressed = HELD if self._is_held or self._is_scripted else 0
        return DeviceReading(reading.at, reading.position, False, reading.orientation, pressed)

    def _take_target(self, now: float) -> None:
        arrived = self._source.newest()
        if arrived is not None:
            self._target, self._rotation = arrived.target, arrived.rotation
            self._held_until = now + self._silence if arrived.held else -inf
        was_held, self._is_held = self._is_held, now <= self._held_until
        if self._is_held:
            self._is_scripted = False
        elif was_held:
            self._lead.place(self._hand.position)
            if self._turn_lead is not None and self._turning is not None:
                self._turn_lead.orientation = self._turning.orientation

    def _intended(self, time: float) -> tuple[Vector, bool]:
        step, self._time = time - self._time, time
        lead = self._lead
        if self._is_held:
            lead.follow(self._target, self._hand.position, step)
        elif self._is_scripted:
            lead.place(self._script.at(time)[0])
        return lead.position, False

    def _turned(self, time: float) -> Vector:
        """The intended rotation vector [rad]; only with a wrist."""
        step, self._turned_at = time - self._turned_at, time
        lead = self._turn_lead
        assert lead is not None
        if self._is_held:
            lead.follow(self._rotation, step)
        return lead.rotation
