"""The position that the operator's end sends: where the robot presses with the force that the operator feels.

While a scheme displays less than the contact model states (a new model fades in, energy is withheld), a robot at the
operator's position would press harder than is felt. So the command is moved out of the contact, to where the model
states the displayed force. Source of the idea: force-matched commands of model-mediated teleoperation, Mitra, Niemeyer,
"Model-mediated telemanipulation", Int. J. Robotics Research 27(2), 2008.
"""

from math import hypot

from weberlink.control.contract import LEAST_CONTACT, WallModel
from weberlink.geometry.sliding import Sliding
from weberlink.geometry.vector import ZERO, Vector, subtract


def matched(position: Vector, stated: Vector, stiffness: float, displayed: Vector, way: Vector) -> Vector:
    """The position [m] at which a model states the displayed force.

    Args:
        position: of the device [m].
        stated: force of the model there [N].
        stiffness: of the model [N/m].
        displayed: force [N].
        way: direction in which the command leaves the contact: the stated force, or its part along the normal [N].
    """
    length = hypot(stated[0], stated[1], stated[2])
    if length < LEAST_CONTACT:
        return position
    along = (displayed[0] * stated[0] + displayed[1] * stated[1] + displayed[2] * stated[2]) / length
    lack = length - max(0.0, along)
    if lack <= 0.0:
        return position
    share = lack / (length * stiffness)
    return (position[0] + share * way[0], position[1] + share * way[1], position[2] + share * way[2])


class ForceMatching:
    """The newest contact model, and the command at which it states the displayed force.

    Args:
        coupling: stiffness of the robot towards its command [N/m], assumed where no surface is known.
    """

    __slots__ = ("_before", "_coupling", "_sliding", "_surface", "displayed")

    def __init__(self, coupling: float) -> None:
        self._coupling = coupling
        self._sliding = Sliding()
        self.reset()

    def reset(self) -> None:
        self._surface: WallModel | None = None
        self._sliding.reset()
        self._before: tuple[Vector, Vector] | None = None
        self.displayed: Vector = ZERO
        """The force that is displayed now [N]."""

    def learn(self, surface: WallModel | None) -> None:
        """Take in the contact surface of an update; None if it has none."""
        self._surface = surface
        self._before = None

    @property
    def stiffness(self) -> float:
        """Stiffness of the newest surface, or that of the coupling if there is none [N/m]."""
        return self._coupling if self._surface is None else self._surface.stiffness

    def command(self, position: Vector, tick: float) -> Vector:
        """The position [m] at which the surface states the displayed force, along its normal from `position`.

        Not along the force: friction tilts it, and the robot would lag behind the hand. Without a surface it is
        `position` itself: a held sample does not tell how the force depends on the position. Matched to it, the robot
        would yield to what is withheld, feel less, and yield more, down to no force.

        Args:
            position: of the device [m].
            tick: on the tick clock of the other side, at which the model is evaluated.
        """
        surface = self._surface
        if surface is None:
            return position
        force = surface.at(tick, position)
        before, self._before = self._before, (position, force)
        if before is not None:
            self._sliding.move(subtract(position, before[0]), subtract(force, before[1]), surface.stiffness)
        return matched(position, force, surface.stiffness, self.displayed, self._sliding.normal_part(force))
