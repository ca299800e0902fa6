"""Options that all arms on a bus of Dynamixel motors share, checked against what the motors allow."""

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink_arms.dynamixel.bus import MotorBus, latency_advice
from weberlink_arms.dynamixel.motor_models import LOAD_FULL, CurrentLaw
from weberlink_arms.dynamixel.packet import HIGHEST_ID
from weberlink_arms.dynamixel.registers import BAUD_RATES, WATCHDOG_UNIT_S, watchdog_units
from weberlink_arms.servo.options import BusOptions, ServoOptions


class MotorBusOptions(BusOptions):
    """Options of a bus of Dynamixel motors."""

    BUS = MotorBus
    BAUD_RATES = BAUD_RATES
    HIGHEST_ID = HIGHEST_ID
    SLOWEST_HZ: ClassVar[float] = 50.0

    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]; motors are delivered with 57600")
    rate_hz: float = Field(default=250.0, ge=50.0, le=1000.0, description="of the bus")
    bus_watchdog_ms: float = Field(
        default=80.0, ge=20.0, le=2540.0, description="time without any instruction after which the motors stop"
    )

    @property
    def watchdog_s(self) -> float:
        return 1e-3 * self.bus_watchdog_ms

    @property
    def lets_go_s(self) -> float:
        """The watchdog's time as the motors have it [s]."""
        return WATCHDOG_UNIT_S * watchdog_units(self.watchdog_s)

    def note(self, *parts: str) -> str:
        """What a person should know before a run, with an advice for a slow adapter."""
        advice = latency_advice(self.port) if self.port is not None else None
        return "; ".join(parts if advice is None else [*parts, advice])

    @model_validator(mode="after")
    def check_watchdog(self) -> Self:
        if self.bus_watchdog_ms < 2.0 * self.timeout_ms:
            raise ValueError(f"bus_watchdog_ms: expected at least twice timeout_ms, {2.0 * self.timeout_ms:g}")
        return self


class DynamixelArmOptions(MotorBusOptions, ServoOptions):
    """Options of an arm on a bus of Dynamixel motors. Lists have one entry for each axis, the gripper last."""

    LISTS = (*ServoOptions.LISTS, "torque_ratio")

    max_current_ma: float
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
    def laws(self) -> tuple[CurrentLaw, ...]:
        """What each motor's current register means."""
        chosen = None if self.current_law is None else CurrentLaw(self.current_law)
        return tuple(each.law if chosen is None or not each.controls_current else chosen for each in self.LAYOUT.motors)

    @property
    def most(self) -> Joints:
        """Largest torques displayed or measured [N m]."""
        amperes = 1e-3 * self.max_current_ma
        return tuple(
            ratio * model.torque(round(amperes / model.a_per_count if model.controls_current else LOAD_FULL), law)
            for ratio, model, law in zip(self.ratios, self.LAYOUT.motors, self.laws, strict=True)
        )

    @model_validator(mode="after")
    def check_ratios(self) -> Self:
        if not all(0.1 <= ratio <= 10.0 for ratio in self.ratios):
            raise ValueError(f"torque_ratio: expected values from 0.1 to 10, got {self.torque_ratio}")
        return self
