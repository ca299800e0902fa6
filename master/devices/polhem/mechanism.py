"""From encoder counts to position and from force to motor currents: the cable drive on its linkage."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import copysign, cos, sin, tau

from weberlink.geometry.rotation import product
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale
from weberlink.master.devices.contract import Quaternion
from weberlink.master.devices.polhem.linkages import Angles, Linkage, Triple, Weight

Counts = tuple[int, int, int]
"""Encoder counts of the motors A, B and C, relative to the home pose."""

Signs = tuple[int, int, int]

MA_PER_A = 1e3


@dataclass(frozen=True)
class CableDrive:
    """angle_i = e_i 2 pi (count_i + home_i) / N_i c_i / b_i, and I_i = m_i torque_i c_i / b_i / Kt_i.

    The signs e and m are independent: e depends on the encoder's wiring and the firmware's counting table, m on the
    motor's wiring and the amplifier.

    Args:
        capstan_m: diameters c on the motors [m].
        body_m: diameters b on the bodies [m].
        counts_per_turn: N of a motor, all edges counted.
        encoder_directions: e, each +1 or -1.
        motor_directions: m, each +1 or -1.
        home_counts: what the encoders would read in the home pose if their zero were that of the angles.
        torque_constant_n_m_a: Kt of the motors [N m/A].
        gimbal_counts_per_turn: of the sensors of the handle's orientation, in the order of their axes; 0 for none.
        gimbal_directions: each +1 or -1.
        gimbal_home_counts: as `home_counts`.
    """

    capstan_m: Triple
    body_m: Triple
    counts_per_turn: Counts
    encoder_directions: Signs
    motor_directions: Signs
    home_counts: Counts
    torque_constant_n_m_a: Triple
    gimbal_counts_per_turn: Counts = (0, 0, 0)
    gimbal_directions: Signs = (1, 1, 1)
    gimbal_home_counts: Counts = (0, 0, 0)

    @cached_property
    def radians_per_count(self) -> Triple:
        """Angle of each body per count [rad]; negative where the encoder's direction is."""
        rows = zip(self.encoder_directions, self.counts_per_turn, self.capstan_m, self.body_m, strict=True)
        a, b, c = (direction * tau / counts * (capstan / body) for direction, counts, capstan, body in rows)
        return (a, b, c)

    @cached_property
    def ma_per_n_m(self) -> Triple:
        """Current for a torque on the body [mA/(N m)]; negative where the motor's direction is."""
        rows = zip(self.motor_directions, self.capstan_m, self.body_m, self.torque_constant_n_m_a, strict=True)
        a, b, c = (direction * (capstan / body) / kt * MA_PER_A for direction, capstan, body, kt in rows)
        return (a, b, c)

    def angles(self, counts: Counts) -> Angles:
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.home_counts
        return (a * (counts[0] + home_a), b * (counts[1] + home_b), c * (counts[2] + home_c))

    def counts(self, angles: Angles) -> Counts:
        """The nearest counts for angles."""
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.home_counts
        return (round(angles[0] / a) - home_a, round(angles[1] / b) - home_b, round(angles[2] / c) - home_c)

    def currents_ma(self, torques: Triple) -> Triple:
        """Motor currents [mA] for torques on the bodies [N m]."""
        a, b, c = self.ma_per_n_m
        return (a * torques[0], b * torques[1], c * torques[2])

    def torques(self, currents_ma: Triple) -> Triple:
        """Torques on the bodies [N m] of motor currents [mA]."""
        a, b, c = self.ma_per_n_m
        return (currents_ma[0] / a, currents_ma[1] / b, currents_ma[2] / c)

    def gimbal(self, counts: Counts) -> Angles | None:
        """The angles of the gimbal [rad]; None unless it has all three sensors."""
        if 0 in self.gimbal_counts_per_turn:
            return None
        first, second, third = (
            d * (count + home) * tau / per_turn
            for d, count, home, per_turn in zip(
                self.gimbal_directions, counts, self.gimbal_home_counts, self.gimbal_counts_per_turn, strict=True
            )
        )
        return (first, second, third)


LEAST_DETERMINANT = 1e-5
"""A pose counts as singular below this determinant [m^3]; in the middle it is 100 times larger."""


@dataclass(frozen=True)
class Mechanism:
    """A drive on a linkage, with a gimbal at its end.

    Args:
        drive: between counts and angles.
        linkage: between angles and position.
        gimbal_axes: about which the handle turns against the forearm, first to last, of "x", "y" and "z".
        weight: of the links; None where no masses are published.
    """

    drive: CableDrive
    linkage: Linkage
    gimbal_axes: str = "xyx"
    weight: Weight | None = None

    def position(self, counts: Sequence[int]) -> Vector:
        """Position of the handle [m]; `counts` relative to the home pose, those of the gimbal may follow."""
        return self.linkage.position(self._angles(counts))

    def currents_ma(self, force: Vector, counts: Sequence[int]) -> Triple:
        """Currents that put a force on the hand [N], by tau = J^T F; finite in every pose, but not limited here."""
        (xa, xb, xc), (ya, yb, yc), (za, zb, zc) = self.linkage.jacobian(self._angles(counts))
        fx, fy, fz = force
        return self.drive.currents_ma(
            (xa * fx + ya * fy + za * fz, xb * fx + yb * fy + zb * fz, xc * fx + yc * fy + zc * fz)
        )

    def limited_currents_ma(
        self, force: Vector, counts: Sequence[int], force_n: float, current_ma: float
    ) -> tuple[int, int, int]:
        """Whole milliamperes for a force [N], within limits; 0 as `force_n` means never a current.

        Where one motor would need more than `current_ma`, all get less, so that the force keeps its direction.
        """
        length = norm(force)
        if length == 0.0 or force_n == 0.0:
            return (0, 0, 0)
        if length > force_n:
            force = scale(force, force_n / length)
        currents = self.currents_ma(force, counts)
        largest = max(map(abs, currents))
        if largest > current_ma:
            currents = scale(currents, current_ma / largest)
        a, b, c = map(int, currents)  # towards zero, hence never beyond a limit
        return (a, b, c)

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
        """The nearest counts for a position; out of reach, those of the nearest one within."""
        return self.drive.counts(self.linkage.inverse(position))

    def orientation(self, counts: Sequence[int]) -> Quaternion | None:
        """R = Rz(A) Ry(-lam) R(D) R(E) R(F) with the forearm's elevation lam; None without a whole gimbal.

        Its authors mark the formula as in need of verification.
        """
        gimbal = self.drive.gimbal((counts[3], counts[4], counts[5])) if len(counts) >= 6 else None
        if gimbal is None:
            return None
        angles = self._angles(counts)
        turned = product(_turn("z", angles[0]), _turn("y", -self.linkage.forearm(angles)))
        for axis, angle in zip(self.gimbal_axes, gimbal, strict=True):
            turned = product(turned, _turn(axis, angle))
        return turned

    def _angles(self, counts: Sequence[int]) -> Angles:
        return self.drive.angles((counts[0], counts[1], counts[2]))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _turn(axis: str, angle: float) -> Quaternion:
    half = sin(0.5 * angle)
    return (cos(0.5 * angle), half * (axis == "x"), half * (axis == "y"), half * (axis == "z"))
