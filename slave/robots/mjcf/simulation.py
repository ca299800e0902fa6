"""Plant, control and sensing of a file put together, stepped as far as a tick asks. Knows no sessions."""

from collections.abc import Sequence
from math import ceil, sqrt

import mujoco
import numpy as np

from codec.vector import Vector, is_finite
from slave.robots.contract import RobotFault
from slave.robots.mjcf.impedance import Impedance
from slave.robots.mjcf.options import MujocoOptions
from slave.robots.mjcf.plant import Plant
from slave.robots.mjcf.posture import settle
from slave.robots.mjcf.sensing import sensing

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
        plant = Plant(options.model, options.end_effector, options.keyframe)
        if options.home_m is not None:
            settle(plant, options.home_m)
        x, y, z = plant.position.tolist()
        self.axes = plant.axes
        self.home: Vector = (x, y, z)
        options.check_home(self.home)
        self._plant = plant
        self._options = options
        self._impedance = Impedance(plant, options.stiffness_n_m, options.damping_ratio, options.posture_hz)
        self._sensing = sensing(plant, options.force)
        self.substeps = self._substeps(float(plant.model.opt.timestep), tick_period)
        self._step = tick_period / self.substeps

    def reset(self) -> None:
        """Everything as it begins."""
        self._plant.reset()

    def advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector]:
        """Move on by `elapsed` [s] toward `commanded` [m].

        Returns:
            Where the end effector is [m], and the force of its surroundings on it in the last step [N].

        Raises:
            RobotFault: if the motion can no longer be trusted; it stays so until `reset`.
        """
        plant, impedance = self._plant, self._impedance
        count = max(1, ceil(elapsed / self._step - STRETCH))
        step = elapsed / count
        try:
            with np.errstate(all="ignore"):  # what is no longer finite is seen below
                for number in range(count):
                    if number:
                        plant.refresh()
                    impedance.apply(commanded)
                    plant.advance(step)
                force = self._sensing.force()
                plant.refresh()
        except mujoco.FatalError as error:
            raise RobotFault(f"mujoco: {' '.join(str(error).split())}") from None
        x, y, z = plant.position.tolist()
        complaint = plant.complaint()
        if complaint is not None:
            raise RobotFault(f"mujoco: the simulation cannot go on: {complaint}")
        if not (is_finite((x, y, z)) and is_finite(force)):
            raise RobotFault(f"mujoco: the simulation is no longer finite after the command {commanded}")
        return (x, y, z), force

    def description(self) -> str:
        """One line for a person: what is in the file, the steps, and the position control with its lag."""
        model, options = self._plant.model, self._options
        lags_ms = [
            2e3 * options.damping_ratio * sqrt(mass / options.stiffness_n_m) for mass in self._impedance.masses_kg
        ]
        steps = f"{self.substeps} steps" if self.substeps > 1 else "1 step"
        return (
            f"{self._plant.path.name}: bodies {model.nbody - 1}, dofs {model.nv}, {steps} of {1e3 * self._step:g} ms "
            f"per tick; {options.stiffness_n_m:g} N/m on {_span(self._impedance.masses_kg, '.2g')} kg, "
            f"lags a ramp by {_span(lags_ms, '.1f')} ms"
        )

    def _substeps(self, timestep: float, tick_period: float) -> int:
        """As the file asks, or more where the control is too quick for that.

        Raises:
            ValueError: if even the most would not do.
        """
        stiffness, ratio, mass = self._options.stiffness_n_m, self._options.damping_ratio, self._impedance.masses_kg[0]
        radians = STABLE_SHARE * 2.0 * (sqrt(1.0 + ratio * ratio) - ratio)
        needed = sqrt(stiffness / mass) * tick_period / radians
        if needed > SUBSTEPS_MOST:
            raise ValueError(
                f"stiffness_n_m: {stiffness:g} is too much for the {mass:.2g} kg of the end effector; "
                f"use at most {0.95 * stiffness * (SUBSTEPS_MOST / needed) ** 2:.2g}"
            )
        return max(ceil(tick_period / timestep - 1e-6), ceil(needed))


def _span(values: Sequence[float], form: str) -> str:
    """The least and the most of them, or one where they read alike."""
    least, most = (format(value, form) for value in (min(values), max(values)))
    return least if least == most else f"{least} to {most}"
