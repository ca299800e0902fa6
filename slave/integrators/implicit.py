"""An L-stable scheme of order 2 for any scene: stiff contact is damped out, never blown up."""

from math import sqrt

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale
from weberlink.slave.integrators.contract import Body, Motion
from weberlink.slave.integrators.reaction import pressing, reaction
from weberlink.slave.integrators.stage import Equation, Stage, linear_part
from weberlink.slave.scenes.scene import Scene, SceneState

GAMMA = 1.0 - 1.0 / sqrt(2.0)


class Implicit:
    """SDIRK of order 2 with two stages, g = 1 - 1/sqrt(2); a step of backward Euler where contact changes.

        x_1 = x + g h v_1                        v_1 = v + g h a(x_1, v_1)
        x'  = x + (1 - g) h v_1 + g h v'         v'  = v + (1 - g) h a_1 + g h a(x', v')

    Alexander, "Diagonally implicit Runge-Kutta methods for stiff O.D.E.'s", SIAM J. Numer. Anal. 14 (1977): with this
    g it is L-stable, and a step ends at its second stage, so the scene is left exactly where it was solved. A stage is
    one equation for a velocity, solved by Newton's method with the matrix of springs, dampers and sticking friction;
    the scene is set back before each evaluation, and what stays is the accepted position. At most 24 evaluations a
    stage; one or two where contact is flat (`weberlink.slave.integrators.stage`).

    It never adds energy to linear contact (von Neumann: |R| <= 1 holds in the energy norm), but nothing of the kind
    holds across a change of contact. There a step of backward Euler takes its place. The energy U of control and
    contact is convex, since contact can only push, hence

        E' - E <= v' . m (v' - v) + dU(x') . (x' - x) = -h (power of the dampers at the end) <= 0

    That is for flat contact. In a hollow, with a step far too long for its stiffness (10 ms, a kilogram, 1e5 N/m),
    energy was seen to grow by a quarter in rare trials; at 2 ms and less by no more than 0.12 % in 60 steps.

    Its local error h^2 is what the kink of the force costs any scheme that does not locate it, so the order stays 2.

    Where a step is far too long for friction on a curved surface (millimetres of sliding on a stiff one) its equation
    may defeat Newton's method; that step is solved without friction, which then brakes what is left of the velocity.
    Should that fail too (an impact that leads a centimetre past a curved surface), the body stops where it was.
    """

    __slots__ = ("_body", "_end", "_scene")

    def __init__(self, body: Body, scene: Scene | None) -> None:
        self._body = body
        self._scene = scene
        self._end: Stage | None = None

    def advance(self, motion: Motion, goal: Vector, step: float) -> Motion:
        scene, start = self._scene, self._end
        if start is None or start.motion != motion:
            start = Stage(motion, () if scene is None else scene.touch(motion.position))
        state = None if scene is None else scene.state
        first, end = self._sdirk(start, state, goal, step)
        held = pressing(start.touches, motion.velocity)
        if not (first.solved and end.solved) or not (
            held == pressing(first.touches, first.motion.velocity) == pressing(end.touches, end.motion.velocity)
        ):
            end = self._solved(start, state, motion.position, motion.velocity, goal, step)
            if not end.solved and scene is not None and state is not None:
                end = self._braked(scene, start, state, goal, step)
        self._end = end
        return end.motion

    def _braked(self, scene: Scene, start: Stage, state: SceneState, goal: Vector, step: float) -> Stage:
        """Backward Euler without friction; then friction takes from the velocity, at most down to zero.

        What friction remembers is dropped: it did not hold, and must not give back what it never took.
        """
        position, velocity, _ = start.motion
        equation = Equation(self._body, scene, state, position, velocity, goal, step, rubs=False)
        smooth = equation.solved(start)
        if smooth.solved:
            position, velocity, _ = smooth.motion
        else:
            velocity = ZERO
        scene.restore(state)
        drag = ZERO
        for touch in scene.touch(position):
            drag = add(drag, touch.drag)
        power, pull = dot(drag, velocity), dot(drag, drag)
        if power < 0.0:
            velocity = add(velocity, scale(drag, min(step / self._body.mass, -power / pull)))
        scene.forget_friction()
        touches = scene.touch(position)
        return Stage(Motion(position, velocity, reaction(touches, velocity)), touches)

    def _sdirk(self, start: Stage, state: SceneState | None, goal: Vector, step: float) -> tuple[Stage, Stage]:
        (x, y, z), (u, v, w), _ = start.motion
        inner, rest, share = GAMMA * step, (1.0 - GAMMA) * step, (1.0 - GAMMA) / GAMMA
        first = self._solved(start, state, (x, y, z), (u, v, w), goal, inner)
        if not first.solved:
            return first, first
        p, q, r = first.motion.velocity
        moved = (x + rest * p, y + rest * q, z + rest * r)
        driven = (u + share * (p - u), v + share * (q - v), w + share * (r - w))  # g h a_1 is v_1 - v
        return first, self._solved(first, state, moved, driven, goal, inner)

    def _solved(
        self, near: Stage, state: SceneState | None, origin: Vector, driven: Vector, goal: Vector, step: float
    ) -> Stage:
        """x = origin + h v, v = driven + h a(x, v), begun at a stage `near` by, from the scene's `state`."""
        if self._scene is not None and state is not None:
            return Equation(self._body, self._scene, state, origin, driven, goal, step).solved(near)
        drive, inertia = linear_part(self._body, origin, driven, goal, step)
        velocity = scale(drive, 1.0 / inertia)
        return Stage(Motion(add(origin, scale(velocity, step)), velocity, ZERO), ())
