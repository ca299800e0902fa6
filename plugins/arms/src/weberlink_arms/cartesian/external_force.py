"""The force of the environment on the tip, from the currents of the motors.

At rest and in slow motion, the motors carry the weight, the friction and the force on the tip:

    J^T f = gravity + friction - tau,    tau = torque constant * current

four equations for three unknowns, solved by least squares, damped where the arm is nearly straight and a direction is
not observable. The inertia of the links is not subtracted: it is felt, as that of a tool is.
"""

from itertools import product
from math import hypot, sqrt
from typing import Final

from weberlink.geometry.vector import Vector
from weberlink_arms.cartesian.arm import ArmPose, Joints, four
from weberlink_arms.dynamixel.motor_models import JointFriction

# Smallest singular value of the planar Jacobian, and smallest reach, without damping [m]: below it a torque of
# 0.02 N m, which is friction, would appear as more than 1 N.
_FEELS_LEAST_M: Final = 0.02


def tip_force(posture: ArmPose, rates: Joints, torques: Joints, friction: JointFriction) -> Vector:
    """Force of the environment on the robot [N], from the torques of the motors [N m]."""
    g1, g2, g3, g4 = posture.gravity
    q1, q2, q3, q4 = rates
    t1, t2, t3, t4 = torques
    rub = friction.torque
    return _pressing(posture, (g1 + rub(0, q1) - t1, g2 + rub(1, q2) - t2, g3 + rub(2, q3) - t3, g4 + rub(3, q4) - t4))


def _pressing(posture: ArmPose, torques: Joints) -> Vector:
    """The tip force whose J^T f is nearest to these torques."""
    t1, t2, t3, t4 = torques
    a2, b2, a3, b3, a4, b4 = posture.columns
    rr, rz, zz = a2 * a2 + a3 * a3 + a4 * a4, a2 * b2 + a3 * b3 + a4 * b4, b2 * b2 + b3 * b3 + b4 * b4
    half = 0.5 * (rr + zz)
    damping = _damping(half - sqrt(max(0.0, half * half - rr * zz + rz * rz)))
    rr, zz = rr + damping, zz + damping
    r, z = a2 * t2 + a3 * t3 + a4 * t4, b2 * t2 + b3 * t3 + b4 * t4
    scale = 1.0 / (rr * zz - rz * rz)
    radial, up = (zz * r - rz * z) * scale, (rr * z - rz * r) * scale
    across = posture.reach * t1 / (posture.reach**2 + _damping(posture.reach**2))
    return (
        posture.cos_yaw * radial - posture.sin_yaw * across,
        posture.sin_yaw * radial + posture.cos_yaw * across,
        up,
    )


def _damping(square: float) -> float:
    """Addition to a squared singular value [m^2]; 0 where the direction is observable."""
    return max(0.0, _FEELS_LEAST_M**2 - square)


def force_error(posture: ArmPose, friction: JointFriction, torque_constant_error: float) -> tuple[float, float]:
    """Bound on the error of `tip_force` at rest: newtons, and a share of the estimated force.

    If the true torque constant is r times the assumed one, the motors carry tau = r tau', and

        J^T f = gravity + friction - r tau' = J^T f' + friction - (r - 1) (gravity - J^T f')

    with f' the estimate. So the error is that of friction - (r - 1) gravity, and |r - 1| of f'. Friction at rest may
    have either sign in each joint; r is the same for all motors. The newtons are the worst case over these signs.
    `torque_constant_error` is the largest |r - 1|.
    """
    p, q, r, s = four(friction.coulomb)
    rubs = ((p, 0.0, 0.0, 0.0), (0.0, q, 0.0, 0.0), (0.0, 0.0, r, 0.0), (0.0, 0.0, 0.0, s))
    a, b, c, d = [_pressing(posture, rub) for rub in rubs]
    g1, g2, g3, g4 = posture.gravity
    e = torque_constant_error
    x, y, z = _pressing(posture, (e * g1, e * g2, e * g3, e * g4))
    newtons = max(
        hypot(*(w + i * p + j * q + k * r + m * s for w, p, q, r, s in zip((x, y, z), a, b, c, d, strict=True)))
        for i, j, k, m in product((1.0, -1.0), repeat=4)
    )
    return (newtons, torque_constant_error)
