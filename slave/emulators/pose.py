"""What follows from the joint angles of the arm: where its tip is, its inertia, what its motion and its weight ask for.

The arm is a flat chain of three links on a turntable. With the pitch of each link, a = q2, b = q2 + q3 and c = q2 + q3
+ q4, a vector (x, z) fixed to a link is (x cos + z sin, z cos - x sin) in the vertical plane of the arm, and the
derivative of that by the pitch is (z', -x'). Kinetic energy, with p = (a, b, c) and the radii r_i of the centres of
mass from the axis of joint 1:

    2 T = I(p) q1'^2 + sum_ij M_ij p_i' p_j',    I = sum_i m_i r_i^2 + zz component of the tensor of link i

from which Lagrange's equations follow; there is no term that couples q1' with the others. Scalar code, since it runs
thousands of times a second. Knows neither friction nor motors.
"""

from math import cos, sin

from weberlink.geometry.vector import Vector
from weberlink.slave.emulators.links import (
    BASE_TO_SHOULDER,
    FOREARM,
    HAND,
    LINK_3,
    LINK_4,
    LINK_5,
    UPPER_ARM,
    WAIST_IZZ,
    Link,
)

Joints = tuple[float, float, float, float]
Jacobian = tuple[Joints, Joints, Joints]
Symmetric = list[float]
"""The lower triangle of a symmetric 4 x 4 matrix, row by row."""

GRAVITY = 9.81
"""[m/s^2]"""

# First and second moments of each link about its joint, with all that it carries.
_UX, _UZ = (
    LINK_3.mass * LINK_3.x + (LINK_4.mass + LINK_5.mass) * UPPER_ARM[0],
    LINK_3.mass * LINK_3.z + (LINK_4.mass + LINK_5.mass) * UPPER_ARM[1],
)
_WX, _WZ = (
    LINK_4.mass * LINK_4.x + LINK_5.mass * FOREARM[0],
    LINK_4.mass * LINK_4.z + LINK_5.mass * FOREARM[1],
)
_VX, _VZ = LINK_5.mass * LINK_5.x, LINK_5.mass * LINK_5.z


def _about_joint(link: Link) -> float:
    return link.iyy + link.mass * (link.x * link.x + link.z * link.z)


_MAA = _about_joint(LINK_3) + (LINK_4.mass + LINK_5.mass) * (UPPER_ARM[0] ** 2 + UPPER_ARM[1] ** 2)
_MBB = _about_joint(LINK_4) + LINK_5.mass * (FOREARM[0] ** 2 + FOREARM[1] ** 2)
_MCC = _about_joint(LINK_5)


class Pose:
    """The arm at joint angles [rad]; the frame is that of the foot."""

    __slots__ = ("_a", "_b", "_c", "_lever", "_turn", "tip")

    def __init__(self, q: Joints) -> None:
        a = q[1]
        b = a + q[2]
        c = b + q[3]
        self._a = sa, ca = sin(a), cos(a)
        self._b = sb, cb = sin(b), cos(b)
        self._c = sc, cc = sin(c), cos(c)
        self._turn = turn_s, turn_c = sin(q[0]), cos(q[0])
        x3, z3 = HAND[0] * cc + HAND[1] * sc, HAND[1] * cc - HAND[0] * sc
        x2, z2 = x3 + FOREARM[0] * cb + FOREARM[1] * sb, z3 + FOREARM[1] * cb - FOREARM[0] * sb
        x1, z1 = x2 + UPPER_ARM[0] * ca + UPPER_ARM[1] * sa, z2 + UPPER_ARM[1] * ca - UPPER_ARM[0] * sa
        self._lever = (x1, z1, x2, z2, x3, z3)  # outward and up from joints 2, 3 and 4 to the tip
        self.tip: Vector = (
            BASE_TO_SHOULDER[0] + x1 * turn_c,
            BASE_TO_SHOULDER[1] + x1 * turn_s,
            BASE_TO_SHOULDER[2] + z1,
        )
        """[m]"""

    def jacobian(self) -> Jacobian:
        """The rows of the tip's x, y and z by the joints [m]."""
        s, c = self._turn
        x1, z1, x2, z2, x3, z3 = self._lever
        return (-s * x1, c * z1, c * z2, c * z3), (c * x1, s * z1, s * z2, s * z3), (0.0, -x1, -x2, -x3)

    def equations(self, v: Joints, rotor: float) -> tuple[Symmetric, Joints]:
        """The inertia, with `rotor` [kg m^2] at each joint, and the torques of motion and weight, c(q, v) + g(q)."""
        (sa, ca), (sb, cb), (sc, cc) = self._a, self._b, self._c
        # First moments in the plane of the arm: u of the upper arm and all beyond it, w from joint 3, p from joint 4.
        ux, wx, wz = _UX * ca + _UZ * sa, _WX * cb + _WZ * sb, _WZ * cb - _WX * sb
        px, pz = _VX * cc + _VZ * sc, _VZ * cc - _VX * sc
        # Upper arm and forearm themselves.
        lx, lz = UPPER_ARM[0] * ca + UPPER_ARM[1] * sa, UPPER_ARM[1] * ca - UPPER_ARM[0] * sa
        fx, fz = FOREARM[0] * cb + FOREARM[1] * sb, FOREARM[1] * cb - FOREARM[0] * sb
        mab, mac, mbc = lx * wx + lz * wz, lx * px + lz * pz, fx * px + fz * pz
        yaw, by_a, by_b, by_c = self._about_vertical(lx, lz, fx, fz)
        m44 = _MCC
        m34 = mbc + m44
        m33 = _MBB + mbc + m34
        m24 = mac + m34
        m23 = mab + mac + m33
        m22 = _MAA + mab + mac + m23
        inertia = [yaw + rotor, 0.0, m22 + rotor, 0.0, m23, m33 + rotor, 0.0, m24, m34, m44 + rotor]
        turn, va = v[0], v[1]
        vb = va + v[2]
        vc = vb + v[3]
        half, aa, bb, cc2 = 0.5 * turn * turn, va * va, vb * vb, vc * vc
        kab, kac, kbc = lx * wz - lz * wx, lx * pz - lz * px, fx * pz - fz * px
        qc = -aa * kac - bb * kbc - half * by_c - GRAVITY * px
        qb = qc + cc2 * kbc - aa * kab - half * by_b - GRAVITY * wx
        qa = qb + bb * kab + cc2 * kac - half * by_a - GRAVITY * ux
        return inertia, (turn * (by_a * va + by_b * vb + by_c * vc), qa, qb, qc)

    def potential(self) -> float:
        """Energy of the weight [J]."""
        (sa, ca), (sb, cb), (sc, cc) = self._a, self._b, self._c
        return GRAVITY * (_UZ * ca - _UX * sa + _WZ * cb - _WX * sb + _VZ * cc - _VX * sc)

    def _about_vertical(self, lx: float, lz: float, fx: float, fz: float) -> tuple[float, float, float, float]:
        """Moment of inertia about the axis of joint 1, and its derivatives by the three pitches."""
        (sa, ca), (sb, cb), (sc, cc) = self._a, self._b, self._c
        m3, m4, m5 = LINK_3.mass, LINK_4.mass, LINK_5.mass
        x3, z3 = LINK_3.x * ca + LINK_3.z * sa, LINK_3.z * ca - LINK_3.x * sa
        x4, z4 = lx + LINK_4.x * cb + LINK_4.z * sb, LINK_4.z * cb - LINK_4.x * sb
        x5, z5 = lx + fx + LINK_5.x * cc + LINK_5.z * sc, LINK_5.z * cc - LINK_5.x * sc
        own3, change3 = _upright(LINK_3, sa, ca)
        own4, change4 = _upright(LINK_4, sb, cb)
        own5, change5 = _upright(LINK_5, sc, cc)
        mx4, mx5 = m4 * x4, m5 * x5
        return (
            WAIST_IZZ + m3 * x3 * x3 + mx4 * x4 + mx5 * x5 + own3 + own4 + own5,
            2.0 * (m3 * x3 * z3 + (mx4 + mx5) * lz) + change3,
            2.0 * (mx4 * z4 + mx5 * fz) + change4,
            2.0 * mx5 * z5 + change5,
        )


def _upright(link: Link, s: float, c: float) -> tuple[float, float]:
    """The zz component of a tilted tensor, and its derivative by the pitch."""
    spread = link.ixx - link.izz
    return link.izz + s * (spread * s - 2.0 * link.ixz * c), 2.0 * (s * c * spread - link.ixz * (c * c - s * s))
