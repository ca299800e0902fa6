"""Plant, control and sensing of a file put together, stepped as far as a tick asks. Knows no sessions."""

from collections.abc import Sequence
from math import ceil, sqrt
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.robots.contract import Quaternion, RobotFault
from weberlink.slave.robots.mjcf.impedance import Impedance
from weberlink.slave.robots.mjcf.options import MujocoOptions, RotationOptions
from weberlink.slave.robots.mjcf.plant import Plant
from weberlink.slave.robots.mjcf.posture import settle
from weberlink.slave.robots.mjcf.sensing import sensing

if TYPE_CHECKING:
    from weberlink.slave.robots.mjcf.pose_impedance import PoseImpedance
    from weberlink.slave.robots.mjcf.torque_sensing import TorqueSensing

STABLE_SHARE = 0.5
"""Of the longest stable step of the control. Its damper is explicit, so that at a ratio r an oscillation of w is stable
up to 2 (sqrt(1 + r^2) - r) / w."""
SUBSTEPS_MOST = 50
STRETCH = 0.25
"""A step may be longer than meant by this share, so that a tick that is a little late takes no step more."""


class Simulation:
    """Moves the end effector of a file.

    Attributes:
        axes: along which it can move.
        home: where it is until the first command [m].
        substeps: steps per tick.
    """

    def __init__(self, options: MujocoOptions, tick_period: float) -> None:
        """Load the file and bring the robot home.

        Raises:
            ValueError: one line that begins with the option that is wrong.
        """
        rotation = options.rotation
        plant = Plant(options.model, options.end_effector, options.keyframe, turns=rotation is not None)
        if options.home_m is not None:
            settle(plant, options.home_m)
        x, y, z = plant.position.tolist()
        self.axes = plant.axes
        self.home: Vector = (x, y, z)
        options.check_home(self.home)
        self._plant = plant
        self._options = options
        self._pose = None if rotation is None else _pose(plant, options, rotation)
        self._control = self._pose or Impedance(plant, options.stiffness_n_m, options.damping_ratio, options.posture_hz)
        self._sensing = sensing(plant, options.force)
        self._torque_sensing = None if rotation is None else _torque_sensing(plant, rotation.torque)
        self.substeps = self._substeps(float(plant.model.opt.timestep), tick_period)
        self._step = tick_period / self.substeps

    def reset(self) -> None:
        """Everything as it begins."""
        self._plant.reset()
        if self._pose is not None:
            self._pose.reset()

    def point(self, orientation: Quaternion) -> None:
        """The orientation to turn to, from that at home; only with `rotation`.

        Raises:
            ValueError: if it is none.
        """
        if self._pose is not None:
            self._pose.point(orientation)

    def advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        """Move on by `elapsed` [s] toward `commanded` [m].

        Returns:
            Where the end effector is [m], and the force [N] and the torque about it [N m] of its surroundings on it in
            the last step; no torque without `rotation`.

        Raises:
            RobotFault: if the motion can no longer be trusted; it stays so until `reset`.
        """
        plant, control = self._plant, self._control
        count = max(1, ceil(elapsed / self._step - STRETCH))
        step = elapsed / count
        try:
            with np.errstate(all="ignore"):  # what is no longer finite is seen below
                for number in range(count):
                    if number:
                        plant.refresh()
                    control.apply(commanded)
                    plant.advance(step)
                force = self._sensing.force()
                torque = ZERO if self._torque_sensing is None else self._torque_sensing.torque()
                plant.refresh()
        except mujoco.FatalError as error:
            raise RobotFault(f"mujoco: {' '.join(str(error).split())}") from None
        x, y, z = plant.position.tolist()
        complaint = plant.complaint()
        if complaint is not None:
            raise RobotFault(f"mujoco: the simulation cannot go on: {complaint}")
        if not (is_finite((x, y, z)) and is_finite(force) and is_finite(torque)):
            raise RobotFault(f"mujoco: the simulation is no longer finite after the command {commanded}")
        return (x, y, z), force, torque

    def description(self) -> str:
        """One line for a person: what is in the file, the steps, and the position control with its lag."""
        model = self._plant.model
        lags_ms = [1e3 * lag for lag in self._control.lags]
        steps = f"{self.substeps} steps" if self.substeps > 1 else "1 step"
        return (
            f"{self._plant.path.name}: bodies {model.nbody - 1}, dofs {model.nv}, {steps} of {1e3 * self._step:g} ms "
            f"per tick; {self._control.strength}, lags a ramp by {_span(lags_ms, '.1f')} ms"
        )

    def _substeps(self, timestep: float, tick_period: float) -> int:
        """As the file asks, or more where the control is too quick for that.

        Raises:
            ValueError: if even the most would not do.
        """
        ratio, control = self._options.damping_ratio, self._control
        radians = STABLE_SHARE * 2.0 * (sqrt(1.0 + ratio * ratio) - ratio)
        needed = control.fastest * tick_period / radians
        if needed > SUBSTEPS_MOST:
            raise ValueError(control.too_strong((needed / SUBSTEPS_MOST) ** 2))
        return max(ceil(tick_period / timestep - 1e-6), ceil(needed))


def _pose(plant: Plant, options: MujocoOptions, rotation: RotationOptions) -> "PoseImpedance":
    from weberlink.slave.robots.mjcf.pose_impedance import PoseImpedance  # noqa: PLC0415

    stiffnesses = (options.stiffness_n_m, rotation.stiffness_n_m_rad)
    return PoseImpedance(plant, stiffnesses, options.damping_ratio, options.posture_hz)


def _torque_sensing(plant: Plant, name: str) -> "TorqueSensing":
    from weberlink.slave.robots.mjcf.torque_sensing import torque_sensing  # noqa: PLC0415

    return torque_sensing(plant, name)


def _span(values: Sequence[float], form: str) -> str:
    """The least and the most of them, or one where they read alike."""
    least, most = (format(value, form) for value in (min(values), max(values)))
    return least if least == most else f"{least} to {most}"
