"""The torques that carry the weight of the links, from their published masses and centres of mass; pure."""

from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Protocol

from weberlink.master.devices.polhem.drive import Angles, Triple
from weberlink.master.devices.polhem.five_bar import FiveBar

GRAVITY_M_S2 = 9.81

STEP_RAD = 1e-3
"""Of the central difference."""


class Weight(Protocol):
    """The weight of a mechanism."""

    def torques(self, angles: Angles) -> Triple:
        """Torques on the bodies A, B and C that hold the links still [N m]: the derivative of the potential energy."""
        ...


@dataclass(frozen=True)
class ParallelogramWeight:
    """Of the serial linkage: z_b = r_b cos B and z_c = lb cos B - r_c cos C are the heights of the centres of mass.

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
class Link:
    """A mass [kg] with its centre along and across the link [m]."""

    mass: float
    along: float
    across: float

    def height(self, elevation: float) -> float:
        """Of the centre over the beginning of the link [m], at an elevation [rad]."""
        return self.along * sin(elevation) + self.across * cos(elevation)


@dataclass(frozen=True)
class FiveBarWeight:
    """Of the five-bar linkage; its makers differentiate numerically too (hfab_polhem.h, polhemComputeMotorAmps)."""

    linkage: FiveBar
    upper_arm: Link
    crank: Link
    coupler: Link
    forearm: Link

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
