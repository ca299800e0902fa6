"""The models of Dynamixel motors in the arms: figures of their data sheets, torque and current, and own registers.

Stall torque, stall current and speed without load: ROBOTIS e-Manual, page of each motor, at the voltage given. The
torque constant is stall torque over stall current; it holds through the gears, so their friction is part of its error.

What the register of the current means differs. An XM430 measures the current of its motor, so torque = k I. An XL330
measures the current of its supply (e-Manual, XL330, "Current Limit"). At rest the supply gives U I = R i^2, with the
current i of the motor and its resistance R = U / I_stall, so i^2 = I I_stall and torque = k sqrt(I I_stall). On an
XL330-M288 held at stall, duty against current follows this law from 100 mA on (Rhoban/bam, issue 14); below that, and
on a motor that turns, nobody has published a measurement. An XL430 measures no current but a "load", an estimate from
its duty in per mille of the largest one.
"""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from enum import StrEnum
from functools import cached_property
from math import copysign, pi, sqrt
from typing import Final, NamedTuple

from weberlink.geometry.joints import Joints
from weberlink_arms.dynamixel.registers import (
    A_PER_COUNT,
    MODE_CURRENT,
    MODE_CURRENT_BASED_POSITION,
    MODE_EXTENDED_POSITION,
    MODE_POSITION,
    POSITION_P_GAIN,
    REGISTERS,
    Register,
)
from weberlink_arms.servo.layout import RAD_PER_COUNT

RPM: Final = 2.0 * pi / 60.0  # [rad/s]
FULL_DUTY: Final = 885  # PWM register of the full supply voltage
FULL_RATE_RAD_S: Final = 0.05  # speed from which on dry friction has its full value
LOAD_FULL: Final = 1000.0  # load register of the largest torque
XL330_TEETH: Final = 77.5 / 288.4  # gear ratio of an XL330-M077 over that of an XL330-M288, which has the same motor


class CurrentLaw(StrEnum):
    """What the register of the current measures."""

    MOTOR = "motor"
    SUPPLY = "supply"
    LOAD = "load"


@dataclass(frozen=True, eq=False)
class MotorModel:
    """A model."""

    number: int  # model number (register 0)
    name: str  # as the vendor calls it
    _: KW_ONLY
    volts: float  # of the figures below [V]
    stall_n_m: float
    stall_a: float
    no_load_rad_s: float  # speed without load
    law: CurrentLaw  # what its current register measures
    a_per_count: float  # unit of the current registers [A]; 0 if there are none
    constant_error: float  # largest relative error of the torque constant, from all published figures
    coulomb_n_m: float  # dry friction of gears and motor
    viscous_n_m_s: float
    rotor_kg_m2: float  # inertia of the rotor, seen behind the gears
    p_divisor: float = 128.0  # of the position gain: duty = gain / p_divisor * error [counts] / 885
    # Registers whose initial value and range are not those of an XM430-W350.
    differs: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)
    lacks: frozenset[str] = frozenset()  # names of registers that it does not have

    @property
    def constant(self) -> float:
        """Torque constant [N m/A]."""
        return self.stall_n_m / self.stall_a

    @property
    def controls_current(self) -> bool:
        return self.law is not CurrentLaw.LOAD

    @property
    def modes(self) -> tuple[int, ...]:
        """Operating modes used here."""
        positions = (MODE_POSITION, MODE_EXTENDED_POSITION)
        return (MODE_CURRENT, *positions, MODE_CURRENT_BASED_POSITION) if self.controls_current else positions

    def duty_per_rad(self, gain: int) -> float:
        """Duty per error of angle [1/rad] at this position gain."""
        return gain / self.p_divisor / FULL_DUTY / RAD_PER_COUNT

    def stiffness(self, gain: int | None) -> float:
        """Of position control with this gain, None for that as delivered [N m/rad]."""
        if gain is None:
            gain = next(each.initial for each in self.registers if each.name == POSITION_P_GAIN.name)
        return self.duty_per_rad(gain) * self.stall_n_m

    @cached_property
    def registers(self) -> tuple[Register, ...]:
        """Its control table."""
        own = {**self.differs, "model_number": (self.number, 0, 65_535)}
        found = [each for each in REGISTERS if each.name not in self.lacks]
        return tuple(Register(*each[:4], *own.get(each.name, each[4:])) for each in found)

    def motor_current(self, counts: int, law: CurrentLaw) -> float:
        """Current of the motor [A] at rest, from the register of the current or load."""
        if law is CurrentLaw.LOAD:
            return counts / LOAD_FULL * self.stall_a
        amperes = counts * self.a_per_count
        return copysign(sqrt(abs(amperes) * self.stall_a), amperes) if law is CurrentLaw.SUPPLY else amperes

    def register_current(self, amperes: float, law: CurrentLaw) -> int:
        """The inverse of `motor_current` [counts]."""
        if law is CurrentLaw.LOAD:
            return round(amperes / self.stall_a * LOAD_FULL)
        shown = copysign(amperes * amperes / self.stall_a, amperes) if law is CurrentLaw.SUPPLY else amperes
        return round(shown / self.a_per_count)

    def torque(self, counts: int, law: CurrentLaw) -> float:
        """Torque [N m] at rest, from the register of the current or load."""
        return self.constant * self.motor_current(counts, law)

    def counts(self, torque: float, law: CurrentLaw) -> int:
        """Register of the current for a torque [N m]."""
        return self.register_current(torque / self.constant, law)


class JointFriction(NamedTuple):
    """Coulomb [N m] and viscous friction [N m s] of all joints."""

    coulomb: Joints
    viscous: Joints

    def torque(self, joint: int, rate: float) -> float:
        """Opposing torque of a joint at this rate [N m]; at rest the Coulomb part is unknown, and taken as 0."""
        share = min(max(rate / FULL_RATE_RAD_S, -1.0), 1.0)
        return self.coulomb[joint] * share + self.viscous[joint] * rate


_SMALL: Final[dict[str, tuple[int, int, int]]] = {
    "temperature_limit": (70, 0, 100),
    "max_voltage_limit": (70, 31, 70),
    "min_voltage_limit": (35, 31, 70),
    "current_limit": (1750, 0, 1750),
    "baud_rate": (1, 0, 6),
    "shutdown": (53, 0, 255),
    "position_p_gain": (400, 0, 16_383),
    "present_input_voltage": (50, 0, 65_535),
}

XM430_W350: Final = MotorModel(
    1020,
    "XM430-W350",
    volts=12.0,
    stall_n_m=4.1,
    stall_a=2.3,
    no_load_rad_s=46.0 * RPM,
    law=CurrentLaw.MOTOR,
    a_per_count=A_PER_COUNT,
    constant_error=0.4,  # 1.65 to 2.48 N m/A, see docs/devices/dynamixel.md
    coulomb_n_m=0.132,  # the largest of four joints, see weberlink_arms.cartesian.arm
    viscous_n_m_s=0.037,
    rotor_kg_m2=0.045,
)
XL430_W250: Final = MotorModel(
    1060,
    "XL430-W250",
    volts=12.0,
    stall_n_m=1.5,
    stall_a=1.4,
    no_load_rad_s=61.0 * RPM,
    law=CurrentLaw.LOAD,
    a_per_count=0.0,
    constant_error=0.5,  # no published measurement; the vendor calls the load unfit for weight or torque
    coulomb_n_m=0.1,  # a guess between those of the other two
    viscous_n_m_s=0.02,
    rotor_kg_m2=0.01,
    differs={
        "temperature_limit": (72, 0, 100),
        "max_voltage_limit": (140, 60, 140),
        "min_voltage_limit": (60, 60, 140),
        "drive_mode": (0, 0, 13),
        "velocity_limit": (265, 0, 1023),
        "velocity_i_gain": (1000, 0, 16_383),
        "position_d_gain": (4000, 0, 16_383),
        "position_p_gain": (640, 0, 16_383),
    },
    lacks=frozenset({"current_limit", "goal_current", "acceleration_limit"}),
)
XL330_M288: Final = MotorModel(
    1200,
    "XL330-M288",
    volts=5.0,
    stall_n_m=0.52,
    stall_a=1.47,
    no_load_rad_s=103.0 * RPM,
    law=CurrentLaw.SUPPLY,
    a_per_count=1e-3,
    constant_error=0.31,  # 0.354 by stall, 0.370 and 0.381 fitted (Rhoban/bam), 0.463 by the speed without load
    coulomb_n_m=0.018,  # with the two below, fitted: Rhoban/bam, bam/params/xl330/m1.json
    viscous_n_m_s=0.006,
    rotor_kg_m2=0.0020,
    p_divisor=256.0,  # the manual says 128; measured: Rhoban/bam, bam/dynamixel/actuator.py
    differs={
        **_SMALL,
        "velocity_limit": (445, 0, 2047),
        "velocity_i_gain": (1600, 0, 16_383),
        "velocity_p_gain": (180, 0, 16_383),
    },
    lacks=frozenset({"acceleration_limit"}),
)
XL330_M077: Final = MotorModel(
    1190,
    "XL330-M077",
    volts=5.0,
    stall_n_m=0.215,
    stall_a=1.47,
    no_load_rad_s=383.0 * RPM,
    law=CurrentLaw.SUPPLY,
    a_per_count=1e-3,
    constant_error=0.32,  # 0.146 by stall, 0.125 by the speed without load, 0.099 scaled from the fit of an M288
    coulomb_n_m=0.018 * XL330_TEETH,  # with the two below, scaled from those of an XL330-M288 by its gears
    viscous_n_m_s=0.006 * XL330_TEETH**2,
    rotor_kg_m2=0.0020 * XL330_TEETH**2,
    p_divisor=256.0,
    differs={
        **_SMALL,
        "velocity_limit": (1620, 0, 2047),
        "velocity_i_gain": (400, 0, 16_383),
        "velocity_p_gain": (40, 0, 16_383),
        "position_i_gain": (400, 0, 16_383),
    },
    lacks=frozenset({"acceleration_limit"}),
)
MODELS: Final = {model.number: model for model in (XM430_W350, XL430_W250, XL330_M288, XL330_M077)}
