"""Options that all arms on a bus of Dynamixel motors share, checked against what bus and motors allow."""

from math import ceil, floor, pi
from typing import ClassVar, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink_arms.dynamixel.bus import BITS_PER_BYTE, STATUS_OVERHEAD
from weberlink_arms.dynamixel.layouts import ArmLayout
from weberlink_arms.dynamixel.motor_models import CurrentLaw
from weberlink_arms.dynamixel.packet import HIGHEST_ID, OVERHEAD
from weberlink_arms.dynamixel.registers import BAUD_RATES, CENTRE, PRESENT_SIZE, RAD_PER_COUNT

SLOWEST_HZ: Final = 50.0
LOST_S: Final = 0.15
"""Time without a good answer after which the arm counts as lost [s]."""


class DynamixelArmOptions(BaseModel):
    """Options of an arm on a bus of Dynamixel motors. Lists have one entry for each axis, the gripper last."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    LAYOUT: ClassVar[ArmLayout]
    GOAL_SIZE: ClassVar[int]
    """Bytes of a goal for each motor."""

    port: str | None = Field(default=None, description="of the adapter; the only one plugged in if not given")
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]; motors are delivered with 57600")
    ids: tuple[int, ...] | None = Field(default=None, description="of the motors; those of LeRobot or the vendor")
    sign: tuple[Literal[-1, 1], ...] | None = Field(
        default=None, description="direction of each angle against the counting of its motor"
    )
    offset_rad: tuple[float, ...] | None = Field(
        default=None, description="angle of each axis where its motor counts 2048; the gripper is closed at 0"
    )
    lower_rad: tuple[float, ...] | None = Field(default=None, description="least angles")
    upper_rad: tuple[float, ...] | None = Field(default=None, description="largest angles")
    rate_hz: float = Field(default=250.0, ge=SLOWEST_HZ, le=1000.0, description="of the bus")
    latency_ms: float = Field(
        default=1.0, ge=0.0, le=16.0, description="time for which the adapter collects answers; part of the stated lag"
    )
    timeout_ms: float = Field(
        default=10.0, ge=2.0, le=100.0, description="longest delay of an answer beyond its time on the wire"
    )
    bus_watchdog_ms: float = Field(
        default=80.0, ge=20.0, le=2540.0, description="time without any instruction after which the motors stop"
    )
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="time to search for an arm that is gone")
    gravity: bool = Field(default=False, description="use a model of the arm's weight; needs right sign and offset_rad")
    current_law: Literal["motor", "supply"] | None = Field(
        default=None, description="what the motors' current means: that of the motor, or of its supply (XL330)"
    )

    torque_ratio: tuple[float, ...] | None = Field(
        default=None,
        description="true torque of each axis over that of the data sheet, by a calibration; 1 if not given",
    )

    @property
    def ratios(self) -> Joints:
        """True torques over those of the data sheets."""
        return (1.0,) * len(self.LAYOUT.ids) if self.torque_ratio is None else self.torque_ratio

    @property
    def motor_ids(self) -> tuple[int, ...]:
        return self.LAYOUT.ids if self.ids is None else self.ids

    @property
    def signs(self) -> tuple[int, ...]:
        return self.LAYOUT.sign if self.sign is None else self.sign

    @property
    def offsets(self) -> Joints:
        """[rad]"""
        return self.LAYOUT.offset_rad if self.offset_rad is None else self.offset_rad

    @property
    def lower(self) -> Joints:
        """[rad]"""
        return self.LAYOUT.lower if self.lower_rad is None else self.lower_rad

    @property
    def upper(self) -> Joints:
        """[rad]"""
        return self.LAYOUT.upper if self.upper_rad is None else self.upper_rad

    @property
    def laws(self) -> tuple[CurrentLaw, ...]:
        """What each motor's current register means."""
        chosen = None if self.current_law is None else CurrentLaw(self.current_law)
        return tuple(each.law if chosen is None or not each.controls_current else chosen for each in self.LAYOUT.motors)

    @property
    def margin_s(self) -> float:
        """Longest time of an answer beyond its time on the wire [s]."""
        return 1e-3 * (self.timeout_ms + self.latency_ms)

    @property
    def watchdog_s(self) -> float:
        return 1e-3 * self.bus_watchdog_ms

    @property
    def reading_s(self) -> float:
        """From the request to the last answer [s]."""
        count = len(self.LAYOUT.ids)
        wire = OVERHEAD + 4 + count + count * (STATUS_OVERHEAD + PRESENT_SIZE)
        return BITS_PER_BYTE / self.baud * wire + 1e-3 * self.latency_ms

    @property
    def lag_s(self) -> float:
        """Age of a reading that is interpolated between two cycles [s]."""
        return 1.0 / self.rate_hz + self.reading_s

    @property
    def bad_replies(self) -> int:
        """How many in a row mean that the arm is lost."""
        return max(3, ceil(LOST_S / (self.margin_s + self.reading_s)))

    def angles(self, counts: list[int]) -> Joints:
        """[rad]"""
        return tuple(
            [
                sign * (count - CENTRE) * RAD_PER_COUNT + offset
                for sign, count, offset in zip(self.signs, counts, self.offsets, strict=True)
            ]
        )

    def positions(self, angles: Joints) -> list[int]:
        """Counts of the motors at these angles [rad]."""
        return [
            round(sign * (angle - offset) / RAD_PER_COUNT) + CENTRE
            for sign, angle, offset in zip(self.signs, angles, self.offsets, strict=True)
        ]

    @model_validator(mode="after")
    def check_lists(self) -> Self:
        count = len(self.LAYOUT.ids)
        for name in ("ids", "sign", "offset_rad", "lower_rad", "upper_rad", "torque_ratio"):
            value = getattr(self, name)
            if value is not None and len(value) != count:
                raise ValueError(f"{name}: expected {count} values ({', '.join(self.LAYOUT.axes)}), got {len(value)}")
        ids = self.motor_ids
        if len(set(ids)) != count or not all(0 <= id_ <= HIGHEST_ID for id_ in ids):
            raise ValueError(f"ids: expected {count} different ones from 0 to {HIGHEST_ID}, got {ids}")
        if not all(0.1 <= ratio <= 10.0 for ratio in self.ratios):
            raise ValueError(f"torque_ratio: expected values from 0.1 to 10, got {self.torque_ratio}")
        for axis, low, high, offset in zip(self.LAYOUT.axes, self.lower, self.upper, self.offsets, strict=True):
            if not -2.0 * pi <= low < high <= 2.0 * pi or not abs(offset) <= 2.0 * pi:
                raise ValueError(f"{axis}: expected lower_rad below upper_rad, and all within one turn of 0")
        return self

    @model_validator(mode="after")
    def check_bus(self) -> Self:
        if self.baud not in BAUD_RATES:
            raise ValueError(f"baud: expected one of {', '.join(map(str, BAUD_RATES))}, got {self.baud}")
        writing = OVERHEAD + 4 + len(self.LAYOUT.ids) * (1 + self.GOAL_SIZE)
        busy = self.reading_s + BITS_PER_BYTE / self.baud * writing
        if busy * SLOWEST_HZ > 1.0:
            raise ValueError(
                f"baud: expected more: at {self.baud} bit/s and latency_ms {self.latency_ms:g} a cycle takes "
                f"{busy * 1e3:.1f} ms, and an arm needs {SLOWEST_HZ:.0f} Hz; write 3 (1 Mbit/s) to register 8 of the "
                "motors"
            )
        if busy * self.rate_hz > 1.0:
            raise ValueError(
                f"rate_hz: expected {floor(1.0 / busy)} or less: at {self.baud} bit/s and latency_ms "
                f"{self.latency_ms:g} a cycle takes {busy * 1e3:.1f} ms"
            )
        if self.bus_watchdog_ms < 2.0 * self.timeout_ms:
            raise ValueError(f"bus_watchdog_ms: expected at least twice timeout_ms, {2.0 * self.timeout_ms:g}")
        return self
