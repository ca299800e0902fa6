"""From encoder counts to the handle's position, and from a force on the hand to motor currents; pure.

The device's frame: x towards the operator, y to the right, z up, in metres from the middle of the workspace.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, cos, sin

from weberlink.geometry.vector import ZERO, Vector, dot
from weberlink.master.devices.contract import Quaternion
from weberlink.master.devices.polhem.drive import Angles, Counts, Drive, Triple
from weberlink.master.devices.polhem.five_bar import FiveBar
from weberlink.master.devices.polhem.linkage import Jacobian, Linkage, SerialParallelogram
from weberlink.master.devices.polhem.weight import Weight

__all__ = ["Angles", "Counts", "Drive", "FiveBar", "Jacobian", "Linkage", "Mechanism", "SerialParallelogram"]

LEAST_DETERMINANT = 1e-5
"""Of a Jacobian, below which a pose counts as singular [m^3]; in the middle of the workspace it is 100 times that."""


@dataclass(frozen=True)
class Mechanism:
    """A drive on a linkage, with a gimbal at its end.

    Args:
        drive: between counts and angles.
        linkage: between angles and position.
        gimbal_axes: about which the handle turns against the forearm, first to last, of "x", "y" and "z".
        weight: of the links; None where no masses are published.
    """

    drive: Drive
    linkage: Linkage
    gimbal_axes: str = "xyx"
    weight: Weight | None = None

    def position(self, counts: Sequence[int]) -> Vector:
        """Of the handle [m]; `counts` relative to the home pose, those of the gimbal may follow."""
        return self.linkage.position(self._angles(counts))

    def jacobian(self, counts: Sequence[int]) -> Jacobian:
        return self.linkage.jacobian(self._angles(counts))

    def currents_ma(self, force: Vector, counts: Sequence[int]) -> Triple:
        """Currents that put a force on the hand [N], by tau = J^T F; finite in every pose, but not limited here."""
        (xa, xb, xc), (ya, yb, yc), (za, zb, zc) = self.linkage.jacobian(self._angles(counts))
        fx, fy, fz = force
        return self.drive.currents_ma(
            (xa * fx + ya * fy + za * fz, xb * fx + yb * fy + zb * fz, xc * fx + yc * fy + zc * fz)
        )

    def force(self, currents_ma: Triple, counts: Sequence[int]) -> Vector:
        """The force on the hand [N] that currents make; bounded at singular poses instead of infinite."""
        return self._tip_force(self.drive.torques(currents_ma), self._angles(counts))

    def carrying_force(self, counts: Sequence[int]) -> Vector:
        """The force at the handle [N] that carries the links against gravity; zero without published masses."""
        if self.weight is None:
            return ZERO
        angles = self._angles(counts)
        return self._tip_force(self.weight.torques(angles), angles)

    def _tip_force(self, torques: Triple, angles: Angles) -> Vector:
        """F = J^-T tau."""
        x, y, z = self.linkage.jacobian(angles)
        # The rows of J^-T are those of the cofactors over the determinant.
        cofactors = (_cross(y, z), _cross(z, x), _cross(x, y))
        determinant = dot(x, cofactors[0])
        determinant = copysign(max(abs(determinant), LEAST_DETERMINANT), determinant)
        fx, fy, fz = (dot(cofactor, torques) / determinant for cofactor in cofactors)
        return (fx, fy, fz)

    def counts_at(self, position: Vector) -> Counts:
        """The nearest ones, or those of the nearest position within reach."""
        return self.drive.counts(self.linkage.inverse(position))

    def orientation(self, counts: Sequence[int]) -> Quaternion | None:
        """R = Rz(A) Ry(-lam) R(D) R(E) R(F) with the forearm's elevation lam; None without a whole gimbal.

        Its authors mark the formula as in need of verification.
        """
        gimbal = self.drive.gimbal((counts[3], counts[4], counts[5])) if len(counts) >= 6 else None
        if gimbal is None:
            return None
        angles = self._angles(counts)
        turned = _times(_turn("z", angles[0]), _turn("y", -self.linkage.forearm(angles)))
        for axis, angle in zip(self.gimbal_axes, gimbal, strict=True):
            turned = _times(turned, _turn(axis, angle))
        return turned

    def _angles(self, counts: Sequence[int]) -> Angles:
        return self.drive.angles((counts[0], counts[1], counts[2]))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _turn(axis: str, angle: float) -> Quaternion:
    half = sin(0.5 * angle)
    return (cos(0.5 * angle), half * (axis == "x"), half * (axis == "y"), half * (axis == "z"))


def _times(a: Quaternion, b: Quaternion) -> Quaternion:
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
