"""The exact solution of linear contact, from event to event; elsewhere that of the tangent planes."""

from collections.abc import Sequence

from weberlink.geometry.vector import ZERO, Vector, add
from weberlink.slave.integrators.contact_force import contact_force
from weberlink.slave.integrators.contract import ControlledMass, MassState
from weberlink.slave.integrators.linear_contact import Drag, LinearContact, Oscillators
from weberlink.slave.scenes.contact import Touch
from weberlink.slave.scenes.scene import Scene


class Exact:
    """Exact but for rounding, at any step, where every object is flat and without friction.

    Between events the motion is linear and has a closed form (`weberlink.slave.integrators.oscillation`), in
    independent coordinates even where contacts meet at an angle; events are located to rounding
    (`weberlink.slave.integrators.linear_contact`).

    Elsewhere each step uses the tangent planes at the proxy of its middle, found by half a step with those at its
    start, and a friction force that is constant (sliding) or linear (sticking) about that middle. On a smooth surface
    that is of order 2, as the midpoint rule; it resolves no curvature within a step, and a change between sticking and
    sliding, or an edge, costs one step's error. Where several contacts have friction at once, only the direction along
    all of them is held stiffly. Nothing bounds the energy of tangents: on curved shapes above 1e5 N/m, lighter than
    0.1 kg and without damping, a few percent of random trials gained energy, where the implicit scheme lost it.
    """

    __slots__ = ("_linear", "_oscillators", "_scene")

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._oscillators = Oscillators(body)
        self._scene = scene
        self._linear: LinearContact | None = None
        if scene.flat and not scene.rubs:
            self._linear = LinearContact(self._oscillators, scene.facing(ZERO), ZERO)

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        position, velocity, _ = motion
        scene = self._scene
        if self._linear is not None:
            position, velocity = self._linear.flow(position, velocity, goal, step)
        else:
            position, velocity = self._midpoint(scene, position, velocity, goal, step)
        return MassState(position, velocity, contact_force(scene.touch(position), velocity))

    def _midpoint(
        self, scene: Scene, position: Vector, velocity: Vector, goal: Vector, step: float
    ) -> tuple[Vector, Vector]:
        state = scene.state
        here = scene.touch(position)
        tangents = self._tangents(scene, position)
        middle, _ = tangents.flow(position, velocity, goal, 0.5 * step, drag_of(here, position))
        there = scene.touch(middle)
        tangents = self._tangents(scene, middle)
        scene.restore(state)
        return tangents.flow(position, velocity, goal, step, drag_of(there, middle))

    def _tangents(self, scene: Scene, position: Vector) -> LinearContact:
        """The tangent planes of the scene at the proxy."""
        proxy = scene.proxy or position
        return LinearContact(self._oscillators, scene.facing(proxy), proxy)


def drag_of(touches: Sequence[Touch], position: Vector) -> Drag | None:
    """Friction of all `touches` about `position`; None where there is none."""
    force, grip = ZERO, 0.0
    for touch in touches:
        force, grip = add(force, touch.drag), grip + touch.grip
    return None if grip == 0.0 and force == ZERO else Drag(position, force, grip)
