"""Torques of the joints: a spring and a damper at the tip, a posture, and walls before the limits of the joints."""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.rotation import Quaternion, inverse, product, vector
from weberlink.geometry.vector import ZERO, Vector, norm, scale
from weberlink_franka.options import FrankaOptions

Array = NDArray[np.float64]

JOINTS: Final = 7
LOWEST: Final = np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159])
HIGHEST: Final = np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159])
"""Limits of the joints of the FR3 [rad] (frankarobotics.github.io/docs/control_parameters.html)."""
STRONGEST: Final = np.array([87.0] * 4 + [12.0] * 3)  # limits of the torques [N m] (ibid.)
MARGIN_RAD: Final = 0.12  # the wall of a joint begins so far before its limit
WALL_N_M_RAD: Final = np.array([150.0] * 4 + [60.0] * 3)
WALL_N_M_S: Final = np.array([10.0] * 4 + [2.0] * 3)  # stiffness and damping of that wall
TORQUE_STEP_N_M: Final = 0.999
"""Largest change of a torque in a cycle of 1 ms: the robot allows 1000 N m/s (libfranka, rate_limiting.h)."""
ROTOR_KG_M2: Final = np.array([0.195] * 4 + [0.074] * 3)
"""Inertia of the rotors at their joints, which the model of libfranka leaves out; as the MuJoCo Menagerie has it."""
SINGULAR: Final = 1e-3
"""Share of the largest mobility that is added to all, so that no direction counts as infinitely heavy."""


class Joints(NamedTuple):
    """Of the robot in one cycle: position and speed of the joints [rad, rad/s], Jacobian of the tip (6, 7) in the base
    frame, and torques of the velocity terms [N m]."""

    q: Array
    dq: Array
    jacobian: Array
    coriolis: Array


class Impedance:
    """tau = J^T (K e - D J dq) + coriolis + posture + walls (Hogan 1985).

    e is the offset of the goal from the tip and the rotation vector to the goal. The force and the torque of the spring
    are bounded. D damps place and orientation apart, so that a turn does not push the tip aside: with W the modes of
    k J M^-1 J^T for the rows J of either, and w their frequencies, D = W (2 r k / w) W^T gives each mode the damping
    ratio r. The posture draws the joints to where they
    were at opening, in the dynamically consistent null space (Khatib 1987), so it does not move the tip: with n the
    motion of the joints that J does not see, an acceleration a of the joints becomes M n (n^T M a) / (n^T M n). M is
    that of the model with the inertia of the rotors; M, D and n change slowly, and `refresh` computes them anew. `q` is
    the position of the joints to return to [rad].
    """

    def __init__(self, options: FrankaOptions, q: Array) -> None:
        self._force, self._torque = options.force_n, options.turning_n_m
        self._stiffness = options.stiffness_n_m, options.stiffness_n_m_rad
        self._ratio = options.damping_ratio
        self._omega = 2.0 * np.pi * options.posture_hz
        self._home = q
        self._low, self._high = LOWEST + MARGIN_RAD, HIGHEST - MARGIN_RAD
        self._damping: Array = np.zeros((6, 6))
        self._share: Array = np.zeros(JOINTS)
        self._torque_of_share: Array = np.zeros(JOINTS)
        self._wrench = np.zeros(6)
        self.spring: Vector = ZERO  # its force at the last `torques` [N]

    def refresh(self, mass: Array, jacobian: Array) -> None:
        """Take the inertia of this posture: mass matrix of the model (7, 7) [kg m^2], Jacobian of the tip (6, 7)."""
        inertia = mass + np.diag(ROTOR_KG_M2)
        mobility = jacobian @ np.linalg.inv(inertia) @ jacobian.T
        for block, stiffness in zip((slice(0, 3), slice(3, 6)), self._stiffness, strict=True):
            squares, modes = np.linalg.eigh(stiffness * mobility[block, block])
            frequencies = np.sqrt(np.maximum(squares, SINGULAR * squares[-1]))
            self._damping[block, block] = (modes * (2.0 * self._ratio * stiffness / frequencies)) @ modes.T
        free: Array = np.linalg.svd(jacobian)[2][-1]
        self._share = inertia @ free
        self._torque_of_share = self._share / (free @ self._share)

    def torques(self, joints: Joints, offset: Vector, turn: Quaternion) -> Array:
        """Of the joints, without gravity and not yet bounded [N m]; `offset` is that of the goal from the tip [m],
        `turn` leads from the tool's orientation to the goal's, in the base frame.
        """
        along, about = self._stiffness
        wrench, jacobian = self._wrench, joints.jacobian
        self.spring = bounded(scale(offset, along), self._force)
        wrench[:3] = self.spring
        wrench[3:] = bounded(scale(vector(turn), about), self._torque)
        wrench -= self._damping.dot(jacobian.dot(joints.dq))
        torques: Array = wrench.dot(jacobian)
        torques += joints.coriolis
        torques += self._posture(joints)
        torques += self._walls(joints)
        return torques

    def _posture(self, joints: Joints) -> Array:
        wanted = (self._home - joints.q) * (self._omega * self._omega) - joints.dq * (2.0 * self._omega)
        torque: Array = self._torque_of_share * self._share.dot(wanted)
        return torque

    def _walls(self, joints: Joints) -> Array:
        q, dq = joints.q, joints.dq
        deep = np.maximum(self._low - q, 0.0) - np.maximum(q - self._high, 0.0)
        torque: Array = WALL_N_M_RAD * deep - WALL_N_M_S * dq * (deep * dq < 0.0)
        return torque


def bounded(wrench: Vector, most: float) -> Vector:
    """A force or torque, shortened to this length."""
    length = norm(wrench)
    return wrench if length <= most else scale(wrench, most / length)


def permitted(torques: Array, last: Array) -> Array:
    """The torques nearest to these that the robot takes after the last ones [N m]."""
    allowed = np.minimum(np.maximum(torques, -STRONGEST), STRONGEST)
    steps: Array = np.minimum(np.maximum(allowed, last - TORQUE_STEP_N_M), last + TORQUE_STEP_N_M)
    return steps


def turn_between(start: Quaternion, goal: Quaternion) -> Quaternion:
    """From one orientation to another, in the base frame."""
    return product(goal, inverse(start))


def orientation_of(pose: list[float]) -> Quaternion:
    """The unit quaternion of a homogeneous transform, 16 numbers, column by column (Shepperd 1978)."""
    xx, yx, zx, _, xy, yy, zy, _, xz, yz, zz, *_ = pose
    largest = max(xx + yy + zz, xx, yy, zz)
    if largest == xx + yy + zz:
        w = sqrt(1.0 + largest)
        return _unit((w * w, zy - yz, xz - zx, yx - xy))
    if largest == xx:
        x = 1.0 + xx - yy - zz
        return _unit((zy - yz, x, xy + yx, xz + zx))
    if largest == yy:
        y = 1.0 - xx + yy - zz
        return _unit((xz - zx, xy + yx, y, yz + zy))
    z = 1.0 - xx - yy + zz
    return _unit((yx - xy, xz + zx, yz + zy, z))


def _unit(q: Quaternion) -> Quaternion:
    w, x, y, z = q
    factor = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (w * factor, x * factor, y * factor, z * factor)
