"""The SO-101: its axes, the mapping of servo counts to angles, and of load and current to torque."""

from dataclasses import dataclass
from math import ceil, floor, pi
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.feetech import registers
from weberlink_arms.feetech.packet import HIGHEST_ID, OVERHEAD
from weberlink_arms.feetech.registers import BAUD_RATES, CENTRE, ORDER_SIZE, PRESENT_SIZE, RAD_PER_COUNT, Present

Sign = Literal[1, -1]
Six = tuple[float, float, float, float, float, float]

JOINTS: Final = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
NAMES: Final = (*JOINTS, "gripper")
LOWER: Final[Six] = (-1.91986, -1.74533, -1.69, -1.65806, -2.74385, 0.0)
UPPER: Final[Six] = (1.91986, 1.74533, 1.69, 1.65806, 2.84121, 1.91986)
"""Of TheRobotStudio/SO-ARM100, so101_new_calib.xml, whose zeros are the middles of the ranges as LeRobot's calibration
sets them; the gripper there goes from -0.174533 (closed) to 1.74533."""
NO_LOAD_RAD_S: Final = 45.0 * 2.0 * pi / 60.0
"""Speed of the 1/345 servo at its rated voltage, by the vendor."""
LOST_S: Final = 0.25
"""Time without a good answer after which the arm counts as lost [s]."""
WORST_S: Final = 0.0005
"""Time of the host for an exchange [s]."""

Positive = Annotated[float, Field(gt=0.0, le=100.0)]
SixPositive = tuple[Positive, Positive, Positive, Positive, Positive, Positive]


class So101Options(BaseModel):
    """Options that leader and follower share. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll,
    gripper."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: str | None = Field(default=None, description="of the board; the only one plugged in if not given")
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]")
    ids: tuple[int, int, int, int, int, int] = Field(default=(1, 2, 3, 4, 5, 6), description="of the servos")
    rate_hz: float = Field(default=200.0, ge=20.0, le=400.0, description="of the bus")
    latency_ms: float = Field(default=1.0, ge=0.0, le=16.0, description="of the USB adapter; part of the stated lag")
    timeout_ms: float = Field(
        default=10.0, ge=2.0, le=100.0, description="longest delay of an answer beyond its time on the wire"
    )
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="time to search for an arm that is gone")
    sign: tuple[Sign, Sign, Sign, Sign, Sign, Sign] = Field(
        default=(1, 1, 1, 1, 1, 1), description="of each angle against the counting of its servo"
    )
    offset_rad: Six = Field(
        default=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), description="added to the angle from the middle of the servo's turn"
    )
    gripper_closed: int | None = Field(
        default=None,
        ge=0,
        le=4095,
        description="position of the gripper's servo where it is closed; by LeRobot's calibration if not given",
    )
    lower_rad: Six = Field(default=LOWER, description="least angles")
    upper_rad: Six = Field(default=UPPER, description="largest angles")
    torque_per_load_nm: SixPositive | None = Field(
        default=None,
        description="torque of a load of 0.1 %, by a calibration; by the data sheet if not given",
    )
    rated_v: float = Field(
        default=7.4, ge=4.0, le=14.0, description="supply at which the torques of the data sheet or calibration hold"
    )

    ORDERS: ClassVar[int] = OVERHEAD + 2 + 6 * (1 + ORDER_SIZE)
    """Most bytes of the orders of a cycle."""

    @property
    def margin_s(self) -> float:
        return 1e-3 * (self.timeout_ms + self.latency_ms)

    @property
    def bad_replies(self) -> int:
        """Number in a row after which the arm counts as lost."""
        return ceil(LOST_S / (self.margin_s + self.cycle_s(0)))

    def cycle_s(self, orders: int) -> float:
        """Time of an exchange with so many bytes of orders [s]."""
        wire = orders + OVERHEAD + 2 + 6 + 6 * (OVERHEAD + PRESENT_SIZE)
        return 10.0 / self.baud * wire + 1e-3 * self.latency_ms + WORST_S

    @model_validator(mode="after")
    def check_axes(self) -> Self:
        if self.baud not in BAUD_RATES:
            raise ValueError(f"baud: expected one of {', '.join(map(str, BAUD_RATES))}, got {self.baud}")
        if len(set(self.ids)) != 6 or not all(0 <= id_ <= HIGHEST_ID for id_ in self.ids):
            raise ValueError(f"ids: expected six different ones from 0 to {HIGHEST_ID}, got {self.ids}")
        most = floor(1.0 / self.cycle_s(self.ORDERS))
        if self.rate_hz > most:
            raise ValueError(
                f"rate_hz: expected {most} or less at {self.baud} bit/s and latency_ms {self.latency_ms:g}, "
                f"got {self.rate_hz:g}"
            )
        for name, low, high in zip(NAMES, self.lower_rad, self.upper_rad, strict=True):
            if not -2.0 * pi <= low < high <= 2.0 * pi:
                raise ValueError(f"lower_rad: expected less than upper_rad for {name}, got {low} and {high}")
        return self


@dataclass(frozen=True, slots=True)
class AngleScale:
    """Counts of the servos to angles [rad] and back.

    Args:
        signs: +1 or -1 of each axis.
        zeros: Counts at the angle 0.
    """

    signs: tuple[int, ...]
    zeros: tuple[float, ...]

    def angles(self, present: list[Present]) -> Joints:
        return self.angles_at([each.position for each in present])

    def angles_at(self, positions: list[int]) -> Joints:
        return tuple(
            [
                sign * (position - zero) * RAD_PER_COUNT
                for position, sign, zero in zip(positions, self.signs, self.zeros, strict=True)
            ]
        )

    def rates(self, present: list[Present]) -> Joints:
        """Speeds of the axes [rad/s]; the register counts steps per second."""
        return tuple([sign * each.velocity * RAD_PER_COUNT for each, sign in zip(present, self.signs, strict=True)])

    def counts(self, angles: Joints) -> list[int]:
        return [
            round(zero + sign * angle / RAD_PER_COUNT)
            for angle, sign, zero in zip(angles, self.signs, self.zeros, strict=True)
        ]


def angle_scale(options: So101Options, ranges: list[tuple[int, int]]) -> AngleScale:
    """The scale of an arm whose servos have these ranges [counts].

    Raises:
        HardwareFault: the closed gripper is neither given nor calibrated.
    """
    zeros = [
        CENTRE - sign * offset / RAD_PER_COUNT for sign, offset in zip(options.sign, options.offset_rad, strict=True)
    ]
    closed = options.gripper_closed
    if closed is None:
        low, high = ranges[-1]
        if (low, high) == (0, registers.COUNTS_PER_TURN - 1):
            raise HardwareFault(
                "gripper: its range is not calibrated; calibrate the arm with lerobot-calibrate, or give gripper_closed"
            )
        closed = low if options.sign[-1] > 0 else high
    zeros[-1] = closed
    return AngleScale(options.sign, tuple(zeros))


def check_place(names: tuple[str, ...], angles: Joints, lower: Joints, upper: Joints, beyond: float = 0.35) -> None:
    """Raise HardwareFault for an angle more than `beyond` [rad] outside its range: its zero is wrong."""
    for name, angle, low, high in zip(names, angles, lower, upper, strict=True):
        if not low - beyond <= angle <= high + beyond:
            raise HardwareFault(
                f"{name}: stands at {angle:.2f} rad, where it cannot be ({low:.2f} to {high:.2f}): calibrate the arm "
                "with lerobot-calibrate, or check ids, sign and offset_rad"
            )


def motor_torques(present: list[Present], rates: Joints, options: So101Options, per_load: Joints) -> Joints:
    """Torques of the motors along the axes [N m], by the duty of their bridges and their speed.

    At a speed w, a motor with the duty d at a supply U has the torque stall * (d U / U0 - w / w0), with the stall
    torque and the speed w0 without load at the rated supply U0.
    """
    torques = []
    for each, rate, sign, unit in zip(present, rates, options.sign, per_load, strict=True):
        supply = each.voltage * registers.V_PER_COUNT / options.rated_v
        torques.append(unit * (sign * each.load * supply - registers.FULL_LOAD * rate / NO_LOAD_RAD_S))
    return tuple(torques)
