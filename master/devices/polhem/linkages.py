"""Linkages of the PHANTOM's relatives: kinematics, Jacobian and the torques that carry their weight.

The device's frame: x towards the operator, y to the right, z up, in metres from the middle of the workspace.
"""

from dataclasses import dataclass
from math import acos, atan2, copysign, cos, hypot, pi, sin

from weberlink.geometry.vector import Vector

Triple = tuple[float, float, float]
"""One value for each of the bodies A, B and C."""

Angles = Triple
"""Angles of the bodies A, B and C [rad]."""

Jacobian = tuple[Vector, Vector, Vector]
"""Rows x, y, z; columns A, B, C [m/rad]."""


@dataclass(frozen=True)
class SerialParallelogram:
    """Body A turns all about the vertical; B is the upper arm, and C turns the forearm by a parallelogram.

    B and C are absolute angles from the vertical, so the upper arm does not turn the forearm:

        r = lb sin B + lc sin C,   x = r cos A - ox,   y = r sin A - oy,   z = ln + lb cos B - lc cos C - oz

    Args:
        ln: height of the shoulder [m].
        lb: length of the upper arm [m].
        lc: length of the forearm [m].
        origin: middle of the workspace from the foot of the vertical axis [m].
    """

    ln: float
    lb: float
    lc: float
    origin: Vector

    def position(self, angles: Angles) -> Vector:
        a, b, c = angles
        r = self.lb * sin(b) + self.lc * sin(c)
        ox, oy, oz = self.origin
        return (r * cos(a) - ox, r * sin(a) - oy, self.ln + self.lb * cos(b) - self.lc * cos(c) - oz)

    def jacobian(self, angles: Angles) -> Jacobian:
        a, b, c = angles
        sin_a, cos_a, sin_b, sin_c = sin(a), cos(a), sin(b), sin(c)
        r = self.lb * sin_b + self.lc * sin_c
        forth_b, forth_c = self.lb * cos(b), self.lc * cos(c)
        return (
            (-sin_a * r, cos_a * forth_b, cos_a * forth_c),
            (cos_a * r, sin_a * forth_b, sin_a * forth_c),
            (0.0, -self.lb * sin_b, self.lc * sin_c),
        )

    def inverse(self, position: Vector) -> Angles:
        """The pose with the elbow up and the tip in front of the vertical axis."""
        x, y, z = (p + o for p, o in zip(position, self.origin, strict=True))
        up = z - self.ln
        forth = hypot(x, y)
        reach = max(hypot(forth, up), 1e-9)
        elevation = atan2(forth, up)  # from the vertical
        b = elevation - acos_clamped((self.lb**2 + reach**2 - self.lc**2) / (2.0 * self.lb * reach))
        c = elevation + acos_clamped((self.lc**2 + reach**2 - self.lb**2) / (2.0 * self.lc * reach))
        return (atan2(y, x), b, pi - c)

    def forearm(self, angles: Angles) -> float:
        """Elevation of the last link over the horizontal [rad]."""
        return angles[2] - 0.5 * pi


def acos_clamped(cosine: float) -> float:
    """The angle; 0 or pi where the links do not reach and the cosine is out of range."""
    return acos(min(1.0, max(-1.0, cosine)))


LEAST_SINE = 1e-3
"""The linkage counts as at its dead point below this sine of the angle between coupler and forearm."""


@dataclass(frozen=True)
class SpatialFiveBar:
    """Body A turns a vertical plane about the vertical; B and C drive a five-bar linkage within it.

    In that plane, u outwards and v up, with e(t) = (cos t, sin t): the upper arm ends at B = (l0/2, 0) + l1 e(t2), the
    crank at D = (-l0/2, 0) + l2 e(t3). The forearm goes from C = B - l4 e(lam) through B to the tip B + l5 e(lam), and
    the coupler between C and D has the length l3, which gives lam. Of its two solutions the one with the coupler behind
    the upper arm is built.

    Args:
        l0: between the two pivots on the body [m].
        l1: upper arm [m].
        l2: crank [m].
        l3: coupler [m].
        l4: forearm, behind its joint [m].
        l5: forearm, before it [m].
        origin: middle of the workspace from the middle between the pivots [m].
    """

    l0: float
    l1: float
    l2: float
    l3: float
    l4: float
    l5: float
    origin: Vector

    def position(self, angles: Angles) -> Vector:
        a, t2, t3 = angles
        lam = self._forearm(t2, t3)
        u = 0.5 * self.l0 + self.l1 * cos(t2) + self.l5 * cos(lam)
        v = self.l1 * sin(t2) + self.l5 * sin(lam)
        ox, oy, oz = self.origin
        return (u * cos(a) - ox, u * sin(a) - oy, v - oz)

    def jacobian(self, angles: Angles) -> Jacobian:
        """By differentiating |C - D|^2 = l3^2: with w = C - D and n = e'(lam),

        d lam/d t2 = w.B' / (l4 w.n) and d lam/d t3 = -w.D' / (l4 w.n). At the dead point w.n is 0 and the force of the
        tip cannot turn the crank; there the derivative is held at that of `LEAST_SINE`.
        """
        a, t2, t3 = angles
        lam = self._forearm(t2, t3)
        cos_2, sin_2, cos_3, sin_3 = cos(t2), sin(t2), cos(t3), sin(t3)
        cos_l, sin_l = cos(lam), sin(lam)
        w_u = self.l0 + self.l1 * cos_2 - self.l4 * cos_l - self.l2 * cos_3
        w_v = self.l1 * sin_2 - self.l4 * sin_l - self.l2 * sin_3
        lever = w_v * cos_l - w_u * sin_l
        lever = self.l4 * copysign(max(abs(lever), LEAST_SINE * self.l3), lever)
        by_2 = self.l1 * (w_v * cos_2 - w_u * sin_2) / lever
        by_3 = -self.l2 * (w_v * cos_3 - w_u * sin_3) / lever
        u = 0.5 * self.l0 + self.l1 * cos_2 + self.l5 * cos_l
        u_2, v_2 = -self.l1 * sin_2 - self.l5 * sin_l * by_2, self.l1 * cos_2 + self.l5 * cos_l * by_2
        u_3, v_3 = -self.l5 * sin_l * by_3, self.l5 * cos_l * by_3
        cos_a, sin_a = cos(a), sin(a)
        return (
            (-sin_a * u, cos_a * u_2, cos_a * u_3),
            (cos_a * u, sin_a * u_2, sin_a * u_3),
            (0.0, v_2, v_3),
        )

    def inverse(self, position: Vector) -> Angles:
        """The pose with elbow up, tip in front of the vertical axis, crank behind the line from its pivot to C."""
        x, y, z = (p + o for p, o in zip(position, self.origin, strict=True))
        u, v = hypot(x, y), z
        half = 0.5 * self.l0
        t2 = atan2(v, u - half) + _beside(self.l1, hypot(u - half, v), self.l5)
        b_u, b_v = half + self.l1 * cos(t2), self.l1 * sin(t2)
        lam = atan2(v - b_v, u - b_u)
        c_u, c_v = b_u - self.l4 * cos(lam) + half, b_v - self.l4 * sin(lam)
        t3 = atan2(c_v, c_u) + _beside(self.l2, hypot(c_u, c_v), self.l3)
        return (atan2(y, x), t2, t3)

    def forearm(self, angles: Angles) -> float:
        return self._forearm(angles[1], angles[2])

    def _forearm(self, t2: float, t3: float) -> float:
        """Angle lam, from the triangle B, C, D."""
        u = self.l2 * cos(t3) - self.l0 - self.l1 * cos(t2)
        v = self.l2 * sin(t3) - self.l1 * sin(t2)
        lam = atan2(v, u) - _beside(self.l4, hypot(u, v), self.l3) + pi
        return lam if lam <= pi else lam - 2.0 * pi


def _beside(near: float, far: float, opposite: float) -> float:
    """Angle between two sides of a triangle [rad]; the nearest possible where the third does not fit."""
    return acos_clamped((near**2 + far**2 - opposite**2) / (2.0 * near * max(far, 1e-9)))


GRAVITY_M_S2 = 9.81

STEP_RAD = 1e-3
"""Step of the central difference."""


@dataclass(frozen=True)
class ParallelogramWeight:
    """Weight of the serial linkage; heights of the centres of mass: z_b = r_b cos B, z_c = lb cos B - r_c cos C.

    Derived here. The two published formulas (CWoodenDevice.cpp, hfab_kinematics.cpp) differ in sign from each other,
    each has one of the two signs wrong, and their makers ship both switched off (`g_constant` 0).

    Args:
        mass_b: of the upper arm [kg].
        mass_c: of the forearm [kg].
        centre_b: of the upper arm, from the shoulder [m].
        centre_c: of the forearm, from the elbow [m].
        lb: length of the upper arm [m].
    """

    mass_b: float
    mass_c: float
    centre_b: float
    centre_c: float
    lb: float

    def torques(self, angles: Angles) -> Triple:
        _, b, c = angles
        upper = self.mass_b * self.centre_b + self.mass_c * self.lb
        return (0.0, -GRAVITY_M_S2 * upper * sin(b), GRAVITY_M_S2 * self.mass_c * self.centre_c * sin(c))


@dataclass(frozen=True)
class LinkMass:
    """A mass [kg] with its centre along and across the link [m]."""

    mass: float
    along: float
    across: float

    def height(self, elevation: float) -> float:
        """Height of the centre over the beginning of the link [m], at an elevation [rad]."""
        return self.along * sin(elevation) + self.across * cos(elevation)


@dataclass(frozen=True)
class FiveBarWeight:
    """Weight of the five-bar linkage, differentiated numerically as by its makers (polhemComputeMotorAmps)."""

    linkage: SpatialFiveBar
    upper_arm: LinkMass
    crank: LinkMass
    coupler: LinkMass
    forearm: LinkMass

    def torques(self, angles: Angles) -> Triple:
        _, t2, t3 = angles
        half = 0.5 * STEP_RAD
        by_2 = self._energy(t2 + half, t3) - self._energy(t2 - half, t3)
        by_3 = self._energy(t2, t3 + half) - self._energy(t2, t3 - half)
        return (0.0, by_2 / STEP_RAD, by_3 / STEP_RAD)

    def _energy(self, t2: float, t3: float) -> float:
        """Potential energy over the pivots [J]."""
        linkage = self.linkage
        lam = linkage.forearm((0.0, t2, t3))
        elbow, crank_end = linkage.l1 * sin(t2), linkage.l2 * sin(t3)
        across = linkage.l0 + linkage.l1 * cos(t2) - linkage.l4 * cos(lam) - linkage.l2 * cos(t3)
        coupler = atan2(elbow - linkage.l4 * sin(lam) - crank_end, across)
        return GRAVITY_M_S2 * (
            self.upper_arm.mass * self.upper_arm.height(t2)
            + self.crank.mass * self.crank.height(t3)
            + self.coupler.mass * (crank_end + self.coupler.height(coupler))
            + self.forearm.mass * (elbow + self.forearm.height(lam))
        )


Linkage = SerialParallelogram | SpatialFiveBar
"""Forward and inverse kinematics; every result is finite, and out of reach the inverse is the nearest pose."""

Weight = ParallelogramWeight | FiveBarWeight
"""`torques` gives those on the bodies A, B and C that hold the links still [N m]."""
