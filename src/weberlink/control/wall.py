"""What is known of the contact, as the force at the hand: the decoded surface, or else a wall.

The wall is the last contact, with a stiffness that is fitted to what was received. It is anchored in every tick to the
newest that is known of the robot: its force, by the decoder, and its position, which is the command of a round trip
ago. Without delay this is the decoded force itself. A robot that goes into the wall and feels nothing removes it.
"""

from math import inf

from weberlink.control.contract import LEAST_CONTACT, SchemeParameters, WallModel
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale, subtract

TURN = 0.1
"""Share by which an update turns the normal of the wall: friction tilts the force to both sides in turn."""
FORGET = 0.99
"""Share of the fit of the stiffness that a further value leaves."""
LEAST_WAY = 1e-4
"""Way on which a pair of samples has its full weight in that fit [m]: no single pair outweighs a lasting model."""
SOFTEST = 50.0
"""Softest wall [N/m]."""
SAME = 2.0
"""Largest ratio of the stiffness of a decoded surface and that of the wall at which the surface is displayed."""
WRONG = 1e-3
"""Distance by which the place of a sample may differ from that of the command, and a wall from what the robot found
[m]."""


class FeltContact:
    """The contact at the hand.

    Attributes:
        stiffness: of the contact, or that of the robot's coupling if none is known [N/m].
        softest: that of the decoded surface, as long as no sample has shown the stiffness [N/m]; otherwise infinite.
        normal: of the wall; None without one.
    """

    __slots__ = (
        "_apart",
        "_coupling",
        "_found",
        "_measured",
        "_model",
        "_offset",
        "_place",
        "_products",
        "_sample",
        "_sampled",
        "_squares",
        "_surface",
        "normal",
        "softest",
        "stiffness",
    )

    def __init__(self, settings: SchemeParameters) -> None:
        self._coupling = settings.coupling
        self.reset()

    def reset(self) -> None:
        """Forget the contact and its stiffness."""
        self._squares = self._products = 0.0
        self.stiffness, self.softest = self._coupling, inf
        self.forget()

    def forget(self) -> None:
        """Forget where the contact was."""
        self._sample: tuple[Vector, Vector] | None = None
        self._surface: WallModel | None = None
        self._model: WallModel | None = None
        self.normal: Vector | None = None
        self._offset = self._found = self._measured = 0.0
        self._apart = False
        self._sampled: Vector = ZERO
        self._place: float | None = None

    def depth(self, position: Vector) -> float:
        """How deep a position is in the wall of the newest sample [m]; 0 outside, and without one.

        Not in the wall of now: a held force carries that along with a robot that yields.
        """
        return 0.0 if self.normal is None else max(0.0, self._measured - dot(self.normal, position))

    def refute(self) -> None:
        """Let go of the wall."""
        self.normal = None

    def learn(self, surface: WallModel | None, force: Vector, position: Vector, robot: Vector) -> None:
        """Take in an update.

        Args:
            surface: the contact model that it carries; None if it carries none.
            force: force of its newest sample [N].
            position: command at which that was measured [m].
            robot: the command to which the newest news answers [m].
        """
        size = norm(force)
        last, self._sample = self._sample, None if size < LEAST_CONTACT else (force, position)
        self._model, self._sampled, self._place = surface, force, None
        if size >= 2.0 * LEAST_CONTACT:
            n, old = scale(force, 1.0 / size), self.normal
            if old is not None and dot(old, n) > 0.8:
                n = (old[0] + TURN * (n[0] - old[0]), old[1] + TURN * (n[1] - old[1]), old[2] + TURN * (n[2] - old[2]))
                n = scale(n, 1.0 / norm(n))
            self.normal = n
            if last is not None:
                way = subtract(position, last[1])
                along = dot(n, way)
                if along * along > 0.5 * dot(way, way):  # pressed rather than slid
                    self._fit(along, dot(n, subtract(last[0], force)))
            self._apart = abs(dot(n, subtract(position, robot))) > WRONG
            self._offset = self._found = self._measured = dot(n, position) + dot(n, force) / self.stiffness
        if surface is not None and self._squares == 0.0:  # a surface that is right brings no sample to fit
            self.softest = max(SOFTEST, surface.stiffness)
        fits = surface is not None and self.stiffness < SAME * surface.stiffness < SAME * SAME * self.stiffness
        self._surface = surface if fits else None

    def _fit(self, way: float, fall: float) -> None:
        """Take in that over a way out of the wall [m] the force fell by so much [N]."""
        share = min(1.0, LEAST_WAY / abs(way)) if way else 0.0
        self._squares = FORGET * self._squares + share * share * way * way
        self._products = FORGET * self._products + share * share * way * fall
        if self._squares > 0.1 * LEAST_WAY * LEAST_WAY:
            self.stiffness = min(self._coupling, max(SOFTEST, self._products / self._squares))
            self.softest = inf

    def at(self, hand: Vector, force: Vector, robot: Vector, tick: float) -> Vector:
        """The force of the contact at the hand [N].

        Args:
            hand: position of the hand [m].
            force: decoded there [N].
            robot: the command to which the newest news answers [m].
            tick: present tick of the other side.
        """
        n, model = self.normal, self._model
        if n is None:
            return force
        there = force if model is None else model.at(tick, robot)
        along, place = dot(n, there), dot(n, robot)
        if norm(there) >= LEAST_CONTACT:
            if model is not None and self._place is not None:
                way = place - self._place
                self._fit(way, way * model.stiffness)
            self._place = place
            if there != self._sampled or not self._apart:
                self._offset = self._found = place + along / self.stiffness
        else:
            self._place = None
            if place < self._found - WRONG:
                self.normal = None  # the robot is in this wall and feels none
                return force
            self._offset = min(self._offset, place)
        touches = norm(force) >= LEAST_CONTACT
        if touches and self._surface is not None:
            return force
        push = self.stiffness * (self._offset - dot(n, hand))
        if push <= 0.0:
            return ZERO
        if not touches:
            return scale(n, push)
        share = min(1.0, push / along) if along > 0.0 else 0.0  # of what friction adds
        push -= share * along
        return (share * force[0] + push * n[0], share * force[1] + push * n[1], share * force[2] + push * n[2])
