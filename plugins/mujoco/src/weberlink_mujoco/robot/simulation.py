"""Plant, position control and sensing of an MJCF file, stepped once per tick."""

from math import ceil, sqrt

import mujoco
import numpy as np

from weberlink.geometry.rotation import Quaternion
from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.robots.contract import RobotFault
from weberlink_mujoco.arms.models import Array
from weberlink_mujoco.robot.impedance import Impedance
from weberlink_mujoco.robot.options import MujocoOptions
from weberlink_mujoco.robot.plant import Plant, settle
from weberlink_mujoco.robot.sensing import force_sensing, torque_sensing

STABLE_SHARE = 0.5
"""Of the longest stable step of the control. Its damper is explicit, so that at a ratio r an oscillation of w is stable
up to 2 (sqrt(1 + r^2) - r) / w."""
SUBSTEPS_MOST = 50
STRETCH = 0.25  # share by which a step may be longer, so that a tick that is a little late takes no additional step


class MjcfSimulation:
    """Moves the end effector of a file; ValueError, in one line that begins with the option that is wrong."""

    def __init__(self, options: MujocoOptions, tick_period: float) -> None:
        rotation = options.rotation
        plant = Plant(options.model, options.end_effector, options.keyframe, turns=rotation is not None)
        if options.home_m is not None:
            settle(plant, options.home_m)
        x, y, z = plant.position.tolist()
        self.axes = plant.axes  # along which it can move
        self.home: Vector = (x, y, z)  # until the first command [m]
        options.check_home(self.home)
        self._plant = plant
        self._options = options
        stiffnesses = [options.stiffness_n_m, *([] if rotation is None else [rotation.stiffness_n_m_rad])]
        self._control = Impedance(plant, stiffnesses, options.damping_ratio, options.posture_hz)
        self._torque_sensing = None if rotation is None else torque_sensing(plant, rotation.torque)
        self._force_sensing = force_sensing(plant, options.force)
        self.substeps = self._substeps(float(plant.model.opt.timestep), tick_period)
        self._step = tick_period / self.substeps

    @property
    def pose(self) -> Array:
        """Positions of all joints, as MuJoCo has them; changes with each step."""
        pose: Array = self._plant.data.qpos
        return pose

    def reset(self) -> None:
        """Return to the initial state."""
        self._plant.reset()
        self._control.reset()

    def point(self, orientation: Quaternion) -> None:
        """Set the orientation to hold, from that at home; no effect without `rotation`. See `Impedance.point`."""
        self._control.point(orientation)

    def advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        """Move on by `elapsed` [s] toward `commanded` [m]; gives the position of the end effector [m], and force [N]
        and torque about it [N m] of its surroundings in the last step. RobotFault if the motion can no longer be
        trusted.
        """
        plant, control = self._plant, self._control
        count = max(1, ceil(elapsed / self._step - STRETCH))
        step = elapsed / count
        try:
            with np.errstate(all="ignore"):  # checked below
                for number in range(count):
                    if number:
                        plant.refresh()
                    control.apply(commanded)
                    plant.advance(step)
                force = self._force_sensing.force()
                torque = ZERO if self._torque_sensing is None else self._torque_sensing.torque()
                plant.refresh()
        except mujoco.FatalError as error:
            raise RobotFault(f"mujoco: {' '.join(str(error).split())}") from None
        x, y, z = plant.position.tolist()
        warning = plant.warning()
        if warning is not None:
            raise RobotFault(f"mujoco: the simulation cannot go on: {warning}")
        if not (is_finite((x, y, z)) and is_finite(force) and is_finite(torque)):
            raise RobotFault(f"mujoco: the simulation is no longer finite after the command {commanded}")
        return (x, y, z), force, torque

    def description(self) -> str:
        model, lags_ms = self._plant.model, [1e3 * lag for lag in self._control.lags]
        least, most = (format(lag, ".1f") for lag in (min(lags_ms), max(lags_ms)))
        steps = f"{self.substeps} steps" if self.substeps > 1 else "1 step"
        return (
            f"{self._plant.path.name}: bodies {model.nbody - 1}, dofs {model.nv}, {steps} of {1e3 * self._step:g} ms "
            f"per tick; {self._control.strength}, lags a ramp by {least if least == most else f'{least} to {most}'} ms"
        )

    def _substeps(self, timestep: float, tick_period: float) -> int:
        """As the file asks, or more where the control needs it; ValueError if it needs more than the most."""
        ratio, control = self._options.damping_ratio, self._control
        radians = STABLE_SHARE * 2.0 * (sqrt(1.0 + ratio * ratio) - ratio)
        needed = control.fastest * tick_period / radians
        if needed > SUBSTEPS_MOST:
            raise ValueError(control.too_strong((needed / SUBSTEPS_MOST) ** 2))
        return max(ceil(tick_period / timestep - 1e-6), ceil(needed))
