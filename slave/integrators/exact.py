"""The exact solution of linear contact, from event to event; elsewhere that of the tangent planes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from weberlink.geometry.vector import ZERO, Vector, add
from weberlink.slave.integrators import ControlledMass, MassState
from weberlink.slave.integrators.linear_contact import Drag, LinearContact
from weberlink.slave.integrators.problem import MassInContact, Stage, contact_force
from weberlink.slave.integrators.stick_slip import StickSlip
from weberlink.slave.scenes.scene import Scene, SceneState, Touch

if TYPE_CHECKING:  # what a flat scene without friction does not import
    from weberlink.slave.integrators.implicit import Implicit


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

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._problem = MassInContact(body, scene)
        self._implicit: Implicit | None = None
        self._linear: LinearContact | None = None
        self._rough: StickSlip | None = None
        if scene.closed_form:
            planes = scene.facing(ZERO)
            cone = scene.objects[0].friction if scene.rubs else None
            if cone is None:
                self._linear = LinearContact(self._problem, planes, ZERO)
            else:
                self._rough = StickSlip(self._problem, planes[0], cone)
        if self._linear is None:
            self._implicit_scheme()

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        problem, linear, rough = self._problem, self._linear, self._rough
        scene = problem.scene
        if linear is not None:  # nothing to guard: it is the solution
            moved = linear.flow(motion.position, motion.velocity, goal, step)
            if moved is not None:
                position, velocity = moved
                return MassState(position, velocity, contact_force(scene.touch(position), velocity))
        start = problem.start(motion)
        state, end = scene.state, None
        if rough is not None:
            end = rough.stepped(start, state, goal, step)
        elif linear is None:
            end = self._midpoint(start, state, goal, step)
        if end is None:
            scene.restore(state)
            end = self._implicit_scheme().stepped(start, goal, step)
        problem.end = end
        return end.motion

    def _implicit_scheme(self) -> "Implicit":
        """The implicit scheme; in flat contact without friction, only a step of very many events needs it."""
        if self._implicit is None:
            from weberlink.slave.integrators.implicit import Implicit  # noqa: PLC0415

            self._implicit = Implicit(self._problem.body, self._problem.scene)
        return self._implicit

    def _midpoint(self, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage | None:
        """The step with the tangent planes of its middle."""
        problem, (position, velocity, _) = self._problem, start.motion
        half = self._tangents(position).flow(position, velocity, goal, 0.5 * step, drag_of(start.touches, position))
        if half is None:
            return None
        middle, _ = half
        there = problem.scene.touch(middle)
        tangents = self._tangents(middle)
        problem.scene.restore(state)
        end = tangents.flow(position, velocity, goal, step, drag_of(there, middle))
        return None if end is None else problem.kept(start, problem.at(*end), goal)

    def _tangents(self, position: Vector) -> LinearContact:
        """The tangent planes of the scene at the proxy."""
        scene = self._problem.scene
        proxy = scene.proxy or position
        return LinearContact(self._problem, scene.facing(proxy), proxy)


def drag_of(touches: Sequence[Touch], position: Vector) -> Drag | None:
    """Friction of all `touches` about `position`; None where there is none."""
    force, grip = ZERO, 0.0
    for touch in touches:
        force, grip = add(force, touch.drag), grip + touch.grip
    return None if grip == 0.0 and force == ZERO else Drag(position, force, grip)
