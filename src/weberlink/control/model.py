"""A mixture of received contact models that are faded into one another without creating energy.

Every model is an elastic surface, which may have friction and may move. A new surface that would press harder than the
energy allows is displayed recessed: at a greater depth, with its own stiffness. It rises as energy becomes available.

A mixture with fixed weights is passive: in the frame of each surface, the force is that of a spring to an
anchor, the foot of the hand or the god-object of friction, and the anchor slides towards the hand only, which takes
energy. A change of the mixture creates or takes energy, and the amount is known before the change. A surface that moves
does work on the hand; `follow` returns it. Only the newest surface moves: what it replaces stays where it is, fades out
and is dropped, whatever energy there is.
"""

from math import hypot, inf, sqrt
from typing import Any, ClassVar

from weberlink.control.contract import WallModel
from weberlink.control.force_port import STEEPEST
from weberlink.geometry.vector import ZERO, Vector

TURN = 0.05
"""Time in which a new model replaces the old one, if energy allows it [s]."""
MOST_SURFACES = 6
"""Largest number of surfaces in a mixture; beyond it, a new one waits until another has faded out."""
LEAST_WEIGHT = 0.01
"""A surface with a smaller weight is dropped."""
RISE_SPEED = 0.03
"""Largest speed at which a recessed surface rises [m/s]. It lifts the hand, which takes energy: a faster one loses more
of it in the damping of the hand, and stays recessed in the end."""
SPENT_AT_ONCE = 0.1
"""Largest energy that a rising surface may take in a tick, as a share of the spare energy."""


class SpringWall:
    """The elastic flat wall through a sample of a contact.

    Args:
        position: commanded position of the sample [m].
        force: its force [N], not zero; the wall faces its direction.
        stiffness: of the wall [N/m].
    """

    __slots__ = ("_normal", "_offset", "stiffness")

    memory: ClassVar[None] = None

    def __init__(self, position: Vector, force: Vector, stiffness: float) -> None:
        length = hypot(force[0], force[1], force[2])
        a, b, c = self._normal = (force[0] / length, force[1] / length, force[2] / length)
        self._offset = position[0] * a + position[1] * b + position[2] * c + length / stiffness
        self.stiffness = stiffness

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        a, b, c = self._normal
        push = self.stiffness * (self._offset - position[0] * a - position[1] * b - position[2] * c)
        return (push * a, push * b, push * c) if push > 0.0 else ZERO

    def advance(self, tick: float, position: Vector, memory: Any) -> tuple[Vector, Any]:
        return self.at(tick, position), memory

    def displacement(self, tick: float) -> Vector:  # noqa: ARG002
        return ZERO


class RecessedSurface:
    """A surface in the mixture, with its weight (0 to 1) and its recess: the additional depth [m], >= 0.

    Attributes:
        force: that the surface states at the hand, without recess and weight [N].
        pressed: size of the force with the recess, without the weight [N].
    """

    __slots__ = (
        "_length",
        "_moved",
        "_moves",
        "_tick",
        "_yields",
        "force",
        "memory",
        "pressed",
        "recess",
        "surface",
        "weight",
    )

    def __init__(self, surface: WallModel, memory: Any, tick: float) -> None:
        self.surface = surface
        self.memory = memory
        self.weight = self.recess = self.pressed = self._length = 0.0
        self.force: Vector = ZERO
        self._moved = surface.displacement(tick)
        self._tick = tick
        self._moves = True
        self._yields = False

    @property
    def stored(self) -> float:
        """Stored energy, without the weight [J]."""
        return 0.5 * self.pressed * self.pressed / self.surface.stiffness

    def stay(self) -> None:
        """Move no more: its motion was fitted to samples that a newer one has replaced."""
        self._moves = False

    def give_way(self) -> None:
        """Press no harder from now on: a hand that sinks into a surface that fades out must not hold it up."""
        self._moves, self._yields = False, True

    def follow(self, tick: float, position: Vector) -> float:
        """Go on to this tick and position of the hand [m]; returns the work of its motion without the weight [J]."""
        if self._moves:
            self._tick = tick
        else:
            tick = self._tick
        surface, before = self.surface, self._moved
        moved = surface.displacement(tick)
        work = 0.0
        if moved != before:
            self._moved = moved
            force = self.force
            x, y, z = moved[0] - before[0], moved[1] - before[1], moved[2] - before[2]
            if self.pressed > 0.0:
                work = self.pressed / self._length * (force[0] * x + force[1] * y + force[2] * z)
        if self.memory is None:
            force = surface.at(tick, position)
        else:
            force, self.memory = surface.advance(tick, position, self.memory)
        self.force = force
        self._length = hypot(force[0], force[1], force[2])
        pressed = self.pressed
        self.sink_to(self.recess)
        if self._yields and self.pressed > pressed:
            self.press_no_harder_than(pressed)
        return work

    def sink_to(self, recess: float) -> None:
        self.recess = recess
        self.pressed = max(0.0, self._length - recess * self.surface.stiffness)

    def press_no_harder_than(self, most: float) -> None:
        """Take the least recess with which it presses with at most this force [N]."""
        self.sink_to(max(0.0, self._length - most) / self.surface.stiffness)

    def weighted(self, weight: float) -> Vector:
        """A share of the force with the recess [N]."""
        if self.pressed == 0.0:
            return ZERO
        share, force = weight * self.pressed / self._length, self.force
        return (share * force[0], share * force[1], share * force[2])

    def come_up(self, elapsed: float, spare: float) -> None:
        """Reduce the recess: up to the hand at once, and against the hand as fast as the spare energy [J] allows."""
        if self.recess == 0.0:
            return
        stiffness = self.surface.stiffness
        recess = min(self.recess, self._length / stiffness)  # free up to the hand
        pressed = self._length / stiffness - recess
        affordable = SPENT_AT_ONCE * max(0.0, spare)
        rise = sqrt(pressed * pressed + 2.0 * affordable / stiffness) - pressed
        self.sink_to(max(0.0, recess - min(rise, RISE_SPEED * elapsed)))


class SurfaceMixture:
    """Weighted surfaces: the newest is the wanted one and fades in, the others fade out.

    Args:
        most: largest force that is displayed [N]; in a change to free space, what is above it goes at once.
    """

    __slots__ = ("_most", "_parts", "_position", "_tick", "_waiting", "_wanted")

    def __init__(self, most: float = inf) -> None:
        self._most = most
        self.reset()

    def reset(self) -> None:
        self._parts: list[RecessedSurface] = []
        self._wanted: RecessedSurface | None = None
        self._waiting: RecessedSurface | None = None
        self._tick = 0.0
        self._position: Vector = ZERO

    @property
    def newest(self) -> RecessedSurface | None:
        """The surface that the mixture changes to, or will; None for free space."""
        return self._wanted if self._waiting is None else self._waiting

    @property
    def force(self) -> Vector:
        """Force on the hand [N]."""
        x = y = z = 0.0
        for part in self._parts:
            a, b, c = part.weighted(part.weight)
            x, y, z = x + a, y + b, z + c
        return (x, y, z)

    @property
    def stored(self) -> float:
        """Stored energy [J]."""
        stored = 0.0
        for part in self._parts:
            stored += part.weight * part.stored
        return stored

    def follow(self, tick: float, position: Vector) -> float:
        """Go on to a tick and a position of the hand.

        Args:
            tick: at which surfaces that move are evaluated.
            position: of the hand [m].

        Returns:
            Work of the motion of the surfaces on the hand since the last call, by the force before it [J].
        """
        self._tick, self._position = tick, position
        work = 0.0
        for part in self._parts:
            work += part.weight * part.follow(tick, position)
        if self._waiting is not None:
            self._waiting.follow(tick, position)
        return work

    def want(self, surface: WallModel | None) -> None:
        """Begin to change to this surface, recessed so that it presses no harder on the hand than the mixture does.

        A surface with friction keeps the god-object that the hand has dragged along the surface before it.

        Args:
            surface: the new surface; None for free space.
        """
        newest = self.newest
        self._waiting = None
        if newest is not None:
            newest.stay()
        if self._wanted is not None:
            self._wanted.stay()
        if surface is None:
            self._wanted = None
            for part in self._parts:
                part.give_way()
            return
        memory = surface.memory
        if memory is not None and newest is not None and newest.memory is not None:
            memory = newest.memory
        self._waiting = RecessedSurface(surface, memory, self._tick)
        self._waiting.follow(self._tick, self._position)

    def _let_in(self, most: float) -> None:
        """Begin to change to the surface that waits.

        It takes the place of the wanted surface, with its weight and its force, if that changes the force on the hand
        by no more than `most` [N]: so updates of the same surface do not begin the change anew. Otherwise it fades in
        as soon as there is room for it.
        """
        waiting, wanted = self._waiting, self._wanted
        if waiting is None:
            return
        if wanted is not None:
            stiffer = waiting.surface.stiffness / wanted.surface.stiffness
            waiting.press_no_harder_than(wanted.pressed * min(1.0, sqrt(stiffer)))
            a, b, c = wanted.weighted(wanted.weight)
            x, y, z = waiting.weighted(wanted.weight)
            if hypot(x - a, y - b, z - c) <= most:
                waiting.weight = wanted.weight
                self._parts[self._parts.index(wanted)] = self._wanted = waiting
                self._waiting = None
                return
        if len(self._parts) >= MOST_SURFACES:
            self._parts = [part for part in self._parts if part.pressed > 0.0]
        if len(self._parts) < MOST_SURFACES:
            waiting.press_no_harder_than(hypot(*self.force))
            self._wanted, self._waiting = waiting, None
            self._parts.append(waiting)

    def turn(self, elapsed: float, spare: float) -> None:
        """Move weight to the wanted surface, and let it rise.

        The force on the hand turns, rises and drops by this at no more than `STEEPEST`. As far as that allows it, every
        surface that is not wanted shrinks at least by the factor e in `TURN`, whatever the energy.

        Args:
            elapsed: time since the last call [s].
            spare: energy that the change may put into the model [J].
        """
        share, most = min(1.0, elapsed / TURN), STEEPEST * elapsed
        self._let_in(most)
        wanted = self._wanted
        if wanted is None:
            length, weight = hypot(*self.force), sum(part.weight for part in self._parts)
            if length > self._most:
                self._fade(self._parts, self._most / length)
                length, weight = self._most, weight * self._most / length
            lost = min(1.0, share / weight) if weight > 0.0 else 1.0
            self._fade(self._parts, 1.0 - (min(lost, most / length) if length > 0.0 else lost))
            return
        moved = min(share, 1.0 - wanted.weight)
        if moved > 0.0:
            spare -= self._move(wanted, moved, share, most, spare)
        wanted.come_up(elapsed, spare)

    def _move(self, wanted: RecessedSurface, moved: float, fading: float, most: float, spare: float) -> float:
        """Move this weight to the wanted surface, or as much as energy and slew allow; returns the energy cost [J].

        The other surfaces lose weight so that the sum stays at most 1, and at least the share `fading` of what they
        have: a surface that is not wanted never stays. They lose more, up to the weight that moves, if the energy that
        this frees is needed.
        """
        spare = max(0.0, spare)
        others = [part for part in self._parts if part is not wanted]
        of_others = freed = x = y = z = 0.0
        for part in others:
            weight = part.weight
            a, b, c = part.weighted(weight)
            of_others, freed = of_others + weight, freed + weight * part.stored
            x, y, z = x + a, y + b, z + c
        if of_others > 0.0:
            freed /= of_others
        price = moved * wanted.stored
        lost = max(0.0, wanted.weight + of_others + moved - 1.0)
        if price - lost * freed > spare and freed > 0.0:
            lost = max(lost, min(moved, of_others, (price - spare) / freed))
        price -= lost * freed
        share = spare / price if price > spare else 1.0
        a, b, c = wanted.weighted(moved)
        left = lost / of_others if of_others > 0.0 else 0.0
        change = hypot(a - left * x, b - left * y, c - left * z)
        if change * share > most:
            share = most / change
        if of_others > 0.0:
            lacking, length = fading - share * left, hypot(x, y, z)
            if lacking * length > most - share * change:
                lacking = (most - share * change) / length
            self._fade(others, max(0.0, 1.0 - share * left - max(0.0, lacking)))
        wanted.weight += share * moved
        return share * price

    def _fade(self, parts: list[RecessedSurface], share: float) -> None:
        """Multiply the weights of these surfaces by a share; drop a surface whose weight falls below `LEAST_WEIGHT`."""
        for part in parts:
            part.weight *= share
        self._parts = [part for part in self._parts if part.weight >= LEAST_WEIGHT or part is self._wanted]
