"""The position that the operator's end sends: where the robot presses with the force that the operator feels.

While a scheme displays less than the contact model states (a new model fades in, energy is withheld), a robot at the
operator's position would press harder than is felt. So the command is moved out of the contact, to where the model
states the displayed force. Source of the idea: force-matched commands of model-mediated teleoperation, Mitra, Niemeyer,
"Model-mediated telemanipulation", Int. J. Robotics Research 27(2), 2008.
"""

from math import hypot

from weberlink.control.contract import LEAST_CONTACT, WallModel
from weberlink.geometry.vector import ZERO, Vector


class ForceMatching:
    """The newest contact model, and the command at which it states the displayed force.

    Args:
        coupling: stiffness of the robot towards its command [N/m], assumed where no surface is known.
    """

    __slots__ = ("_coupling", "_surface", "displayed")

    def __init__(self, coupling: float) -> None:
        self._coupling = coupling
        self.reset()

    def reset(self) -> None:
        self._surface: WallModel | None = None
        self.displayed: Vector = ZERO
        """The force that is displayed now [N]."""

    def learn(self, surface: WallModel | None) -> None:
        """Take in the contact surface of an update; None if it has none."""
        self._surface = surface

    @property
    def stiffness(self) -> float:
        """Stiffness of the newest surface, or that of the coupling if there is none [N/m]."""
        return self._coupling if self._surface is None else self._surface.stiffness

    def command(self, position: Vector, tick: float) -> Vector:
        """The position [m] at which the surface states the displayed force, on the line of its force there.

        Without a surface it is `position` itself: a held force does not tell how it changes with the position.

        Args:
            position: of the device [m].
            tick: the present time on the tick clock of the other side.
        """
        surface = self._surface
        if surface is None:
            return position
        force = surface.at(tick, position)
        length = hypot(force[0], force[1], force[2])
        if length < LEAST_CONTACT:
            return position
        shown = self.displayed
        along = (shown[0] * force[0] + shown[1] * force[1] + shown[2] * force[2]) / length
        lack = length - max(0.0, along)
        if lack <= 0.0:
            return position
        share = lack / (length * self.stiffness)
        return (position[0] + share * force[0], position[1] + share * force[1], position[2] + share * force[2])
