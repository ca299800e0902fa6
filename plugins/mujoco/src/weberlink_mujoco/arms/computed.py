"""An arm that is computed: its life from `open` to `close`, and the options that leaders and followers share."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from weberlink.arms.contract import ArmFault, ArmReading, ArmSpec
from weberlink.geometry.joints import Joints, is_finite
from weberlink.options import Options
from weberlink_mujoco.arms.models import ArmModel, ModelName

if TYPE_CHECKING:
    from weberlink_mujoco.arms.simulation import ArmSimulation

_Torque = Annotated[float, Field(ge=0.0, le=1e9)]
PerAxis = float | tuple[float, ...]  # one value for all axes, or one for each


class ModelOptions(Options):
    """Options of a computed arm. Angles are in the frame of its model, the gripper last."""

    model: ModelName | Path = Field(
        description="name of a model that is installed, or an MJCF file with hinges that have names and "
        "ranges, `gripper` last if there is one, and a site `tip`; a relative path starts at the folder of this file"
    )
    home_rad: tuple[float, ...] | None = Field(
        default=None, description="angles of all axes at first; if not given, 0 or the nearest angle within the range"
    )
    torque_nm: _Torque | tuple[_Torque, ...] | None = Field(
        default=None,
        description="largest torque of the motors, for all axes or for each; that of the model if not given",
    )
    steps: int = Field(default=2, ge=1, le=50, description="of the simulation in each tick")


class ComputedArm:
    """An arm that moves on at each reading, up to that time, from `home` [rad]. A subclass gives `_advance`."""

    COMPUTED: ClassVar[bool] = True

    def __init__(self, spec: ArmSpec, simulation: "ArmSimulation", home: Joints) -> None:
        self.spec, self._simulation, self._home = spec, simulation, home
        self._reading: ArmReading | None = None

    def open(self, now: float) -> None:
        self._simulation.reset(self._home)
        self._reading = ArmReading(now, self._simulation.angles, (0.0,) * self.spec.axes)

    def latest(self, now: float) -> ArmReading:
        reading = self._reading
        if reading is None:
            raise ArmFault(f"{self.spec.name}: not open")
        if now <= reading.at:
            return reading
        torques, ended = self._advance(now - reading.at)
        self._reading = ArmReading(now, self._simulation.angles, torques, ended)
        return self._reading

    def close(self) -> None:
        self._reading = None

    def _advance(self, elapsed: float) -> tuple[Joints, bool]:
        """Move on; torques of the environment [N m], and whether a script is over."""
        raise NotImplementedError

    def _finite(self, values: Joints, label: str) -> Joints:
        """The values; raises ValueError if one is not finite, or if there are too many or too few."""
        if len(values) != self.spec.axes or not is_finite(values):
            raise ValueError(f"{self.spec.name}: expected {self.spec.axes} finite {label}, got {values}")
        return values


MOST = 1e9  # largest value of an option for each axis, in its unit


def per_axis(option: str, value: PerAxis, count: int, *, least: float = 0.0) -> Joints:
    """One value for each axis; raises ValueError, naming the option, for a wrong number of them or a wrong one."""
    values = value if isinstance(value, tuple) else (value,) * count
    if len(values) != count:
        raise ValueError(f"{option}: expected one value, or one for each of {count} axes; got {len(values)}")
    for each in values:
        if not least <= each <= MOST:
            raise ValueError(f"{option}: expected {least:g} to {MOST:g}, got {each:g}")
    return values


def home_of(model: ArmModel, home: tuple[float, ...] | None) -> Joints:
    """Angles at first [rad]; raises ValueError where they are outside the range of the model."""
    if home is None:
        return tuple(min(max(0.0, low), high) for low, high in zip(model.lower, model.upper, strict=True))
    if len(home) != model.axes:
        raise ValueError(f"home_rad: expected {model.axes} angles, got {len(home)}")
    for label, angle, low, high in zip(model.labels, home, model.lower, model.upper, strict=True):
        if not low <= angle <= high:
            raise ValueError(f"home_rad: {label}: expected {low:.4g} to {high:.4g} rad, got {angle:g}")
    return home


def motors(model: ArmModel, torque: PerAxis | None) -> Joints:
    """Largest torques [N m]; raises ValueError where neither the option nor the file has one."""
    if torque is not None:
        return per_axis("torque_nm", torque, model.axes)
    if float("inf") in model.torque:
        raise ValueError(
            f"torque_nm: the model {model.path.name} has no actuatorfrcrange at each joint; give the option"
        )
    return model.torque
