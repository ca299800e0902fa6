"""Where the tip is to go: towards fresh commands at a limited speed, and nowhere without."""

from typing import Final

from weberlink.geometry import rotation
from weberlink.geometry.rotation import Quaternion, product
from weberlink.geometry.vector import Vector
from weberlink.slave.robots.franka.messages import ArmCommand
from weberlink.slave.robots.franka.options import FrankaOptions
from weberlink.slave.safety import Follower, toward

LONGEST_STEP_S: Final = 0.005
"""By which the goal moves on in one cycle, however late it is."""
RAMP_S: Final = 1.0
"""Of the followers, whose share of the force is not used here."""
TURN_RAD_S: Final = 3.0
"""Largest speed of the commanded orientation."""


class Goal:
    """The place and orientation that the impedance draws the tip to.

    While commands are fresh, it follows them within the workspace: first at the speed of an approach, and without delay
    once it is there. When they stop, it stays at the tip: the arm brakes, and what it presses on is released.

    Args:
        options: with the speeds, the workspace, and the age beyond which a command is stale.
        tip: where the tip is [m].
        turned: orientation of the tool; commanded ones are relative to it.

    Attributes:
        position: of the tip [m].
        turned: orientation of the tool.
    """

    def __init__(self, options: FrankaOptions, tip: Vector, turned: Quaternion) -> None:
        self._options = options
        self._home = turned
        self._command: ArmCommand | None = None
        self._follows = False
        self.stop(tip, turned)

    def stop(self, tip: Vector, turned: Quaternion) -> None:
        """Stay at the tip; the next command is approached."""
        options = self._options
        self.position, self.turned = tip, turned
        self._place = Follower(tip, toward, speed=options.speed_m_s, approach_speed=options.approach_m_s, ramp=RAMP_S)
        self._turn = Follower(
            turned, rotation.toward, speed=TURN_RAD_S, approach_speed=options.approach_rad_s, ramp=RAMP_S
        )

    def take(self, command: ArmCommand) -> None:
        """Follow this command from now on, while it is fresh."""
        self._command = command

    def release(self) -> None:
        """Follow no command any more: the next step stops at the tip."""
        self._command = None
        self._follows = True

    def step(self, now: float, elapsed: float, tip: Vector, turned: Quaternion) -> None:
        """Move on.

        Args:
            now: [s].
            elapsed: since the last step [s].
            tip: where the tip is [m].
            turned: orientation of the tool.
        """
        command = self._command
        if command is None or now - command.at > self._options.stale_s:
            if self._follows:
                self.stop(tip, turned)
                self._follows = False
            return
        self._follows = True
        elapsed = min(elapsed, LONGEST_STEP_S)
        self.position = self._place.pursue(self._inside(command.position), elapsed)
        self.turned = self._turn.pursue(product(command.orientation, self._home), elapsed)

    def _inside(self, position: Vector) -> Vector:
        (a, b, c), (d, e, f) = self._options.workspace_m
        x, y, z = position
        return (min(max(x, a), d), min(max(y, b), e), min(max(z, c), f))
