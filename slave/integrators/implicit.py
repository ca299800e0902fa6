"""An L-stable implicit scheme of order 2 for any scene, solved by Newton's method."""

from collections.abc import Sequence
from math import inf, sqrt

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale, subtract
from weberlink.slave.integrators import ControlledMass, MassState
from weberlink.slave.integrators.problem import MassInContact, Stage, contact_force, pushes
from weberlink.slave.scenes.proxy import multipliers
from weberlink.slave.scenes.scene import Scene, SceneState, Touch

GAMMA = 1.0 - 1.0 / sqrt(2.0)
EVALUATIONS = 24
HALVINGS = 3
CONVERGED = 1e-11  # correction of a velocity, relative to the largest of its components
ROUNDING = 1e-15  # of a position [m/m]
STILL = 1e-13  # [m/s] smaller corrections are not applied


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

    def __init__(self, body: ControlledMass, scene: Scene) -> None:
        self._problem = MassInContact(body, scene)

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        problem = self._problem
        problem.end = self.stepped(problem.start(motion), goal, step)
        return problem.end.motion

    def stepped(self, start: Stage, goal: Vector, step: float) -> Stage:
        """The stage `step` [s] after `start`, which is that of the scene."""
        problem, (position, velocity, _) = self._problem, start.motion
        state = problem.scene.state
        inner, rest, share = GAMMA * step, (1.0 - GAMMA) * step, (1.0 - GAMMA) / GAMMA
        first = end = self._solved(start, state, position, velocity, goal, inner)
        if first.solved:
            moved = add(position, scale(first.motion.velocity, rest))
            driven = add(velocity, scale(subtract(first.motion.velocity, velocity), share))  # g h a_1 is v_1 - v
            end = self._solved(first, state, moved, driven, goal, inner)
            if end.solved and pressing(start) == pressing(first) == pressing(end):
                kept = problem.kept(start, end, goal)
                if kept is not None:
                    return kept
            end = self._solved(start, state, position, velocity, goal, step)
        kept = problem.kept(start, end, goal, inf) if end.solved else None
        if kept is None:
            kept = problem.kept(start, self._crept(start, state, goal, step), goal, inf)
        return problem.stopped(start, state) if kept is None else kept

    def _crept(self, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage:
        """A step of backward Euler from rest, with the stiffness of control and contact in every direction.

        That is no less than the true one, so the step leads downhill in energy and no further than to the rest of it.
        Friction starts anew: on a curved surface its spring is no gradient of an energy.
        """
        scene, (mass, control, damping) = self._problem.scene, self._problem.body
        position = start.motion.position
        force = contact_force([touch._replace(drag=ZERO) for touch in start.touches], ZERO)
        stiffness = control + max(scene.stiffness_n_m, sum([touch.stiffness for touch in start.touches]))
        pull = add(force, scale(subtract(goal, position), control))
        velocity = scale(pull, step / (mass + step * (damping + step * stiffness)))
        scene.restore(state)
        scene.forget_friction()
        return self._problem.at(add(position, scale(velocity, step)), velocity)

    def _solved(
        self, near: Stage, state: SceneState, origin: Vector, driven: Vector, goal: Vector, step: float
    ) -> Stage:
        mass, control, damping = self._problem.body
        pull = step * control
        drive, inertia = add(scale(driven, mass), scale(subtract(goal, origin), pull)), mass + step * (damping + pull)
        position, velocity, force = near.motion
        resistance = ContactResistance(near.touches, velocity, inertia, step, trial=True)
        force = resistance.force(subtract(add(origin, scale(velocity, step)), position), force)
        change = resistance.solved(residual_of(drive, velocity, force, inertia, step))
        stage = self._at(state, origin, add(velocity, change), step)
        residual = residual_of(drive, stage.motion.velocity, stage.motion.force, inertia, step)
        evaluations = 1
        while evaluations < EVALUATIONS:
            position, velocity, _ = stage.motion
            change = ContactResistance(stage.touches, velocity, inertia, step).solved(residual)
            tolerance = STILL + CONVERGED * max(map(abs, velocity))
            if max(map(abs, change)) <= tolerance + ROUNDING * max(map(abs, position)) / step:
                return stage
            size = dot(residual, residual)
            for _ in range(HALVINGS + 1):
                stage = self._at(state, origin, add(velocity, change), step)
                residual = residual_of(drive, stage.motion.velocity, stage.motion.force, inertia, step)
                evaluations += 1
                if dot(residual, residual) < size:
                    break
                change = scale(change, 0.5)
        return stage._replace(solved=False)

    def _at(self, state: SceneState, origin: Vector, velocity: Vector, step: float) -> Stage:
        """The stage at the position that `velocity` leads to."""
        self._problem.scene.restore(state)
        return self._problem.at(add(origin, scale(velocity, step)), velocity)


def residual_of(drive: Vector, velocity: Vector, force: Vector, inertia: float, step: float) -> Vector:
    """[N s]"""
    return subtract(add(drive, scale(force, step)), scale(velocity, inertia))


def pressing(stage: Stage) -> frozenset[int]:
    """The objects whose contact force is more than 0."""
    forces = pushes(stage.touches, stage.motion.velocity)
    return frozenset([touch.owner for touch, force in zip(stage.touches, forces, strict=True) if force > 0.0])


class ContactResistance:
    """The 3 x 3 matrix inertia - h df/dv - h^2 df/dx of contacts; inertia is m + h c + h^2 k of the body [kg].

    The matrix is never written out. With the dual vectors g_i of the normals n_i (g_i . n_j = 1 if i = j, else 0) that
    of springs and dampers is sum (h^2 k_i + h b_i) n_i g_i, whose inverse follows by components along the n_i; across
    all normals only the grip of friction acts. The share of one contact's grip along another's normal is overestimated
    as 1: Newton's method then takes a few steps more, but does not overshoot. A `trial` treats every contact with
    friction as sticking, since sliding is a result of the step.
    """

    def __init__(
        self, touches: Sequence[Touch], velocity: Vector, inertia: float, step: float, *, trial: bool = False
    ) -> None:
        self._touches = touches
        self._grip = 0.0
        for touch in touches:
            if touch.grip > 0.0 or (trial and touch.drag != ZERO):
                self._grip += touch.stiffness
        squared = step * step
        self._across = inertia + squared * self._grip
        shared = self._across if len(touches) > 1 else inertia
        self._along: list[float] = []
        for touch, push in zip(touches, pushes(touches, velocity), strict=True):
            self._along.append(shared + (step * (step * touch.stiffness + touch.damping) if push > 0.0 else 0.0))

    def solved(self, push: Vector) -> Vector:
        """The change of velocity [m/s] under `push` [N s]."""
        if not self._touches:
            return (push[0] / self._across, push[1] / self._across, push[2] / self._across)
        shares = self._shares(push)
        if shares is None:  # dependent normals: no faster than the stiffest of them all
            total = sum(self._along)
            return (push[0] / total, push[1] / total, push[2] / total)
        x, y, z = push
        p = q = r = 0.0
        for touch, share, along in zip(self._touches, shares, self._along, strict=True):
            n = touch.normal
            x, y, z = x - share * n[0], y - share * n[1], z - share * n[2]
            part = share / along
            p, q, r = p + part * n[0], q + part * n[1], r + part * n[2]
        return (p + x / self._across, q + y / self._across, r + z / self._across)

    def force(self, moved: Vector, force: Vector) -> Vector:
        """The contact force [N] after the body `moved` [m] at the same velocity, to first order."""
        shares = self._shares(moved)
        if shares is None:
            return force
        x, y, z = moved
        fx, fy, fz = force
        for touch, share in zip(self._touches, shares, strict=True):
            n = touch.normal
            x, y, z = x - share * n[0], y - share * n[1], z - share * n[2]
            f = touch.stiffness * share
            fx, fy, fz = fx - f * n[0], fy - f * n[1], fz - f * n[2]
        grip = self._grip
        return (fx - grip * x, fy - grip * y, fz - grip * z)

    def _shares(self, vector: Vector) -> Sequence[float] | None:
        """The components of `vector` along the normals; None without any, and where they are dependent."""
        normals = [touch.normal for touch in self._touches]
        return multipliers([dot(n, vector) for n in normals], normals)
