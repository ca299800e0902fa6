"""Options that arms with servos share, checked against what bus and arm allow."""

from math import ceil, floor, pi
from typing import ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink.options import Options
from weberlink_arms.servo.bus import BITS_PER_BYTE, ServoBus
from weberlink_arms.servo.layout import CENTRE, RAD_PER_COUNT, ArmLayout


class AngleScale(NamedTuple):
    """Counts of the servos to angles [rad] and back: +1 or -1 of each axis, and its counts at the angle 0."""

    signs: tuple[int, ...]
    zeros: tuple[float, ...]

    def angles(self, counts: list[int]) -> Joints:
        axes = zip(self.signs, counts, self.zeros, strict=True)
        return tuple([sign * (count - zero) * RAD_PER_COUNT for sign, count, zero in axes])

    def counts(self, angles: Joints) -> list[int]:
        axes = zip(self.signs, angles, self.zeros, strict=True)
        return [round(zero + sign * angle / RAD_PER_COUNT) for sign, angle, zero in axes]


class BusOptions(Options):
    """Options of a bus."""

    BUS: ClassVar[type[ServoBus]]
    BAUD_RATES: ClassVar[tuple[int, ...]]
    HIGHEST_ID: ClassVar[int]
    SLOWEST_HZ: ClassVar[float]
    GOAL_SIZE: ClassVar[int]  # bytes of a goal for each servo
    HOST_S: ClassVar[float] = 0.0  # time of the host for an exchange [s]
    LOST_S: ClassVar[float] = 0.15  # time without a good answer after which the arm counts as lost [s]

    port: str | None = Field(default=None, description="of the adapter; the only one plugged in if not given")
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]")
    latency_ms: float = Field(
        default=1.0, ge=0.0, le=16.0, description="time for which the adapter collects answers; part of the stated lag"
    )
    timeout_ms: float = Field(
        default=10.0, ge=2.0, le=100.0, description="longest delay of an answer beyond its time on the wire"
    )
    rate_hz: float
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="time to search for an arm that is gone")

    @property
    def bus_ids(self) -> tuple[int, ...]:
        raise NotImplementedError

    @property
    def axis_names(self) -> tuple[str, ...]:
        """For messages; numbers if empty."""
        return ()

    @property
    def margin_s(self) -> float:
        """Longest time of an answer beyond its time on the wire [s]."""
        return 1e-3 * (self.timeout_ms + self.latency_ms)

    @property
    def reading_s(self) -> float:
        """From the request to the last answer [s]."""
        framing, (address, size), ids = self.BUS.FRAMING, self.BUS.PRESENT, self.bus_ids
        wire = len(framing.sync_read(address, size, ids)) + len(ids) * (framing.OVERHEAD + size)
        return BITS_PER_BYTE / self.baud * wire + 1e-3 * self.latency_ms + self.HOST_S

    @property
    def lag_s(self) -> float:
        """Age of a reading that is interpolated between two cycles [s]."""
        return 1.0 / self.rate_hz + self.reading_s

    @property
    def bad_replies(self) -> int:
        """How many in a row mean that the arm is lost."""
        return max(3, ceil(self.LOST_S / (self.margin_s + self.reading_s)))

    @model_validator(mode="after")
    def check_bus(self) -> Self:
        if self.baud not in self.BAUD_RATES:
            raise ValueError(f"baud: expected one of {', '.join(map(str, self.BAUD_RATES))}, got {self.baud}")
        ids = self.bus_ids
        if len(set(ids)) != len(ids) or not all(0 <= id_ <= self.HIGHEST_ID for id_ in ids):
            raise ValueError(f"ids: expected {len(ids)} different ones from 0 to {self.HIGHEST_ID}, got {ids}")
        goals = self.BUS.FRAMING.sync_write(0, self.GOAL_SIZE, [(id_, bytes(self.GOAL_SIZE)) for id_ in ids])
        busy = self.reading_s + BITS_PER_BYTE / self.baud * len(goals)
        cycle = f"at {self.baud} bit/s and latency_ms {self.latency_ms:g} a cycle takes {busy * 1e3:.1f} ms"
        if busy * self.SLOWEST_HZ > 1.0:
            raise ValueError(
                f"baud: expected more: {cycle}, and the arm needs {self.SLOWEST_HZ:.0f} Hz; set the servos to 1 Mbit/s"
            )
        if busy * self.rate_hz > 1.0:
            raise ValueError(f"rate_hz: expected {floor(1.0 / busy)} or less: {cycle}")
        return self


class ServoOptions(BusOptions):
    """Options of an arm joint by joint. Lists have one entry for each axis, the gripper last."""

    LAYOUT: ClassVar[ArmLayout]
    LISTS: ClassVar[tuple[str, ...]] = ("ids", "sign", "offset_rad", "lower_rad", "upper_rad")

    ids: tuple[int, ...] | None = Field(default=None, description="of the servos; those of LeRobot or the vendor")
    sign: tuple[Literal[-1, 1], ...] | None = Field(
        default=None, description="direction of each angle against the counting of its servo"
    )
    offset_rad: tuple[float, ...] | None = Field(
        default=None, description="angle of each axis where its servo counts 2048; the gripper is closed at 0"
    )
    lower_rad: tuple[float, ...] | None = Field(default=None, description="least angles")
    upper_rad: tuple[float, ...] | None = Field(default=None, description="largest angles")

    @property
    def bus_ids(self) -> tuple[int, ...]:
        return self.LAYOUT.ids if self.ids is None else self.ids

    @property
    def axis_names(self) -> tuple[str, ...]:
        return self.LAYOUT.axes

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
    def scale(self) -> AngleScale:
        zeros = [CENTRE - sign * each / RAD_PER_COUNT for sign, each in zip(self.signs, self.offsets, strict=True)]
        return AngleScale(self.signs, tuple(zeros))

    def within(self, angles: Joints) -> Joints:
        """The nearest angles within the range [rad]."""
        axes = zip(angles, self.lower, self.upper, strict=True)
        return tuple([min(max(angle, low), high) for angle, low, high in axes])

    @model_validator(mode="after")
    def check_lists(self) -> Self:
        count = len(self.LAYOUT.ids)
        for name in self.LISTS:
            value = getattr(self, name)
            if value is not None and len(value) != count:
                raise ValueError(f"{name}: expected {count} values ({', '.join(self.LAYOUT.axes)}), got {len(value)}")
        for axis, low, high, offset in zip(self.LAYOUT.axes, self.lower, self.upper, self.offsets, strict=True):
            if not -2.0 * pi <= low < high <= 2.0 * pi or not abs(offset) <= 2.0 * pi:
                raise ValueError(f"{axis}: expected lower_rad below upper_rad, and all within one turn of 0")
        return self
