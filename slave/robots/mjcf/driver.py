"""Any robot that an MJCF file describes, in the world of that file, under Cartesian position control.

Imports MuJoCo where a robot is built, and not before: its options are part of every schema.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, ClassVar

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.robots.contract import Quaternion, RobotFault, RobotReading, RobotSpec
from weberlink.slave.robots.mjcf.options import MujocoOptions
from weberlink.slave.robots.virtual import saturated
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.slave.robots.mjcf.simulation import Simulation

LONGEST_GAP = 0.1  # [s] of model time per call; a longer silence is not made up for


class MujocoRobot:
    """The end effector of the file goes where it is commanded, as compliantly as `stiffness_n_m` says.

    The command is held from one reading to the next. A reading has the position that the model came to, and the force
    of the last step of the way there.
    """

    Options = MujocoOptions
    NEEDS: ClassVar[tuple[str, str]] = ("mujoco", "mujoco")
    """The package that it needs, and the extra of this project that brings it."""

    def __init__(self, options: MujocoOptions, scene: Scene | None, tick_period: float) -> None:
        """Load the file.

        Raises:
            ValueError: one line, for a file, a name or a pose that is wrong, for a scene beside that of the file, and
                where MuJoCo is not installed.
        """
        if scene is not None:
            raise ValueError("driver mujoco: touches what is in its MJCF file; leave slave.scene out")
        self._simulation: Simulation = _simulation(options, tick_period)
        self.spec = RobotSpec(
            name="mujoco",
            axes=self._simulation.axes,
            force_n=options.force_n,
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=options.corners,
            rate_hz=1.0 / tick_period,
            force_sensing=True,
            torque_n_m=0.0 if options.rotation is None else options.rotation.torque_n_m,
        )
        self._commanded = self._simulation.home
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        self._simulation.reset()
        self._commanded = self._simulation.home
        self._reading = RobotReading(now, self._commanded, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        if not is_finite(position):
            raise ValueError(f"mujoco: commanded a position that is not finite: {position}")
        self._commanded = position

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
        """Without `rotation` the end effector is not turned, as the spec says."""
        self._simulation.point(orientation)

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault("mujoco: not open")
        if now <= reading.at:
            return reading
        elapsed = min(now - reading.at, LONGEST_GAP)
        position, force, torque = self._simulation.advance(self._commanded, elapsed)
        self._reading = RobotReading(
            now, position, saturated(force, self.spec.force_n), saturated(torque, self.spec.torque_n_m)
        )
        return self._reading

    def close(self) -> None:
        self._reading = None

    def description(self) -> str:
        """One line for a person: what is in the file, the steps, and the position control with its lag."""
        return self._simulation.description()


def _simulation(options: MujocoOptions, tick_period: float) -> "Simulation":
    package, extra = MujocoRobot.NEEDS
    if find_spec(package) is None:
        raise ValueError(f'driver mujoco: needs {package}; install it with: pip install "weberlink[{extra}]"')
    made: Simulation = import_module("weberlink.slave.robots.mjcf.simulation").Simulation(options, tick_period)
    return made
