"""The closed five-bar linkage of the Polhem; pure."""

from dataclasses import dataclass
from math import atan2, copysign, cos, hypot, pi, sin

from weberlink.geometry.vector import Vector
from weberlink.master.devices.polhem.drive import Angles
from weberlink.master.devices.polhem.linkage import Jacobian, acos_clamped

LEAST_SINE = 1e-3
"""Between coupler and forearm, below which the linkage counts as at its dead point."""


@dataclass(frozen=True)
class FiveBar:
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
        """The elbow is up, the tip before the vertical axis, and the crank behind the line from its pivot to C."""
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
        """lam, from the triangle B, C, D."""
        u = self.l2 * cos(t3) - self.l0 - self.l1 * cos(t2)
        v = self.l2 * sin(t3) - self.l1 * sin(t2)
        lam = atan2(v, u) - _beside(self.l4, hypot(u, v), self.l3) + pi
        return lam if lam <= pi else lam - 2.0 * pi


def _beside(near: float, far: float, opposite: float) -> float:
    """Angle between two sides of a triangle [rad]; the nearest possible where the third does not fit."""
    return acos_clamped((near**2 + far**2 - opposite**2) / (2.0 * near * max(far, 1e-9)))
