"""The exact solution of linear contact, from event to event; elsewhere that of the tangent planes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from weberlink.geometry.vector import ZERO, Vector, add
from weberlink.slave.integrators.contact_force import contact_force, staged
from weberlink.slave.integrators.contract import ControlledMass, MassState, Stage
from weberlink.slave.integrators.guard import EnergyGuard
from weberlink.slave.integrators.linear_contact import Drag, LinearContact, Oscillators
from weberlink.slave.integrators.stick_slip import Hold, StickSlip
from weberlink.slave.scenes.contact import Touch
from weberlink.slave.scenes.scene import NOTHING, Scene, SceneState

if TYPE_CHECKING:  # what a flat scene without friction does not import
    from weberlink.slave.integrators.implicit import Implicit

HELD = frozenset({0})
RELEASED = ((0.0, None, False),)


class Exact:
    """Exact but for rounding, at any step, where contact has a closed form (`Scene.closed_form`).

    That is where every object is flat and none has friction (`weberlink.slave.integrators.linear_contact`), and on one
    flat object with friction and without damping (`weberlink.slave.integrators.stick_slip`). Between events the motion
    is linear and has a closed form (`weberlink.slave.integrators.oscillation`); events are located to rounding.

    Elsewhere each step uses the tangent planes at the proxy of its middle, found by half a step with those at its
    start, and a friction force that is constant (sliding) or linear (sticking) about that middle. On a smooth surface
    that is of order 2, as the midpoint rule; it resolves no curvature within a step, and a change between sticking and
    sliding, or an edge, costs one step's error. Where several contacts have friction at once, only the direction along
    all of them is held stiffly. Tangents bound no energy, so a step that gains some is braked if the gain is small, and
    taken by the implicit scheme if it is not: no step gains energy.
    """

    __slots__ = ("_body", "_end", "_guard", "_implicit", "_linear", "_oscillators", "_rough", "_scene")

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._oscillators = Oscillators(body)
        self._scene = scene
        self._guard = EnergyGuard(body, scene)
        self._body = body
        self._implicit: Implicit | None = None
        self._end: Stage | None = None
        self._linear: LinearContact | None = None
        self._rough: StickSlip | None = None
        if scene.closed_form:
            planes = scene.facing(ZERO)
            cone = scene.objects[0].friction if scene.rubs else None
            if cone is None:
                self._linear = LinearContact(self._oscillators, planes, ZERO)
            else:
                self._rough = StickSlip(self._oscillators, planes[0], ZERO, cone)
        if self._linear is None:
            self._implicit_scheme()

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        scene, linear, start = self._scene, self._linear, self._end
        if linear is not None:  # nothing to guard: it is the solution
            moved = linear.flow(motion.position, motion.velocity, goal, step)
            if moved is not None:
                position, velocity = moved
                return MassState(position, velocity, contact_force(scene.touch(position), velocity))
        if start is None or start.motion != motion:
            start = staged(scene, motion.position, motion.velocity)
        state, kept = scene.state, None
        if self._rough is not None:
            kept = self._rubbed(self._rough, start, state, goal, step)
        elif linear is None:
            kept = self._midpoint(start, state, goal, step)
        if kept is None:
            scene.restore(state)
            kept = self._implicit_scheme().stepped(start, goal, step)
        self._end = kept
        return kept.motion

    def _implicit_scheme(self) -> "Implicit":
        """The implicit scheme; in flat contact without friction, only a step of very many events needs it."""
        if self._implicit is None:
            from weberlink.slave.integrators.implicit import Implicit  # noqa: PLC0415

            self._implicit = Implicit(self._body, self._scene)
        return self._implicit

    def _rubbed(self, rough: StickSlip, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage | None:
        """The step in closed form on the rough plane, whose anchor the scene remembers; None if it cannot be taken.

        The scene gets the state that a touch would give it.
        """
        _, anchor, sliding = state.contacts[0]
        hold = None if anchor is None else Hold(anchor, sliding)
        after = rough.flow(start.motion.position, start.motion.velocity, goal, step, hold)
        if after is None:
            return None
        position, velocity, depth, hold, slides, straight = after
        if hold is None:
            self._scene.restore(SceneState(position, NOTHING, RELEASED, 0.0))
            end = Stage(MassState(position, velocity, ZERO), (), 0.0)
        else:
            proxy, touch = rough.touch(position, depth, hold, slides)
            self._scene.restore(SceneState(proxy, HELD, ((0.0, hold.anchor, hold.sliding),), depth))
            end = Stage(MassState(position, velocity, contact_force((touch,), velocity)), (touch,), depth)
        return end if straight else self._guard.kept(start, end, goal)

    def _midpoint(self, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage | None:
        """The step with the tangent planes of its middle."""
        scene, (position, velocity, _) = self._scene, start.motion
        tangents = self._tangents(position)
        half = tangents.flow(position, velocity, goal, 0.5 * step, drag_of(start.touches, position))
        if half is None:
            return None
        middle, _ = half
        there = scene.touch(middle)
        tangents = self._tangents(middle)
        scene.restore(state)
        end = tangents.flow(position, velocity, goal, step, drag_of(there, middle))
        return None if end is None else self._guard.kept(start, staged(scene, *end), goal)

    def _tangents(self, position: Vector) -> LinearContact:
        """The tangent planes of the scene at the proxy."""
        proxy = self._scene.proxy or position
        return LinearContact(self._oscillators, self._scene.facing(proxy), proxy)


def drag_of(touches: Sequence[Touch], position: Vector) -> Drag | None:
    """Friction of all `touches` about `position`; None where there is none."""
    force, grip = ZERO, 0.0
    for touch in touches:
        force, grip = add(force, touch.drag), grip + touch.grip
    return None if grip == 0.0 and force == ZERO else Drag(position, force, grip)
