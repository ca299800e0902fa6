"""The leader `arm_operator`: a scripted hand on the model of a leader arm, which yields to displayed torque."""

from bisect import bisect_right
from collections.abc import Sequence
from importlib import import_module
from itertools import accumulate
from math import inf, pi, sin
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink.master.devices.hand_device import minimum_jerk
from weberlink.options import Options
from weberlink_mujoco.arms.computed import ComputedArm, ModelOptions, PerAxis, home_of, motors, per_axis
from weberlink_mujoco.arms.models import ArmModel, load

Inertia = Annotated[float, Field(ge=0.0, le=1e3)]
Duration = Annotated[float, Field(gt=0.0, le=3600.0)]

WAY_BACK_S = 1.0


class JointLeg(NamedTuple):
    """A part of the motion: from `start` to `end` [rad] by minimum jerk in `duration` [s], and a swing on top.

    The swing is amplitude x sin(2 pi f t) sin^2(pi t / duration), at rest at both ends.
    """

    start: Joints
    end: Joints
    duration: float
    amplitude: Joints | None = None
    frequency: float = 0.0

    def at(self, time: float) -> Joints:
        """Angles [rad] at a time from its beginning [s], 0 to its duration."""
        share = time / self.duration
        s = minimum_jerk(share)
        moved = [a + s * (b - a) for a, b in zip(self.start, self.end, strict=True)]
        if self.amplitude is not None:
            swing = sin(2.0 * pi * self.frequency * time) * sin(pi * share) ** 2
            moved = [angle + swing * a for angle, a in zip(moved, self.amplitude, strict=True)]
        return tuple(moved)


class ArmStep(Options):
    """One motion of the script; it begins where the one before left the hand."""

    duration_s: Duration = 1.0

    def leg(self, start: Joints, gripper: bool) -> JointLeg:  # noqa: ARG002
        return JointLeg(start, start, self.duration_s)


class MoveStep(ArmStep):
    """To angles by minimum jerk; what is not given stays."""

    motion: Literal["move"]
    joints_rad: tuple[float, ...] | None = Field(default=None, description="of all joints, without the gripper")
    gripper_rad: float | None = Field(default=None, description="0 is closed")

    def leg(self, start: Joints, gripper: bool) -> JointLeg:
        joints, grip = (start[:-1], start[-1:]) if gripper else (start, ())
        if self.joints_rad is not None:
            if len(self.joints_rad) != len(joints):
                raise ValueError(f"joints_rad: expected {len(joints)} angles, got {len(self.joints_rad)}")
            joints = self.joints_rad
        if self.gripper_rad is not None:
            if not gripper:
                raise ValueError("gripper_rad: the model has no gripper")
            grip = (self.gripper_rad,)
        return JointLeg(start, (*joints, *grip), self.duration_s)


class SwingStep(ArmStep):
    """To and fro about where it is, as a sinusoid that begins and ends at rest."""

    motion: Literal["swing"]
    amplitude_rad: tuple[float, ...] = Field(description="of all axes, the gripper last")
    frequency_hz: float = Field(default=0.5, gt=0.0, le=10.0)

    def leg(self, start: Joints, gripper: bool) -> JointLeg:  # noqa: ARG002
        if len(self.amplitude_rad) != len(start):
            raise ValueError(f"amplitude_rad: expected {len(start)} angles, got {len(self.amplitude_rad)}")
        return JointLeg(start, start, self.duration_s, self.amplitude_rad, self.frequency_hz)


class HoldStep(ArmStep):
    """Stays where it is."""

    motion: Literal["hold"]


Step = Annotated[MoveStep | SwingStep | HoldStep, Field(discriminator="motion")]


class JointHand(Options):
    """Impedance of the hand at each axis, for all axes or for each.

    The defaults are an assumption of the order of a wrist (see `WristOptions`), not a measurement of a person on such
    an arm.
    """

    stiffness_nm_rad: PerAxis = Field(default=2.0, description="how hard it holds on to where it wants to be")
    damping_nm_s_rad: PerAxis = Field(default=0.15)
    inertia_kg_m2: Inertia | tuple[Inertia, ...] = Field(
        default=0.004, description="of the hand alone; that of the arm comes with its model"
    )


class ArmOperatorOptions(ModelOptions):
    """Options of `arm_operator`."""

    hand: JointHand = JointHand()
    script: tuple[Step, ...] = Field(
        default=(), description="what the hand means to do; if empty, it moves each axis in turn and works the gripper"
    )
    repeat: bool = Field(default=True, description="begin again at the end; otherwise the reading says `ended`")
    duration_s: Duration | None = Field(default=None, description="after which the reading says `ended`")


class ArmOperator(ComputedArm):
    """A hand that leads an arm through the script, and yields to the torques that the arm displays.

    At each axis the hand is a spring, a damper and an inertia; the arm adds its mass matrix, with the armature of its
    motors, and its friction. Gravity of the arm is compensated. Displayed torques are limited to those of the motors.
    The stiffest wall of the spec is that which stays passive for a hold of one tick, K < 2 b / T (Colgate and Schenkel,
    "Passivity of a class of sampled-data systems", ACC 1994), with the damping b of hand and arm.
    """

    SCRIPTED: ClassVar[bool] = True
    Options: ClassVar[type[ArmOperatorOptions]] = ArmOperatorOptions

    def __init__(self, options: ArmOperatorOptions, tick_period: float) -> None:
        """Load the model; ValueError, in one line, for a wrong file or option."""
        model = load(options.model)
        count, hand = model.axes, options.hand
        home = home_of(model, options.home_rad)
        damping = per_axis("hand.damping_nm_s_rad", hand.damping_nm_s_rad, count)
        self._most = motors(model, options.torque_nm)
        simulation = import_module("weberlink_mujoco.arms.simulation").ArmSimulation(
            model,
            stiffness=per_axis("hand.stiffness_nm_rad", hand.stiffness_nm_rad, count, least=1e-6),
            damping=damping,
            inertia=per_axis("hand.inertia_kg_m2", hand.inertia_kg_m2, count),
            limit=(inf,) * count,
            step=tick_period / options.steps,
        )
        spec = ArmSpec(
            name="arm_operator",
            joints=model.names,
            gripper=model.gripper,
            lower=model.lower,
            upper=model.upper,
            torque_nm=self._most,
            stiffness_nm_rad=tuple(2.0 * (d + b) / tick_period for d, b in zip(damping, model.damping, strict=True)),
            rate_hz=1.0 / tick_period,
            calibrated=True,
            watchdog_s=0.0,
        )
        super().__init__(spec, simulation, home)
        self._script = JointScript(legs_of(options.script or exercise(model, home), model, home), options.repeat)
        self._duration = inf if options.duration_s is None else options.duration_s
        self._none = self._displayed = (0.0,) * count
        self._time = 0.0

    def open(self, now: float) -> None:
        super().open(now)
        self._displayed = self._none
        self._time = 0.0

    def command(self, values: Joints, now: float) -> None:  # noqa: ARG002
        most = zip(self._finite(values, "torques"), self._most, strict=True)
        self._displayed = tuple([min(max(torque, -limit), limit) for torque, limit in most])

    def _advance(self, elapsed: float) -> tuple[Joints, bool]:
        self._time += self._simulation.advance(self._script.at(self._time), self._displayed, elapsed)
        return self._none, self._time >= min(self._duration, self._script.end)


class JointScript:
    """Legs one after another, once or for ever."""

    def __init__(self, legs: Sequence[JointLeg], repeat: bool) -> None:
        if repeat and legs[-1].end != legs[0].start:
            legs = [*legs, JointLeg(legs[-1].end, legs[0].start, WAY_BACK_S)]
        self._legs = legs
        self._ends = list(accumulate(leg.duration for leg in legs))
        self.end = inf if repeat else self._ends[-1]  # when it is over [s]; never if it repeats

    def at(self, time: float) -> Joints:
        """Intended angles [rad] at a time from the beginning [s]."""
        if time >= self.end:
            return self._legs[-1].end
        time %= self._ends[-1]
        index = min(bisect_right(self._ends, time), len(self._legs) - 1)
        leg = self._legs[index]
        return leg.at(min(max(time - self._ends[index] + leg.duration, 0.0), leg.duration))


def legs_of(script: Sequence[ArmStep], model: ArmModel, home: Joints) -> list[JointLeg]:
    """The script from home on; raises ValueError, naming the step, where it leaves the range of the model."""
    legs: list[JointLeg] = []
    start = home
    for number, step in enumerate(script):
        try:
            leg = step.leg(start, model.gripper)
        except ValueError as error:
            raise ValueError(f"script.{number}.{error}") from None
        for time in range(17):
            angles = leg.at(time / 16.0 * leg.duration)
            for label, angle, low, high in zip(model.labels, angles, model.lower, model.upper, strict=True):
                if not low - 1e-9 <= angle <= high + 1e-9:
                    raise ValueError(f"script.{number}: {label}: expected {low:.4g} to {high:.4g} rad, got {angle:.4g}")
        legs.append(leg)
        start = leg.end
    return legs


def exercise(model: ArmModel, home: Joints) -> list[ArmStep]:
    """Each joint to and fro, as far as it can up to 0.3 rad, and the gripper open and closed again."""
    steps: list[ArmStep] = []
    for axis in range(len(model.names)):
        room = min(0.3, home[axis] - model.lower[axis], model.upper[axis] - home[axis])
        amplitude = tuple(room if other == axis else 0.0 for other in range(model.axes))
        steps.append(SwingStep(motion="swing", amplitude_rad=amplitude, duration_s=4.0))
    if model.gripper:
        wide = model.lower[-1] + 0.5 * (model.upper[-1] - model.lower[-1])
        steps += [MoveStep(motion="move", gripper_rad=wide), MoveStep(motion="move", gripper_rad=home[-1])]
    return steps
