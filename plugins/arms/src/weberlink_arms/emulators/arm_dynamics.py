"""Motion of the emulated OpenMANIPULATOR-X under motor torques, gravity, friction, its stops and a scene.

    M(q) v' + c(q, v) + g(q) = tau - D v - dry friction + J^T f

Each step is linearly implicit Euler: viscous friction, springs and dampers of scene and stops, and dry friction are
evaluated at the end of the step, so it is stable for any stiffness and its error is damping. Scalar code, since it runs
thousands of times a second.
"""

from collections.abc import Sequence
from math import copysign

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.scenes.contact import Touch
from weberlink.slave.scenes.scene import Scene
from weberlink_arms.cartesian.arm import (
    COULOMB_N_M,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    VISCOUS_N_M_S,
    ArmPose,
    Joints,
    arm_pose,
    potential_energy,
)
from weberlink_arms.emulators.dynamixel.arm import STEP

Symmetric = list[float]
"""The lower triangle of a symmetric 4 x 4 matrix, row by row."""

STOP_STIFFNESS = 200.0  # [N m/rad]; a guess, only meant to stop the arm
STOP_DAMPING = 0.5  # [N m s]
STILL: Joints = (0.0, 0.0, 0.0, 0.0)
DIAGONAL = (0, 2, 5, 9)
FLIPS = 3**4  # no pattern of four joints repeats; 2 or 3 are usual, 27 the most of 300 000 random ones

GRIPPER_INERTIA = 0.005  # [kg m^2] of rotor and crank; a guess
GRIPPER_COULOMB = 0.02 * STEP  # [N m s] a step; a guess
GRIPPER_VISCOUS = 0.02  # [N m s]; a guess
GRIPPER_LOWER, GRIPPER_UPPER = -1.0, 1.2
"""[rad]; a guess."""


def mass_matrix(pose: ArmPose, rotor: float) -> Symmetric:
    """Of the links, with `rotor` [kg m^2] at each joint."""
    m11, m22, m23, m24, m33, m34, m44 = pose.inertia
    return [m11 + rotor, 0.0, m22 + rotor, 0.0, m23, m33 + rotor, 0.0, m24, m34, m44 + rotor]


def with_dry_friction(a: Symmetric, r: Sequence[float], most: Sequence[float], before: Joints) -> Joints:
    """The v with a v + s = r, where s_i = most_i sign(v_i), or anything up to that where v_i = 0.

    It minimises 1/2 v^T a v - r^T v + sum most_i |v_i|, and is unique since a is positive definite. Which joints stick
    is guessed from `before`, and corrected joint by joint, always the first that contradicts (Murty's rule, which
    terminates). A joint that sticks has exactly zero velocity.

    Args:
        a: Inertia of the step [kg m^2].
        r: Momentum that the step would reach without friction [N m s].
        most: Largest impulse of friction [N m s].
        before: Velocities that the step begins with [rad/s].
    """
    signs = [0.0 if v == 0.0 and m > 0.0 else 1.0 if v > 0.0 else -1.0 for v, m in zip(before, most, strict=True)]
    v = sliding(a, r, most, signs)
    for _ in range(FLIPS):
        flipped = _contradiction(a, r, most, signs, v)
        if flipped is None:
            break
        joint, sign = flipped
        signs[joint] = sign
        v = sliding(a, r, most, signs)
    return v


def _contradiction(
    a: Symmetric, r: Sequence[float], most: Sequence[float], signs: Sequence[float], v: Joints
) -> tuple[int, float] | None:
    """The first joint whose friction has the wrong sign or is too large, and its new sign of motion."""
    left = times(a, v)
    for i, (sign, holds) in enumerate(zip(signs, most, strict=True)):
        if sign != 0.0:
            if v[i] * sign < 0.0 and holds > 0.0:
                return i, 0.0
        elif holds > 0.0:
            push = r[i] - left[i]
            if abs(push) > holds:
                return i, 1.0 if push > 0.0 else -1.0
    return None


def times(a: Symmetric, v: Joints) -> list[float]:
    """a v"""
    v0, v1, v2, v3 = v
    return [
        a[0] * v0 + a[1] * v1 + a[3] * v2 + a[6] * v3,
        a[1] * v0 + a[2] * v1 + a[4] * v2 + a[7] * v3,
        a[3] * v0 + a[4] * v1 + a[5] * v2 + a[8] * v3,
        a[6] * v0 + a[7] * v1 + a[8] * v2 + a[9] * v3,
    ]


def sliding(a: Symmetric, r: Sequence[float], most: Sequence[float], signs: Sequence[float]) -> Joints:
    """The velocities of joints that slide with the given signs, or stick for 0, by L D L^T factorisation."""
    a00, a10, a11, a20, a21, a22, a30, a31, a32, a33 = a
    s0, s1, s2, s3 = signs
    r0, r1, r2, r3 = r[0] - s0 * most[0], r[1] - s1 * most[1], r[2] - s2 * most[2], r[3] - s3 * most[3]
    if most[0] > 0.0 and s0 == 0.0:
        a00, a10, a20, a30, r0 = 1.0, 0.0, 0.0, 0.0, 0.0
    if most[1] > 0.0 and s1 == 0.0:
        a10, a11, a21, a31, r1 = 0.0, 1.0, 0.0, 0.0, 0.0
    if most[2] > 0.0 and s2 == 0.0:
        a20, a21, a22, a32, r2 = 0.0, 0.0, 1.0, 0.0, 0.0
    if most[3] > 0.0 and s3 == 0.0:
        a30, a31, a32, a33, r3 = 0.0, 0.0, 0.0, 1.0, 0.0
    l10, l20, l30 = a10 / a00, a20 / a00, a30 / a00
    d1, e21, e31 = a11 - l10 * a10, a21 - l20 * a10, a31 - l30 * a10
    l21, l31 = e21 / d1, e31 / d1
    d2, e32 = a22 - l20 * a20 - l21 * e21, a32 - l30 * a20 - l31 * e21
    l32 = e32 / d2
    d3 = a33 - l30 * a30 - l31 * e31 - l32 * e32
    r1 -= l10 * r0
    r2 -= l20 * r0 + l21 * r1
    r3 -= l30 * r0 + l31 * r1 + l32 * r2
    v3 = r3 / d3
    v2 = r2 / d2 - l32 * v3
    v1 = r1 / d1 - l21 * v2 - l31 * v3
    return (r0 / a00 - l10 * v1 - l20 * v2 - l30 * v3, v1, v2, v3)


class TipContact:
    """The contacts of the tip in one implicit step: springs, dampers and friction.

    With the Jacobian J of the tip, the depth d before the step of length h and the joint velocities w after it, a
    contact of normal n pushes with f = k (d - h n.J w) - b n.J w along n, and its friction with drag - h grip J w
    across n.

    Args:
        touches: Of the scene at the beginning of the step.
        pose: Of the arm at the beginning of the step.
        step: Its length [s].
    """

    __slots__ = ("_jacobian", "_pose", "_step", "_touching")

    def __init__(self, touches: Sequence[Touch], pose: ArmPose, step: float) -> None:
        self._pose, self._jacobian = pose, pose.jacobian()
        self._step = step
        self._touching = [(touch, pose.torques(touch.normal)) for touch in touches]

    def added(self, a: Symmetric, r: Sequence[float]) -> tuple[Symmetric, list[float]]:
        """Inertia and momentum of the step with these contacts."""
        h, pose = self._step, self._pose
        a, (r0, r1, r2, r3) = a.copy(), r
        for touch, row in self._touching:
            n, (x, y, z), push = touch.normal, touch.drag, touch.stiffness * touch.depth
            f = pose.torques((push * n[0] + x, push * n[1] + y, push * n[2] + z))
            r0, r1, r2, r3 = r0 + h * f[0], r1 + h * f[1], r2 + h * f[2], r3 + h * f[3]
            grip = h * h * touch.grip
            _add(a, row, h * (h * touch.stiffness + touch.damping) - grip)
            if grip > 0.0:
                for axis in self._jacobian:
                    _add(a, axis, grip)
        return a, [r0, r1, r2, r3]

    def lets_go(self, w: Joints) -> bool:
        """Drop the contacts that would pull at these velocities [rad/s]; returns whether there were any."""
        kept = [(touch, row) for touch, row in self._touching if self._push(touch, row, w) >= 0.0]
        dropped = len(kept) < len(self._touching)
        self._touching = kept
        return dropped

    def force(self, w: Joints) -> Vector:
        """On the tip during the step [N]."""
        x = y = z = 0.0
        mx, my, mz = (self._step * dot4(row, w) for row in self._jacobian)
        for touch, row in self._touching:
            n, drag, grip = touch.normal, touch.drag, touch.grip
            # The grip acts across the normal only.
            f = self._push(touch, row, w) + self._step * grip * dot4(row, w)
            x += f * n[0] + drag[0] - grip * mx
            y += f * n[1] + drag[1] - grip * my
            z += f * n[2] + drag[2] - grip * mz
        return (x, y, z)

    def _push(self, touch: Touch, row: Joints, w: Joints) -> float:
        return touch.stiffness * touch.depth - (self._step * touch.stiffness + touch.damping) * dot4(row, w)


def dot4(a: Joints, b: Joints) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


def _add(a: Symmetric, row: Joints, factor: float) -> None:
    """a += factor row row^T"""
    j0, j1, j2, j3 = row
    k0, k1, k2, k3 = factor * j0, factor * j1, factor * j2, factor * j3
    a[0] += k0 * j0
    a[1] += k1 * j0
    a[2] += k1 * j1
    a[3] += k2 * j0
    a[4] += k2 * j1
    a[5] += k2 * j2
    a[6] += k3 * j0
    a[7] += k3 * j1
    a[8] += k3 * j2
    a[9] += k3 * j3


class EmulatedArm:
    """State of the arm, and its integration step.

    Args:
        scene: What the tip touches, in the frame of the foot; None for free space.
        start: Joint angles [rad].
        coulomb: Dry friction of the joints [N m].
        viscous: Viscous friction of the joints [N m s].
        rotor_inertia: Of each motor, seen at its joint [kg m^2].
    """

    def __init__(
        self,
        scene: Scene | None,
        start: Joints,
        *,
        coulomb: Joints = COULOMB_N_M,
        viscous: Joints = VISCOUS_N_M_S,
        rotor_inertia: float = ROTOR_INERTIA_KG_M2,
    ) -> None:
        self._scene = scene or Scene([])
        self._rotor = rotor_inertia
        self._coulomb = [each * STEP for each in coulomb]
        self._viscous = [each * STEP for each in viscous]
        self.angles = start
        """[rad]"""
        self.velocities = STILL
        """[rad/s]"""
        self.force: Vector = ZERO
        """Of the scene on the tip during the last step [N]."""

    @property
    def tip(self) -> Vector:
        """In the frame of the foot [m]."""
        return arm_pose(self.angles).tip

    def step(self, torques: Sequence[float]) -> None:
        """Move on by `STEP` under the torques of the motors [N m]."""
        pose, q, v = arm_pose(self.angles), self.angles, self.velocities
        a, g, c = mass_matrix(pose, self._rotor), pose.gravity, pose.coriolis(v)
        r = [p + STEP * (torques[i] - c[i] - g[i]) for i, p in enumerate(times(a, v))]
        d0, d1, d2, d3 = self._viscous
        a[0] += d0
        a[2] += d1
        a[5] += d2
        a[9] += d3
        self._stop(a, r)
        touches = self._scene.touch(pose.tip)
        if touches:
            w = self._pressed(TipContact(touches, pose, STEP), a, r)
        else:
            w, self.force = with_dry_friction(a, r, self._coulomb, v), ZERO
        self.velocities = w
        self.angles = (q[0] + STEP * w[0], q[1] + STEP * w[1], q[2] + STEP * w[2], q[3] + STEP * w[3])

    def energy(self) -> float:
        """Kinetic energy and potential energy of the weight [J]."""
        momentum = arm_pose(self.angles).momentum(self.velocities, self._rotor)
        return 0.5 * sum(p * v for p, v in zip(momentum, self.velocities, strict=True)) + potential_energy(self.angles)

    def _pressed(self, contact: TipContact, a: Symmetric, r: list[float]) -> Joints:
        """The velocities for which no contact pulls at the end of the step."""
        while True:
            with_contact = contact.added(a, r)
            w = with_dry_friction(*with_contact, self._coulomb, self.velocities)
            if contact.lets_go(w):
                continue
            self.force = contact.force(w)
            return w

    def _stop(self, a: Symmetric, r: list[float]) -> None:
        """The stops are springs with dampers."""
        for i, (angle, (lower, upper)) in enumerate(zip(self.angles, zip(LOWER, UPPER, strict=True), strict=True)):
            if not lower <= angle <= upper:
                a[DIAGONAL[i]] += STEP * (STEP * STOP_STIFFNESS + STOP_DAMPING)
                r[i] -= STEP * STOP_STIFFNESS * (angle - (lower if angle < lower else upper))


class Gripper:
    """A crank that one motor turns, between two stops; it grips nothing, and does not move the arm."""

    def __init__(self) -> None:
        self.angle = 0.0
        self.velocity = 0.0

    def step(self, torque: float) -> None:
        """Move on by `STEP` under the torque of the motor [N m]."""
        inertia, push = GRIPPER_INERTIA + STEP * GRIPPER_VISCOUS, GRIPPER_INERTIA * self.velocity + STEP * torque
        beyond = min(self.angle - GRIPPER_LOWER, 0.0) + max(self.angle - GRIPPER_UPPER, 0.0)
        if beyond != 0.0:
            inertia += STEP * (STEP * STOP_STIFFNESS + STOP_DAMPING)
            push -= STEP * STOP_STIFFNESS * beyond
        self.velocity = copysign(max(0.0, abs(push) - GRIPPER_COULOMB), push) / inertia
        self.angle += STEP * self.velocity
