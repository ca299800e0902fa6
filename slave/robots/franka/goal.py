"""Where the tip is to go: towards fresh commands at a limited speed, and nowhere without."""

from weberlink.geometry import rotation
from weberlink.geometry.rotation import Quaternion, product
from weberlink.geometry.vector import Vector
from weberlink.slave.robots.franka.messages import ArmCommand
from weberlink.slave.robots.franka.options import FrankaOptions
from weberlink.slave.safety import Follower, toward

LONGEST_STEP_S = 0.005
"""By which the goal moves on in one cycle, however late it is."""
RAMP_S = 1.0
"""Of the follower; what it shares is not used here."""
TURN_RAD_S = 3.0
"""Largest speed of the commanded orientation."""


class Goal:
    """The place and orientation that the impedance draws the tip to.

    While commands are fresh, it follows them within the workspace: first at the speed of an approach, and without delay
    once it is there. When they stop, it stays at the tip: the arm brakes, and what it presses on is released.

    Args:
        options: with the speeds, the workspace, and the age beyond which a command is stale.
        tip: where the tip is [m].
        orientation: of the tool; commanded ones are relative to it.
    """

    def __init__(self, options: FrankaOptions, tip: Vector, orientation: Quaternion) -> None:
        self._options = options
        self._home = orientation
        self._command: ArmCommand | None = None
        self._follows = False
        self.stop(tip, orientation)

    def stop(self, tip: Vector, orientation: Quaternion) -> None:
        """Stay at the tip; commands are approached anew."""
        options = self._options
        self.position, self.orientation = tip, orientation
        self._place = Follower(tip, toward, speed=options.speed_m_s, approach_speed=options.approach_m_s, ramp=RAMP_S)
        self._turn = Follower(
            orientation, rotation.toward, speed=TURN_RAD_S, approach_speed=options.approach_rad_s, ramp=RAMP_S
        )

    def take(self, command: ArmCommand) -> None:
        """Follow this command from now on."""
        self._command = command

    def step(self, now: float, elapsed: float, tip: Vector, orientation: Quaternion) -> None:
        """Move on.

        Args:
            now: [s].
            elapsed: since the last step [s].
            tip: where the tip is [m].
            orientation: of the tool.
        """
        command = self._command
        if command is None or not now - command.at <= self._options.stale_s:
            if self._follows:
                self.stop(tip, orientation)
                self._follows = False
            return
        self._follows = True
        elapsed = min(elapsed, LONGEST_STEP_S)
        self.position = self._place.pursue(self._inside(command.position), elapsed)
        self.orientation = self._turn.pursue(product(command.orientation, self._home), elapsed)

    def _inside(self, position: Vector) -> Vector:
        (a, b, c), (d, e, f) = self._options.workspace_m
        x, y, z = position
        return (min(max(x, a), d), min(max(y, b), e), min(max(z, c), f))
