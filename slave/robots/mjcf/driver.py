"""The robot `mujoco`: an MJCF file under Cartesian position control. Imports MuJoCo only when a robot is built."""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, ClassVar

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.computed import LONGEST_GAP, ComputedRobot
from weberlink.slave.robots.contract import Quaternion, RobotSpec
from weberlink.slave.robots.mjcf.options import MujocoOptions
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.slave.robots.mjcf.simulation import MjcfSimulation


class MujocoRobot(ComputedRobot):
    """The end effector follows commands with the compliance that `stiffness_n_m` sets."""

    Options = MujocoOptions
    NEEDS: ClassVar[tuple[str, str]] = ("mujoco", "mujoco")
    """The package that it needs, and the extra of this project that brings it."""

    def __init__(self, options: MujocoOptions, scene: Scene | None, tick_period: float) -> None:
        """Load the file.

        Raises:
            ValueError: one line, for a wrong file, name or pose, for a scene beside that of the file, and where MuJoCo
                is not installed.
        """
        if scene is not None:
            raise ValueError("driver mujoco: touches what is in its MJCF file; leave slave.scene out")
        package, extra = self.NEEDS
        if find_spec(package) is None:
            raise ValueError(f'driver mujoco: needs {package}; install it with: pip install "weberlink[{extra}]"')
        module = import_module("weberlink.slave.robots.mjcf.simulation")
        self._simulation: MjcfSimulation = module.MjcfSimulation(options, tick_period)
        spec = RobotSpec(
            name="mujoco",
            axes=self._simulation.axes,
            force_n=options.force_n,
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=options.corners,
            rate_hz=1.0 / tick_period,
            force_sensing=True,
            torque_n_m=0.0 if options.rotation is None else options.rotation.torque_n_m,
        )
        super().__init__(spec, self._simulation.home)

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
        """Set the orientation to hold; no effect without the option `rotation`."""
        self._simulation.point(orientation)

    def description(self) -> str:
        """The file, the steps per tick, and the position control with its lag, in one line."""
        return self._simulation.description()

    def _reset(self) -> None:
        self._simulation.reset()

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        return self._simulation.advance(commanded, min(elapsed, LONGEST_GAP))
