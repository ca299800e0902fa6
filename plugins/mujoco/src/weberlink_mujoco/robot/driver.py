"""The robot `mujoco`: an MJCF file under Cartesian position control. Imports MuJoCo only when a robot is built."""

import os
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING

from weberlink.geometry.rotation import Quaternion
from weberlink.geometry.vector import Vector, within
from weberlink.slave.robots.computed import LONGEST_GAP, ComputedRobot
from weberlink.slave.robots.contract import RobotSpec
from weberlink.slave.scenes.scene import Scene
from weberlink_mujoco.robot.options import MujocoOptions

if TYPE_CHECKING:
    from weberlink_mujoco.robot.pose import PoseWriter

POSE_S = 1.0 / 30.0  # time between two published poses [s]


class MujocoRobot(ComputedRobot):
    """The end effector follows commands with the compliance that `stiffness_n_m` sets."""

    Options = MujocoOptions

    def __init__(self, options: MujocoOptions, scene: Scene | None, tick_period: float) -> None:
        """Load the file; ValueError, in one line, for a wrong file, name or pose, and for a scene beside its own."""
        if scene is not None:
            raise ValueError("driver mujoco: touches what is in its MJCF file; leave slave.scene out")
        from weberlink_mujoco.robot.simulation import MjcfSimulation  # noqa: PLC0415 - MuJoCo takes its time

        self._simulation = MjcfSimulation(options, tick_period)
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
        self._shows = False
        self._pose: PoseWriter | None = None
        self._unshown = 0.0  # time since the last published pose [s]

    def publish_pose(self) -> None:
        self._shows = True

    def open(self, now: float) -> None:
        super().open(now)
        if self._shows:
            from weberlink_mujoco.robot.pose import PoseWriter, path_of  # noqa: PLC0415 - live sessions only

            with suppress(OSError):  # a session does not need to be seen
                self._pose = PoseWriter(path_of(os.getpid()), len(self._simulation.pose))

    def close(self) -> None:
        super().close()
        if self._pose is not None:
            self._pose.close()
            self._pose = None

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
        """Set the orientation to hold; no effect without the option `rotation`."""
        self._simulation.point(orientation)

    def description(self) -> str:
        """The file, the steps per tick, and the position control with its lag, in one line."""
        return self._simulation.description()

    def _reset(self) -> None:
        self._simulation.reset()

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        position, force, torque = self._simulation.advance(commanded, min(elapsed, LONGEST_GAP))
        if self._pose is not None:
            self._unshown += elapsed
            if self._unshown >= POSE_S:
                self._unshown = 0.0
                self._pose.write(monotonic(), self._simulation.pose)
        return position, within(force, self.spec.force_n), within(torque, self.spec.torque_n_m)
