"""An L-stable implicit scheme of order 2 for any scene, solved by Newton's method."""

from math import inf, sqrt

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale, subtract
from weberlink.slave.integrators.contact_force import ContactResistance, contact_force, pressing, staged
from weberlink.slave.integrators.contract import ControlledMass, MassState, Stage
from weberlink.slave.integrators.guard import EnergyGuard
from weberlink.slave.scenes.scene import Scene, SceneState

GAMMA = 1.0 - 1.0 / sqrt(2.0)
EVALUATIONS = 24
HALVINGS = 3
CONVERGED = 1e-11  # correction of a velocity, relative to the largest of its components
ROUNDING = 1e-15  # of a position [m/m]
STILL = 1e-13  # [m/s] smaller corrections are not applied


class Equation:
    """x = origin + h v, v = driven + h a(x, v), with the acceleration of `body` under control and contact.

    Args:
        state: Of the scene before each evaluation; it is left at the last one.
    """

    __slots__ = ("_drive", "_inertia", "_origin", "_scene", "_state", "_step")

    def __init__(
        self,
        body: ControlledMass,
        scene: Scene,
        state: SceneState,
        origin: Vector,
        driven: Vector,
        goal: Vector,
        step: float,
    ) -> None:
        self._scene, self._state = scene, state
        self._origin, self._step = origin, step
        pull = step * body.stiffness
        self._drive = add(scale(driven, body.mass), scale(subtract(goal, origin), pull))
        self._inertia = body.mass + step * (body.damping + pull)

    def solved(self, near: Stage) -> Stage:
        """The solution by Newton's method from the guess `near`; not solved after 24 evaluations.

        The force at the first guess is that of `near` and its derivative, so flat contact takes one evaluation. A
        step that increases the residual is halved, three times at most.
        """
        position, velocity, force = near.motion
        step = self._step
        resistance = ContactResistance(near.touches, velocity, self._inertia, step, trial=True)
        moved = subtract(add(self._origin, scale(velocity, step)), position)
        change = resistance.solved(self._residual(velocity, resistance.force(moved, force)))
        stage = self._at(add(velocity, change))
        residual = self._residual(stage.motion.velocity, stage.motion.force)
        evaluations = 1
        while evaluations < EVALUATIONS:
            velocity = stage.motion.velocity
            change = ContactResistance(stage.touches, velocity, self._inertia, step).solved(residual)
            if self._is_rounding(change, stage.motion):
                return stage
            size = dot(residual, residual)
            for _ in range(HALVINGS + 1):
                stage = self._at(add(velocity, change))
                residual = self._residual(stage.motion.velocity, stage.motion.force)
                evaluations += 1
                if dot(residual, residual) < size:
                    break
                change = scale(change, 0.5)
        return stage._replace(solved=False)

    def _at(self, velocity: Vector) -> Stage:
        """The scene evaluated at the position that `velocity` leads to."""
        position = add(self._origin, scale(velocity, self._step))
        self._scene.restore(self._state)
        return staged(self._scene, position, velocity)

    def _residual(self, velocity: Vector, force: Vector) -> Vector:
        """Residual of the equation [N s]."""
        return subtract(add(self._drive, scale(force, self._step)), scale(velocity, self._inertia))

    def _is_rounding(self, change: Vector, motion: MassState) -> bool:
        tolerance = STILL + CONVERGED * max(map(abs, motion.velocity))
        return max(map(abs, change)) <= tolerance + ROUNDING * max(map(abs, motion.position)) / self._step


class Implicit:
    """SDIRK of order 2 with two stages, g = 1 - 1/sqrt(2); a step of backward Euler where contact changes.

        x_1 = x + g h v_1                        v_1 = v + g h a(x_1, v_1)
        x'  = x + (1 - g) h v_1 + g h v'         v'  = v + (1 - g) h a_1 + g h a(x', v')

    Alexander, "Diagonally implicit Runge-Kutta methods for stiff O.D.E.'s", SIAM J. Numer. Anal. 14 (1977): with this
    g it is L-stable, and a step ends at its second stage, so the scene is left exactly where it was solved. A stage is
    one equation for a velocity, solved by Newton's method with the matrix of springs, dampers and sticking friction;
    the scene is restored before each evaluation. At most 24 evaluations a stage; one or two where contact is flat.

    It never adds energy to linear contact (von Neumann: |R| <= 1 holds in the energy norm), but nothing of the kind
    holds across a change of contact. There a step of backward Euler takes its place. The energy U of control and
    contact is convex, since contact can only push, hence

        E' - E <= v' . m (v' - v) + dU(x') . (x' - x) = -h (power of the dampers at the end) <= 0

    That is for flat contact. Elsewhere a step that would gain energy is braked, or not taken.

    Its local error h^2 is what the kink of the force costs any scheme that does not locate it, so the order stays 2.

    Where a step is far too long (centimetres into a stiff curved surface, or millimetres of sliding on it) its equation
    may defeat Newton's method. The body then loses its velocity and creeps toward its rest.
    """

    __slots__ = ("_body", "_end", "_guard", "_scene")

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._body = body
        self._scene = scene
        self._guard = EnergyGuard(body, scene)
        self._end: Stage | None = None

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        start = self._end
        if start is None or start.motion != motion:
            start = staged(self._scene, motion.position, motion.velocity)
        self._end = self.stepped(start, goal, step)
        return self._end.motion

    def stepped(self, start: Stage, goal: Vector, step: float) -> Stage:
        """The stage `step` [s] after `start`, which is that of the scene."""
        state, keep = self._scene.state, self._guard.kept
        held = pressing(start.touches, start.motion.velocity)
        first, end = self._sdirk(start, state, goal, step)
        if first.solved:
            if end.solved and (
                held == pressing(first.touches, first.motion.velocity) == pressing(end.touches, end.motion.velocity)
            ):
                kept = keep(start, end, goal)
                if kept is not None:
                    return kept
            end = self._equation(state, start.motion.position, start.motion.velocity, goal, step).solved(start)
        kept = keep(start, end, goal, inf) if end.solved else None
        if kept is None:
            kept = keep(start, self._crept(start, state, goal, step), goal, inf)
        return self._guard.stopped(start, state) if kept is None else kept

    def _crept(self, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage:
        """A step of backward Euler from rest, with the stiffness of control and contact in every direction.

        That is no less than the true one, so the step leads downhill in energy and no further than to the rest of it.
        Friction starts anew: on a curved surface its spring is no gradient of an energy.
        """
        mass, control, damping = self._body
        position = start.motion.position
        force = contact_force([touch._replace(drag=ZERO) for touch in start.touches], ZERO)
        stiffness = control + max(self._scene.stiffness_n_m, sum([touch.stiffness for touch in start.touches]))
        pull = add(force, scale(subtract(goal, position), control))
        velocity = scale(pull, step / (mass + step * (damping + step * stiffness)))
        self._scene.restore(state)
        self._scene.forget_friction()
        return staged(self._scene, add(position, scale(velocity, step)), velocity)

    def _sdirk(self, start: Stage, state: SceneState, goal: Vector, step: float) -> tuple[Stage, Stage]:
        position, velocity, _ = start.motion
        inner, rest, share = GAMMA * step, (1.0 - GAMMA) * step, (1.0 - GAMMA) / GAMMA
        first = self._equation(state, position, velocity, goal, inner).solved(start)
        if not first.solved:
            return first, first
        moved = add(position, scale(first.motion.velocity, rest))
        driven = add(velocity, scale(subtract(first.motion.velocity, velocity), share))  # g h a_1 is v_1 - v
        return first, self._equation(state, moved, driven, goal, inner).solved(first)

    def _equation(self, state: SceneState, origin: Vector, driven: Vector, goal: Vector, step: float) -> Equation:
        return Equation(self._body, self._scene, state, origin, driven, goal, step)
