"""Where the tip is to go: towards fresh commands at a limited speed, and nowhere without."""

from typing import Any, Final

from weberlink.geometry import rotation
from weberlink.geometry.rotation import Quaternion, product
from weberlink.geometry.vector import Vector
from weberlink.slave.guard import Approach
from weberlink_franka.messages import ArmCommand
from weberlink_franka.options import FrankaOptions

LONGEST_STEP_S: Final = 0.005  # by which the goal moves on in one cycle, however late it is
REST_RAD_S: Final = 0.02  # the arm is at rest when no joint is faster
TURN_RAD_S: Final = 3.0  # largest speed of the commanded orientation


class Goal:
    """The place and orientation that the impedance draws the tip to.

    While commands are fresh, it follows them within the workspace: first at the speed of an approach, and without delay
    once it is there. When they stop, it goes along with the tip until that is at rest, and stays there: the damper
    brakes the arm without a spring that would draw it back, and what it presses on is released.

    `position` is that of the tip [m], `turned` the orientation of the tool; commanded ones are relative to the first.
    """

    def __init__(self, options: FrankaOptions, tip: Vector, turned: Quaternion) -> None:
        self._options = options
        self._home = turned
        self._command: ArmCommand | None = None
        self._brakes = False
        self._place_at(tip, turned)

    def _place_at(self, tip: Vector, turned: Quaternion) -> None:
        options = self._options
        self.position, self.turned = tip, turned
        self._place = Approach(tip, 3, options.speed_m_s, options.approach_m_s)
        self._turn = Approach(turned, 4, TURN_RAD_S, options.approach_rad_s, rotation.toward)

    def take(self, command: ArmCommand) -> None:
        """Follow this command from now on, while it is fresh."""
        self._command = command

    def stop(self) -> None:
        """Bring the arm to rest, whatever is commanded; the next new command is approached."""
        self._command = None
        self._brakes = True

    def step(self, now: float, elapsed: float, tip: Vector, turned: Quaternion, joint_speed: float) -> None:
        """Move on by `elapsed` [s]; tip [m] and tool are where they are, the fastest joint moves at `joint_speed`."""
        command = self._command
        if command is not None and now - command.at > self._options.stale_s:
            self.stop()
        if self._brakes:
            self._place_at(tip, turned)
            self._brakes = joint_speed > REST_RAD_S
        if self._command is None or self._brakes:
            return
        elapsed = min(elapsed, LONGEST_STEP_S)
        place: Any = self._place.advance(self._inside(self._command.position), elapsed)
        turned_to: Any = self._turn.advance(product(self._command.orientation, self._home), elapsed)
        self.position, self.turned = place, turned_to

    def _inside(self, position: Vector) -> Vector:
        (a, b, c), (d, e, f) = self._options.workspace_m
        x, y, z = position
        return (min(max(x, a), d), min(max(y, b), e), min(max(z, c), f))
