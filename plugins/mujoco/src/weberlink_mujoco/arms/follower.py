"""The follower `mujoco_arm`: an arm under position control of its joints, computed by MuJoCo, and what it may touch."""

from importlib import import_module
from math import exp, pi
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import Vector
from weberlink.options import Options
from weberlink_mujoco.arms.computed import ComputedArm, ModelOptions, PerAxis, home_of, motors, per_axis
from weberlink_mujoco.arms.models import load

Length = Annotated[float, Field(gt=0.0, le=10.0)]


class ArmObject(Options):
    """Something to touch, in the frame of the model; z is up."""

    position_m: Vector = Field(description="of its centre; of a table, a point on its surface")
    time_constant_s: float = Field(
        default=0.01,
        ge=1e-5,
        le=1.0,
        description="in which a contact, critically damped, pushes out what is in it (`solref` of MuJoCo): shorter is "
        "harder, down to two steps of the simulation",
    )
    friction: float = Field(default=0.5, ge=0.0, le=10.0, description="coefficient of sliding friction")

    def shape(self, package: Any) -> tuple[Any, list[float]]:
        """Kind of the geom, and its size as MuJoCo has it."""
        raise NotImplementedError

    def add(self, spec: Any, package: Any) -> None:
        """Into an `MjSpec`."""
        self._add_geom(spec.worldbody, package, self.position_m)

    def _add_geom(self, body: Any, package: Any, position: Vector, mass: float = 0.0) -> None:
        kind, size = self.shape(package)
        solref = [self.time_constant_s, 1.0]
        sliding = [self.friction, 0.005, 0.0001]
        body.add_geom(
            type=kind, size=size, pos=list(position), mass=mass, solref=solref, friction=sliding,
            contype=1, conaffinity=1, condim=4, priority=1,
        )  # fmt: skip


class Table(ArmObject):
    """A surface without end."""

    kind: Literal["table"]

    def shape(self, package: Any) -> tuple[Any, list[float]]:
        return package.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0]


class Solid(ArmObject):
    """A body that is fixed, or lies about if it has a mass."""

    mass_kg: float | None = Field(default=None, ge=1e-3, le=100.0, description="it is fixed if not given")

    def add(self, spec: Any, package: Any) -> None:
        if self.mass_kg is None:
            super().add(spec, package)
            return
        body = spec.worldbody.add_body(pos=list(self.position_m))
        body.add_freejoint()
        self._add_geom(body, package, (0.0, 0.0, 0.0), self.mass_kg)


class Box(Solid):
    """A box with edges along x, y, z."""

    kind: Literal["box"]
    size_m: tuple[Length, Length, Length] = Field(description="lengths of the edges")

    def shape(self, package: Any) -> tuple[Any, list[float]]:
        return package.mjtGeom.mjGEOM_BOX, [edge / 2.0 for edge in self.size_m]


class Ball(Solid):
    """A ball."""

    kind: Literal["ball"]
    radius_m: Length

    def shape(self, package: Any) -> tuple[Any, list[float]]:
        return package.mjtGeom.mjGEOM_SPHERE, [self.radius_m, 0.0, 0.0]


class MujocoArmOptions(ModelOptions):
    """Options of `mujoco_arm`."""

    stiffness_nm_rad: PerAxis = Field(default=30.0, description="of the position control, for all axes or for each")
    damping_ratio: float = Field(
        default=0.7, ge=0.0, le=10.0, description="of each axis alone, at home; friction of the model counts"
    )
    sensing_hz: float = Field(
        default=50.0, ge=0.1, le=1e6, description="bandwidth of the torque sensing, a low-pass filter of first order"
    )
    objects: tuple[Annotated[Table | Box | Ball, Field(discriminator="kind")], ...] = Field(
        default=(), max_length=20, description="to touch, beside those of the file"
    )


class MujocoArm(ComputedArm):
    """Goes to the commanded angles by springs and dampers at its joints, whose torques are limited.

    Its torques are those of contacts and end stops, limited to the torques of the motors: of the mean since the last
    reading, through a low-pass filter as that of motors which measure their current. (A contact of MuJoCo that slides
    pushes in some steps and not in others.) Gravity of the arm is compensated.
    """

    Options: ClassVar[type[MujocoArmOptions]] = MujocoArmOptions

    def __init__(self, options: MujocoArmOptions, tick_period: float) -> None:
        """Load the model; ValueError, in one line, for a wrong file or option."""
        model = load(options.model)
        count = model.axes
        stiffness = per_axis("stiffness_nm_rad", options.stiffness_nm_rad, count, least=1e-6)
        self._limit = motors(model, options.torque_nm)
        home = home_of(model, options.home_rad)
        module = import_module("weberlink_mujoco.arms.simulation")
        simulation = module.ArmSimulation(
            model,
            stiffness=stiffness,
            damping=module.critical(model, home, stiffness, options.damping_ratio),
            inertia=(0.0,) * count,
            limit=self._limit,
            step=tick_period / options.steps,
            objects=options.objects,
        )
        spec = ArmSpec(
            name="mujoco_arm",
            joints=model.names,
            gripper=model.gripper,
            lower=model.lower,
            upper=model.upper,
            torque_nm=self._limit,
            stiffness_nm_rad=stiffness,
            rate_hz=1.0 / tick_period,
            calibrated=True,
            watchdog_s=0.0,
        )
        super().__init__(spec, simulation, home)
        self._goals = home
        self._none = self._felt = (0.0,) * count
        self._omega = 2.0 * pi * options.sensing_hz

    def open(self, now: float) -> None:
        super().open(now)
        self._goals, self._felt = self._home, self._none

    def command(self, values: Joints, now: float) -> None:  # noqa: ARG002
        self._goals = self._finite(values, "angles")

    def _advance(self, elapsed: float) -> tuple[Joints, bool]:
        self._simulation.advance(self._goals, self._none, elapsed)
        share = 1.0 - exp(-self._omega * elapsed)
        inputs = zip(self._felt, self._simulation.torque, self._limit, strict=True)
        self._felt = tuple([old + share * (min(max(torque, -most), most) - old) for old, torque, most in inputs])
        return self._felt, False
