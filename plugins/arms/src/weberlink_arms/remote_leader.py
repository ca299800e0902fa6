"""A leader arm without an arm: a program in another process, such as a policy, gives the angles."""

from functools import partial
from math import inf, pi
from struct import Struct
from typing import Annotated, Any, ClassVar, NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.arms.contract import ArmFault, ArmReading, ArmSpec
from weberlink.geometry.joints import MOST_JOINTS, Joints, is_finite
from weberlink.options import Options
from weberlink_pointer.target_link import LEADER, TargetSocket, TargetSource

LEADS = 1  # bit of the button in a reading
ANGLES_LAYOUT = Struct("<4sQ?")  # mark, number, leads; the angles of all axes [rad] follow as doubles
ANGLES_MARK = b"WLA2"

Angle = Annotated[float, Field(ge=-100.0, le=100.0)]
Angles = Annotated[tuple[Angle, ...], Field(min_length=1, max_length=MOST_JOINTS + 1)]


class LeaderTarget(NamedTuple):
    """Angles of all axes [rad], and whether the process that sent them leads; the highest number is the newest."""

    angles: Joints
    leads: bool
    number: int


def pack_angles(angles: Joints, leads: bool, number: int) -> bytes:
    """The datagram of a target for an arm; raises ValueError for an angle that is not finite."""
    if not is_finite(angles):
        raise ValueError(f"expected finite angles, not {angles}")
    return ANGLES_LAYOUT.pack(ANGLES_MARK, number, leads) + Struct(f"<{len(angles)}d").pack(*angles)


def unpack_angles(data: bytes, axes: int) -> LeaderTarget:
    """The target of so many axes in a datagram; raises ValueError if it is none."""
    if len(data) != ANGLES_LAYOUT.size + 8 * axes:
        raise ValueError(f"a target of {axes} axes has {ANGLES_LAYOUT.size + 8 * axes} bytes, not {len(data)}")
    mark, number, leads = ANGLES_LAYOUT.unpack_from(data)
    angles: Joints = Struct(f"<{axes}d").unpack_from(data, ANGLES_LAYOUT.size)
    if mark != ANGLES_MARK or not is_finite(angles):
        raise ValueError("not a target")
    return LeaderTarget(angles, leads, number)


class RemoteLeaderOptions(Options):
    """Options of `remote_leader`. A setting for each axis is one number for all, or a list: the gripper last."""

    joints: tuple[str, ...] = Field(
        min_length=1, max_length=MOST_JOINTS, description="names of the joints, without the gripper"
    )
    gripper: bool = Field(default=False, description="whether one more axis, the last, is a gripper")
    lower_rad: Angle | Angles = Field(default=-pi, description="least angles [rad]")
    upper_rad: Angle | Angles = Field(default=pi, description="largest angles [rad]")
    home_rad: Angle | Angles = Field(default=0.0, description="angles until a program first leads [rad]")
    speed_rad_s: float = Field(default=2.0, ge=1e-3, le=100.0, description="largest speed of an axis [rad/s]")
    smooth_ms: float = Field(
        default=30.0,
        ge=1.0,
        le=1000.0,
        description="time constant of the filter that makes a motion of targets, which come at 30 to 60 Hz",
    )
    silence_ms: float = Field(
        default=200.0, ge=10.0, le=5000.0, description="a program that has written nothing for longer has let go"
    )

    @property
    def axes(self) -> int:
        return len(self.joints) + self.gripper

    def each(self, name: str) -> Joints:
        """A setting, for each axis."""
        value: float | Joints = getattr(self, name)
        return value if isinstance(value, tuple) else (value,) * self.axes

    @model_validator(mode="after")
    def _one_for_each_axis(self) -> Self:
        for name in ("lower_rad", "upper_rad", "home_rad"):
            if len(self.each(name)) != self.axes:
                raise ValueError(f"{name}: expected one number, or {self.axes}: joints, then the gripper")
        ranges = self.each("lower_rad"), self.each("home_rad"), self.each("upper_rad")
        for lower, home, upper in zip(*ranges, strict=True):
            if not lower <= home <= upper or lower == upper:
                raise ValueError(f"home_rad: {home:g} is not within lower_rad {lower:g} and upper_rad {upper:g}")
        return self


class JointMotion:
    """Follows targets by a critically damped filter of second order, no axis faster than its limit.

    All axes are slowed down by the same factor, so that a jump becomes a straight motion in joint space.
    """

    def __init__(self, smooth_ms: float, speed: float) -> None:
        self._rate, self._speed = 1e3 / smooth_ms, speed
        self.place(())

    def place(self, angles: Joints) -> None:
        """Be at angles [rad], at rest."""
        self.angles = angles
        self.stop()

    def stop(self) -> None:
        """Be at rest."""
        self._velocity = [0.0] * len(self.angles)

    def advance(self, target: Joints, step: float) -> None:
        """Move on by a step [s] towards a target [rad]."""
        # Implicit Euler, so that it is stable at any step: v' = (v + r^2 h (target - x)) / (1 + r h)^2.
        pull, faded = self._rate * self._rate * step, (1.0 + self._rate * step) ** -2
        angles = self.angles
        wanted = [(v + pull * (t - x)) * faded for v, t, x in zip(self._velocity, target, angles)]  # noqa: B905 - costs
        fastest = max(*wanted, -min(wanted))
        if fastest > self._speed:
            share = self._speed / fastest
            wanted = [share * v for v in wanted]
        self._velocity = wanted
        self.angles = tuple([x + v * step for x, v in zip(angles, wanted)])  # noqa: B905 - as above


class RemoteLeader:
    """An arm whose angles another process writes; a `weberlink.arms.contract.Arm`.

    Button 0 is pressed while a program leads: it has written, and its last target is not older than `silence_ms`. With
    `master.engage: {button: 0}` the follower is led only then. Without a program the arm keeps its angles. It displays
    no torque, since nobody holds it. `source` is that of the targets; None for the socket of this process.
    """

    COMPUTED: ClassVar[bool] = True
    Options: ClassVar[type[RemoteLeaderOptions]] = RemoteLeaderOptions

    def __init__(
        self, options: RemoteLeaderOptions, tick_period: float, source: TargetSource[LeaderTarget] | None = None
    ) -> None:
        self._no_torque: Joints = (0.0,) * options.axes
        self.spec = ArmSpec(
            name="remote_leader",
            joints=options.joints,
            gripper=options.gripper,
            lower=options.each("lower_rad"),
            upper=options.each("upper_rad"),
            torque_nm=self._no_torque,
            stiffness_nm_rad=(inf,) * options.axes,
            rate_hz=1.0 / tick_period,
            calibrated=True,
            buttons=1,
            watchdog_s=0.0,
        )
        self._home, self._silence = options.each("home_rad"), options.silence_ms * 1e-3
        self._source: TargetSource[LeaderTarget] = (
            TargetSocket(LEADER, partial(unpack_angles, axes=options.axes)) if source is None else source
        )
        self._motion = JointMotion(options.smooth_ms, options.speed_rad_s)
        self._target: Joints = self._home
        self._reading: ArmReading | None = None
        self._leads_until = -inf
        self._has_led = False

    def open(self, now: float) -> None:
        try:
            self._source.open()
        except OSError as error:
            raise ArmFault(f"{self.spec.name}: its socket cannot be opened: {error.strerror or error}") from None
        self._motion.place(self._home)
        self._target = self._home
        self._leads_until, self._has_led = -inf, False
        self._reading = ArmReading(now, self._home, self._no_torque)

    def latest(self, now: float) -> ArmReading:
        before = self._reading
        if before is None:
            raise ArmFault(f"{self.spec.name} is not open")
        if now <= before.at:
            return before
        arrived = self._source.newest()
        if arrived is not None:
            ranges = zip(arrived.angles, self.spec.lower, self.spec.upper, strict=True)
            self._target = tuple([min(max(angle, low), high) for angle, low, high in ranges])
            self._leads_until = now + self._silence if arrived.leads else -inf
            if arrived.leads and not self._has_led:  # the follower approaches from where it is, not by way of the home
                self._has_led = True
                self._motion.place(self._target)
        leads = now <= self._leads_until
        if leads:
            self._motion.advance(self._target, now - before.at)
        elif before.buttons:
            self._motion.stop()
        self._reading = ArmReading(now, self._motion.angles, self._no_torque, buttons=LEADS if leads else 0)
        return self._reading

    def command(self, values: Joints, now: float) -> None:  # noqa: ARG002 - nobody holds it
        if not is_finite(values):
            raise ValueError(f"torques must be finite, not {values}")

    def close(self) -> None:
        self._source.close()
        self._reading = None


def limits(options: dict[str, Any]) -> tuple[Joints, Joints]:
    """Least and largest angles that a remote leader of these options takes [rad]."""
    checked = RemoteLeaderOptions.model_validate(options)
    return checked.each("lower_rad"), checked.each("upper_rad")
