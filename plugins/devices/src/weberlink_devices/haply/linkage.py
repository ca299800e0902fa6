"""The planar five-bar linkage of the Haply, its frame, and the published numbers of its versions."""

from dataclasses import dataclass
from math import acos, atan2, cos, hypot, pi, sin, sqrt
from typing import NamedTuple

from weberlink.geometry.vector import Vector
from weberlink_devices.haply.board import (
    CLOCKWISE as _CW,
    COUNTER_CLOCKWISE as _CCW,
    BoardEncoder,
    BoardMotor,
    HaplyBoard,
    Pair,
)

FLATTEST = 0.02
"""The linkage counts as singular below this sine of the angle between the outer links."""


class Unreachable(ValueError):  # noqa: N818 - a statement about the linkage, not a mistake of the program
    """The linkage has no such posture, or is singular there."""


class Jacobian(NamedTuple):
    """Derivatives of the tip (x, y) by the angles of motors 1 and 2 [m/rad]."""

    x1: float
    x2: float
    y1: float
    y2: float

    def torques(self, force: Pair) -> Pair:
        """Motor torques for a force at the tip: J^T F [N m]."""
        return (self.x1 * force[0] + self.y1 * force[1], self.x2 * force[0] + self.y2 * force[1])

    def force(self, torques: Pair) -> Pair:
        """Force at the tip for motor torques: the inverse of `torques` [N]."""
        determinant = self.x1 * self.y2 - self.x2 * self.y1
        return (
            (self.y2 * torques[0] - self.y1 * torques[1]) / determinant,
            (self.x1 * torques[1] - self.x2 * torques[0]) / determinant,
        )


class PlanarFiveBar(NamedTuple):
    """A symmetric linkage: inner and outer links, and the distance between the motors [m]; 0 for motors on one axis."""

    inner: float
    outer: float
    spacing: float

    def tip(self, angles: Pair) -> Pair:
        """Position of the tip: the intersection of the outer links with the larger y.

        By the perpendicular bisector of the elbows, which has no pole where both are equally far to the side.

        Raises:
            Unreachable: the elbows are too far apart for the outer links, or one and the same point.
        """
        (ax, ay), (bx, by) = self._elbows(angles)
        x, y, height = self._bisector(ax, ay, bx, by)
        # The bisector points to the left of A to B, so upward while B is to the right of A.
        side = height if bx >= ax else -height
        return (x - side * (by - ay), y + side * (bx - ax))

    def jacobian(self, angles: Pair) -> Jacobian:
        """Derived from |E - A| = |E - B| = outer: (E - A).dE = (E - A).dA and (E - B).dE = (E - B).dB.

        Raises:
            Unreachable: as `tip`, or the outer links are in line, so that the tip can move though no motor does.
        """
        (ax, ay), (bx, by) = self._elbows(angles)
        ex, ey = self.tip(angles)
        ux, uy, vx, vy = ex - ax, ey - ay, ex - bx, ey - by
        determinant = ux * vy - uy * vx
        if abs(determinant) < FLATTEST * self.outer * self.outer:
            raise Unreachable("the outer links are in line")
        # A turns with velocity (-ay, ax) and B with (-by, bx - spacing) per rad.
        first = (uy * ax - ux * ay) / determinant
        second = (vy * (bx - self.spacing) - vx * by) / determinant
        return Jacobian(first * vy, -second * uy, -first * vx, second * ux)

    def angles(self, tip: Pair) -> Pair:
        """Motor angles for a tip, with the elbows outward: A on the side of -x, B on the side of +x.

        Motor 1 between 0 and 2 pi, motor 2 between -pi and pi, for a tip with y >= 0.

        Raises:
            Unreachable: the point is too far or too near.
        """
        x, y = tip
        return (
            atan2(y, x) + self._spread(hypot(x, y)),
            atan2(y, x - self.spacing) - self._spread(hypot(x - self.spacing, y)),
        )

    def _elbows(self, angles: Pair) -> tuple[Pair, Pair]:
        first, second = angles
        return (
            (self.inner * cos(first), self.inner * sin(first)),
            (self.spacing + self.inner * cos(second), self.inner * sin(second)),
        )

    def _bisector(self, ax: float, ay: float, bx: float, by: float) -> tuple[float, float, float]:
        """Middle between the elbows, and height of the tip above it per distance of the elbows."""
        apart = hypot(bx - ax, by - ay)
        if not 1e-9 < apart <= 2.0 * self.outer:  # not a number fails too
            raise Unreachable(
                f"the elbows are {apart * 1e3:.1f} mm apart, the outer links reach {2e3 * self.outer:g} mm"
            )
        height = sqrt(self.outer * self.outer - apart * apart / 4.0) / apart
        return ((ax + bx) / 2.0, (ay + by) / 2.0, height)

    def _spread(self, reach: float) -> float:
        """Angle at the motor between the inner link and the line to a tip at this distance."""
        if not abs(self.outer - self.inner) <= reach <= self.outer + self.inner or reach == 0.0:
            raise Unreachable(f"{reach * 1e3:.1f} mm from a motor is out of reach")
        cosine = (self.inner**2 + reach**2 - self.outer**2) / (2.0 * self.inner * reach)
        return acos(min(1.0, max(-1.0, cosine)))


def degrees(angles: Pair) -> Pair:
    return (angles[0] * 180.0 / pi, angles[1] * 180.0 / pi)


def radians(angles: Pair) -> Pair:
    return (angles[0] * pi / 180.0, angles[1] * pi / 180.0)


class HaplyFrame(NamedTuple):
    """x toward the operator, y to the operator's right, z up and always 0.

    The linkage's y goes from the motors toward the operator, and its x to the left: the vendor's example programs
    mirror it for the screen.

    Args:
        origin: of the device's frame, in that of the linkage [m].
    """

    origin: Pair

    def position(self, tip: Pair) -> Vector:
        return (tip[1] - self.origin[1], self.origin[0] - tip[0], 0.0)

    def tip(self, position: Vector) -> Pair:
        return (self.origin[0] - position[1], self.origin[1] + position[0])

    @staticmethod
    def force(force: Pair) -> Vector:
        """Force in the device's frame for one in the linkage's."""
        return (force[1], -force[0], 0.0)

    @staticmethod
    def planar(force: Vector) -> Pair:
        """In-plane force in the linkage's frame for one in the device's."""
        return (-force[1], force[0])


MOST_TORQUE_N_M = 0.123
"""Limit of the firmware for the torque of a motor, at full duty.

The same in all that the vendor has published (HaplyHaptics/Haply-Arduino-Firmware-Versions, `MAX_TORQUE`): for the Due
board (1.5 of July 2017), the M3 and the M0 (1.5 and 0.3 of December 2018).
"""


@dataclass(frozen=True, slots=True)
class HaplyVersion:
    """A published version of the device."""

    bar: PlanarFiveBar
    board: HaplyBoard  # what hangs on which port, and the angles of the arms at the starting place
    center: Pair  # middle of the workspace, in the frame of the linkage [m]
    reach: Pair
    """Half the workspace, along x and y [m]: until the linkage is stretched out, and toward the motors as far as the
    starting place."""


VERSIONS = {
    "v3": HaplyVersion(
        bar=PlanarFiveBar(0.07, 0.09, 0.038),
        board=HaplyBoard(
            motors=(BoardMotor(2, _CCW), BoardMotor(1, _CCW)),
            encoders=(BoardEncoder(2, _CCW, 4880.0), BoardEncoder(1, _CCW, 4880.0)),
            home_deg=(168.0, 12.0),
        ),
        center=(0.019, 0.097),
        reach=(0.138, 0.063),
    ),
    "v2": HaplyVersion(
        bar=PlanarFiveBar(0.07, 0.09, 0.0),
        board=HaplyBoard(
            motors=(BoardMotor(2, _CCW), BoardMotor(1, _CW)),
            encoders=(BoardEncoder(2, _CCW, 10752.0), BoardEncoder(1, _CW, 10752.0)),
            home_deg=(241.0, -61.0),
        ),
        center=(0.0, 0.091),
        reach=(0.16, 0.07),
    ),
    "pantograph": HaplyVersion(
        bar=PlanarFiveBar(0.05, 0.07, 0.02),
        board=HaplyBoard(
            motors=(BoardMotor(1, _CW), BoardMotor(2, _CW)),
            encoders=(BoardEncoder(1, _CW, 13824.0), BoardEncoder(2, _CW, 13824.0)),
            home_deg=(180.0, 0.0),
        ),
        center=(0.01, 0.078),
        reach=(0.105, 0.043),
    ),
}
"""v3 of plastic, v2 with the metal plate, and their predecessor; from the vendor's libraries and examples."""
