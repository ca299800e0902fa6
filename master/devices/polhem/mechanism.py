"""Kinematics of the PHANTOM's relatives: encoder counts to position, force to motor currents, the weight of the links.

The device's frame: x towards the operator, y to the right, z up, in metres from the middle of the workspace.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import acos, atan2, copysign, cos, hypot, pi, sin, tau
from typing import Literal

from weberlink.geometry.rotation import Quaternion, product
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale

Triple = tuple[float, float, float]  # one value for each of the bodies A, B and C
Angles = Triple  # angles of the bodies A, B and C [rad]
Jacobian = tuple[Vector, Vector, Vector]  # rows x, y, z; columns A, B, C [m/rad]
Counts = tuple[int, int, int]  # encoder counts of the motors A, B and C, relative to the home pose
Signs = tuple[int, int, int]

GRAVITY_M_S2 = 9.81
STEP_RAD = 1e-3  # step of the central difference of the energy
LEAST_SINE = 1e-3  # the linkage counts as at its dead point below this sine of the angle between coupler and forearm
LEAST_DETERMINANT = 1e-5  # a pose counts as singular below this determinant [m^3]; in the middle it is 100 times larger
MA_PER_A = 1e3
BEYOND_HOME_M = 0.05

Board = Literal["serial", "hid14", "hid8"]
"""The electronics: a Teensy on a serial port, or an mbed with HID reports of 14 or 8 bytes."""


@dataclass(frozen=True)
class SerialParallelogram:
    """Body A turns all about the vertical; B is the upper arm, and C turns the forearm by a parallelogram.

    B and C are absolute angles from the vertical, so the upper arm does not turn the forearm:

        r = lb sin B + lc sin C,   x = r cos A - ox,   y = r sin A - oy,   z = ln + lb cos B - lc cos C - oz
    """

    ln: float  # height of the shoulder [m]
    lb: float  # length of the upper arm [m]
    lc: float  # length of the forearm [m]
    origin: Vector  # middle of the workspace from the foot of the vertical axis [m]
    # Of upper arm and forearm [kg], and their centres from shoulder and elbow [m]; empty if not published.
    masses: Sequence[float] = ()

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
        up, forth = z - self.ln, hypot(x, y)
        reach, elevation = hypot(forth, up), atan2(forth, up)  # from the vertical
        b = elevation - _beside(self.lb, reach, self.lc)
        return (atan2(y, x), b, pi - (elevation + _beside(self.lc, reach, self.lb)))

    def forearm(self, angles: Angles) -> float:
        """Elevation of the last link over the horizontal [rad]."""
        return angles[2] - 0.5 * pi

    def weight(self, angles: Angles) -> Triple:
        """Torques that hold the links still [N m]; heights of the masses: z_b = r_b cos B, z_c = lb cos B - r_c cos C.

        Derived here. The two published formulas (CWoodenDevice.cpp, hfab_kinematics.cpp) differ in sign from each
        other, each has one of the two signs wrong, and their makers ship both switched off (`g_constant` 0).
        """
        (mass_b, mass_c, centre_b, centre_c), (_, b, c) = self.masses, angles
        upper = mass_b * centre_b + mass_c * self.lb
        return (0.0, -GRAVITY_M_S2 * upper * sin(b), GRAVITY_M_S2 * mass_c * centre_c * sin(c))


@dataclass(frozen=True)
class SpatialFiveBar:
    """Body A turns a vertical plane about the vertical; B and C drive a five-bar linkage within it.

    In that plane, u outwards and v up, with e(t) = (cos t, sin t): the upper arm ends at B = (l0/2, 0) + l1 e(t2), the
    crank at D = (-l0/2, 0) + l2 e(t3). The forearm goes from C = B - l4 e(lam) through B to the tip B + l5 e(lam), and
    the coupler between C and D has the length l3, which gives lam. Of its two solutions the one with the coupler behind
    the upper arm is built.
    """

    l0: float  # between the two pivots on the body [m]
    l1: float  # upper arm [m]
    l2: float  # crank [m]
    l3: float  # coupler [m]
    l4: float  # forearm, behind its joint [m]
    l5: float  # forearm, before it [m]
    origin: Vector  # middle of the workspace from the middle between the pivots [m]
    # Of upper_arm, crank, coupler and forearm [kg], each with its centre along and across the link [m].
    masses: Mapping[str, Triple] = field(default_factory=dict)

    def position(self, angles: Angles) -> Vector:
        a, t2, lam = angles[0], angles[1], self.forearm(angles)
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
        lam = self.forearm(angles)
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
        return ((-sin_a * u, cos_a * u_2, cos_a * u_3), (cos_a * u, sin_a * u_2, sin_a * u_3), (0.0, v_2, v_3))

    def inverse(self, position: Vector) -> Angles:
        """The pose with elbow up, tip in front of the vertical axis, crank behind the line from its pivot to C."""
        x, y, v = (p + o for p, o in zip(position, self.origin, strict=True))
        u, half = hypot(x, y), 0.5 * self.l0
        t2 = atan2(v, u - half) + _beside(self.l1, hypot(u - half, v), self.l5)
        b_u, b_v = half + self.l1 * cos(t2), self.l1 * sin(t2)
        lam = atan2(v - b_v, u - b_u)
        c_u, c_v = b_u - self.l4 * cos(lam) + half, b_v - self.l4 * sin(lam)
        t3 = atan2(c_v, c_u) + _beside(self.l2, hypot(c_u, c_v), self.l3)
        return (atan2(y, x), t2, t3)

    def forearm(self, angles: Angles) -> float:
        """Elevation lam of the last link over the horizontal [rad], from the triangle B, C, D."""
        _, t2, t3 = angles
        u = self.l2 * cos(t3) - self.l0 - self.l1 * cos(t2)
        v = self.l2 * sin(t3) - self.l1 * sin(t2)
        lam = atan2(v, u) - _beside(self.l4, hypot(u, v), self.l3) + pi
        return lam if lam <= pi else lam - 2.0 * pi

    def weight(self, angles: Angles) -> Triple:
        """Torques that hold the links still [N m], by differences as of the makers (polhemComputeMotorAmps)."""
        _, t2, t3 = angles
        half = 0.5 * STEP_RAD
        by_2 = self._energy(t2 + half, t3) - self._energy(t2 - half, t3)
        by_3 = self._energy(t2, t3 + half) - self._energy(t2, t3 - half)
        return (0.0, by_2 / STEP_RAD, by_3 / STEP_RAD)

    def _energy(self, t2: float, t3: float) -> float:
        """Potential energy over the pivots [J]."""
        lam = self.forearm((0.0, t2, t3))
        elbow, crank_end = self.l1 * sin(t2), self.l2 * sin(t3)
        across = self.l0 + self.l1 * cos(t2) - self.l4 * cos(lam) - self.l2 * cos(t3)
        coupler = atan2(elbow - self.l4 * sin(lam) - crank_end, across)
        links = {"upper_arm": (0.0, t2), "crank": (0.0, t3), "coupler": (crank_end, coupler), "forearm": (elbow, lam)}
        energy = 0.0
        for name, (begins_at, elevation) in links.items():
            mass, along, beside = self.masses[name]
            energy += mass * (begins_at + (along * sin(elevation) + beside * cos(elevation)))
        return GRAVITY_M_S2 * energy


Linkage = SerialParallelogram | SpatialFiveBar
"""Forward and inverse kinematics; every result is finite, and out of reach the inverse is the nearest pose."""


def _beside(near: float, far: float, opposite: float) -> float:
    """Angle between two sides of a triangle [rad]; the nearest possible where the third does not fit."""
    far = max(far, 1e-9)
    return acos(min(1.0, max(-1.0, (near**2 + far**2 - opposite**2) / (2.0 * near * far))))


@dataclass(frozen=True)
class Wiring:
    """The signs and home counts of a mechanism on one kind of board.

    The signs, +1 or -1 for each of A, B and C, are independent: that of an encoder depends on its wiring and on the
    counting table of the firmware, that of a motor on its wiring and on the amplifier. The firmware with reports of 14
    bytes has the reversed table of the one with 8. `home_counts` are what the encoders would read in the home pose if
    their zero were that of the angles.
    """

    encoder: Signs
    motor: Signs
    home_counts: Counts
    gimbal: Signs = (1, 1, 1)
    gimbal_home_counts: Counts = (0, 0, 0)


@dataclass(frozen=True)
class Mechanism:
    """A linkage on cable drives, on one kind of board, and what its makers publish about it.

    angle_i = e_i 2 pi (count_i + home_i) / N_i c_i / b_i, and I_i = m_i torque_i c_i / b_i / Kt_i, with the signs e and
    m of encoders and motors in `wiring`, the diameters c of the capstans on the motors and b on the bodies, N counts a
    turn of a motor, all edges counted, and the torque constants Kt. Counts are relative to the home pose, and those of
    the gimbal may follow.
    """

    name: str
    linkage: Linkage
    wirings: Mapping[Board, Wiring]
    wiring: Wiring  # one of those, or as the options of a driver say
    capstan_m: Triple
    body_m: Triple
    counts_per_turn: Counts
    torque_constant_n_m_a: Triple
    force_n: float
    stiffness_n_m: float  # of the stiffest spring that it shows stably
    radius_m: float  # of the workspace about its middle
    gimbal_counts_per_turn: Counts = (0, 0, 0)  # in the order of the gimbal's axes, 0 for no sensor
    gimbal_axes: str = "xyx"  # from the forearm on
    gimbal_reversed_over_hid: bool = False  # its counters come last to first on the boards that speak HID
    warnings: tuple[str, ...] = ()

    @cached_property
    def radians_per_count(self) -> Triple:
        """Angle of each body per count [rad]; negative where the encoder's direction is."""
        rows = zip(self.wiring.encoder, self.counts_per_turn, self.capstan_m, self.body_m, strict=True)
        a, b, c = (direction * tau / counts * (capstan / body) for direction, counts, capstan, body in rows)
        return (a, b, c)

    @cached_property
    def ma_per_n_m(self) -> Triple:
        """Current for a torque on the body [mA/(N m)]; negative where the motor's direction is."""
        rows = zip(self.wiring.motor, self.capstan_m, self.body_m, self.torque_constant_n_m_a, strict=True)
        a, b, c = (direction * (capstan / body) / kt * MA_PER_A for direction, capstan, body, kt in rows)
        return (a, b, c)

    @property
    def has_gimbal(self) -> bool:
        """Whether all three sensors of the orientation are there."""
        return 0 not in self.gimbal_counts_per_turn

    @property
    def reach_m(self) -> float:
        """Farthest plausible distance of the handle from the middle along any axis [m]: its home pose is within."""
        return max(2.0 * self.radius_m, max(map(abs, self.position((0, 0, 0)))) + BEYOND_HOME_M)

    def angles(self, counts: Sequence[int]) -> Angles:
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.wiring.home_counts
        return (a * (counts[0] + home_a), b * (counts[1] + home_b), c * (counts[2] + home_c))

    def counts(self, angles: Angles) -> Counts:
        """The nearest counts for angles."""
        (a, b, c), (home_a, home_b, home_c) = self.radians_per_count, self.wiring.home_counts
        return (round(angles[0] / a) - home_a, round(angles[1] / b) - home_b, round(angles[2] / c) - home_c)

    def position(self, counts: Sequence[int]) -> Vector:
        """Position of the handle [m]."""
        return self.linkage.position(self.angles(counts))

    def currents_ma(self, force: Vector, counts: Sequence[int]) -> Triple:
        """Currents that put a force on the hand [N], by tau = J^T F; finite in every pose, but not limited here."""
        (xa, xb, xc), (ya, yb, yc), (za, zb, zc) = self.linkage.jacobian(self.angles(counts))
        (a, b, c), (fx, fy, fz) = self.ma_per_n_m, force
        return (a * (xa * fx + ya * fy + za * fz), b * (xb * fx + yb * fy + zb * fz), c * (xc * fx + yc * fy + zc * fz))

    def limited_currents_ma(self, force: Vector, counts: Sequence[int], force_n: float, current_ma: float) -> Counts:
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
        a, b, c = self.ma_per_n_m
        return self._tip_force((currents_ma[0] / a, currents_ma[1] / b, currents_ma[2] / c), self.angles(counts))

    def carrying_force(self, counts: Sequence[int]) -> Vector:
        """The force at the handle [N] that carries the links against gravity; zero without published masses."""
        angles = self.angles(counts)
        return self._tip_force(self.linkage.weight(angles), angles) if self.linkage.masses else ZERO

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
        return self.counts(self.linkage.inverse(position))

    def orientation(self, counts: Sequence[int]) -> Quaternion | None:
        """R = Rz(A) Ry(-lam) R(D) R(E) R(F) with the forearm's elevation lam; None without a whole gimbal.

        Its authors mark the formula as in need of verification.
        """
        if len(counts) < 6 or not self.has_gimbal:
            return None
        angles = self.angles(counts)
        turned = product(_turn("z", angles[0]), _turn("y", -self.linkage.forearm(angles)))
        wiring = self.wiring
        gimbal = zip(wiring.gimbal, counts[3:], wiring.gimbal_home_counts, self.gimbal_counts_per_turn, strict=True)
        for axis, (direction, count, home, per_turn) in zip(self.gimbal_axes, gimbal, strict=True):
            turned = product(turned, _turn(axis, direction * (count + home) * tau / per_turn))
        return turned


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _turn(axis: str, angle: float) -> Quaternion:
    half = sin(0.5 * angle)
    return (cos(0.5 * angle), half * (axis == "x"), half * (axis == "y"), half * (axis == "z"))
