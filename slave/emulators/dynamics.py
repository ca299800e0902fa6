"""How the arm moves under motor torques, gravity, friction, its stops and a scene. Knows no motor, no bus and no clock.

    M(q) v' + c(q, v) + g(q) = tau - D v - dry friction + J^T f

Each step is linearly implicit Euler: what can be stiff (viscous friction, springs and dampers of scene and stops)
counts at the end of the step, so that no stiffness makes it unstable, and what it adds is damping. Dry friction counts
at the end of the step too (`weberlink.slave.emulators.dry_friction`).
"""

from collections.abc import Sequence

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.emulators.dry_friction import times, with_dry_friction
from weberlink.slave.emulators.links import COULOMB, JOINTS, ROTOR_INERTIA, VISCOUS
from weberlink.slave.emulators.pose import Joints, Pose, Symmetric
from weberlink.slave.emulators.tip_contact import TipContact
from weberlink.slave.scenes.scene import Scene

STEP = 0.0005
"""Of integration [s]."""
STOP_STIFFNESS = 200.0  # [N m/rad]; a guess, only meant to stop the arm
STOP_DAMPING = 0.5  # [N m s]
STILL: Joints = (0.0, 0.0, 0.0, 0.0)
DIAGONAL = (0, 2, 5, 9)


class Arm:
    """The arm's state and its steps.

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
        coulomb: Joints = COULOMB,
        viscous: Joints = VISCOUS,
        rotor_inertia: float = ROTOR_INERTIA,
    ) -> None:
        self._scene = scene
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
        return Pose(self.angles).tip

    def step(self, torques: Sequence[float]) -> None:
        """Move on by `STEP` under the torques of the motors [N m]."""
        pose, q, v = Pose(self.angles), self.angles, self.velocities
        a, (b0, b1, b2, b3) = pose.equations(v, self._rotor)
        r = times(a, v)
        r[0] += STEP * (torques[0] - b0)
        r[1] += STEP * (torques[1] - b1)
        r[2] += STEP * (torques[2] - b2)
        r[3] += STEP * (torques[3] - b3)
        d0, d1, d2, d3 = self._viscous
        a[0] += d0
        a[2] += d1
        a[5] += d2
        a[9] += d3
        self._stop(a, r)
        touches = () if self._scene is None else self._scene.touch(pose.tip)
        if touches:
            w = self._pressed(TipContact(touches, pose.jacobian(), STEP), a, r)
        else:
            w, self.force = with_dry_friction(a, r, self._coulomb, v), ZERO
        self.velocities = w
        self.angles = (q[0] + STEP * w[0], q[1] + STEP * w[1], q[2] + STEP * w[2], q[3] + STEP * w[3])

    def energy(self) -> float:
        """Kinetic energy and that of the weight [J]; what springs hold is not in it."""
        pose = Pose(self.angles)
        inertia, _ = pose.equations(STILL, self._rotor)
        momentum = times(inertia, self.velocities)
        return 0.5 * sum(p * v for p, v in zip(momentum, self.velocities, strict=True)) + pose.potential()

    def _pressed(self, contact: TipContact, a: Symmetric, r: list[float]) -> Joints:
        """The velocities where every contact that counts pushes at the end of the step, and none pulls."""
        while True:
            with_contact = contact.added(a, r)
            w = with_dry_friction(*with_contact, self._coulomb, self.velocities)
            if contact.lets_go(w):
                continue
            self.force = contact.force(w)
            return w

    def _stop(self, a: Symmetric, r: list[float]) -> None:
        """The stops are springs with dampers."""
        for i, (angle, (lower, upper)) in enumerate(zip(self.angles, JOINTS, strict=True)):
            if not lower <= angle <= upper:
                a[DIAGONAL[i]] += STEP * (STEP * STOP_STIFFNESS + STOP_DAMPING)
                r[i] -= STEP * STOP_STIFFNESS * (angle - (lower if angle < lower else upper))
