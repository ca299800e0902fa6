"""Control of position and orientation of an end effector as one spring and one damper. Knows no time and no contact."""

from math import pi

import mujoco
import numpy as np

from weberlink.geometry.rotation import Quaternion, inverse, product, unit_quaternion, vector
from weberlink.geometry.vector import Vector
from weberlink.slave.robots.mjcf.impedance import IMMOBILE
from weberlink.slave.robots.mjcf.plant import Array, Plant
from weberlink.slave.robots.mjcf.posture import Posture

STILL_ALIKE = 0.9986
"""Cosine of half the angle by which it may have turned since its damping was worked out: 6 degrees."""


class PoseImpedance:
    """tau = J^T (K e - D J v) + bias with the 6 rows of J, and what the posture takes of the joints left over.

    e is the way to the commanded position and the rotation vector to the commanded orientation, K the stiffness of
    each: the torque is that of the spring k |e|^2 / 2 (Hogan 1985). D gives every mode of the end effector the same
    damping ratio r: with W the modes of K^(1/2) (J M^-1 J^T) K^(1/2) and w their frequencies, D = K^(1/2) W (2 r / w)
    W^T K^(1/2), which is what `Impedance` has where all stiffnesses are alike. A mode that cannot move has no damper.
    A tool that is long and thin has another inertia about every axis of the world once it is turned, so D is worked
    out anew wherever it has turned by 6 degrees.

    Attributes:
        fastest: frequency of the quickest mode at home [rad/s].
        lags: by which the modes follow a ramp at home, the shortest first [s].
        strength: what it holds with, for a person.
    """

    def __init__(self, plant: Plant, stiffnesses: tuple[float, float], damping_ratio: float, posture_hz: float) -> None:
        """Take the orientation where the plant is now, which is home.

        Args:
            plant: what is moved, with the rows for turning.
            stiffnesses: of the position [N/m] and of the orientation [N m/rad].
            damping_ratio: r.
            posture_hz: natural frequency of the joints left over.
        """
        along, about = stiffnesses
        self._roots = np.sqrt([along] * 3 + [about] * 3)
        self._ratio = damping_ratio
        self._plant = plant
        self._turned = np.zeros(4)
        self._home = self._damped_at = self._orientation()
        frequencies, self._damping = self._modes()
        self.fastest = float(frequencies[-1])
        self.lags: list[float] = (2.0 * damping_ratio / frequencies[::-1]).tolist()
        self.strength = f"{along:g} N/m and {about:g} N m/rad"
        self._along, self._about = along, about
        self._goal = self._home
        self._speed = plant.data.qvel
        self._wrench, self._twist = np.zeros(6), np.zeros(6)
        self._torque: Array = np.zeros(plant.model.nv)
        dofs = plant.dofs
        self._of_robot = self._torque[dofs]
        self._bias = plant.data.qfrc_bias[dofs]
        self._applied = plant.data.qfrc_applied[dofs]
        redundant = dofs.stop - dofs.start > len(frequencies)
        self._posture = Posture(plant, plant.inverse_mass(), posture_hz) if redundant and posture_hz > 0.0 else None

    def reset(self) -> None:
        """The plant is at home again, and is to stay so."""
        self._goal = self._home
        if self._damped_at != self._home:
            self._damped_at, (_, self._damping) = self._home, self._modes()

    def point(self, orientation: Quaternion) -> None:
        """The orientation to turn to, from that at home, axes of the world.

        Raises:
            ValueError: if it is none; the last one stays.
        """
        held = unit_quaternion(orientation)
        if held is None:
            raise ValueError(f"mujoco: commanded an orientation that is none: {orientation}")
        self._goal = product(held, self._home)

    def too_strong(self, excess: float) -> str:
        """What is wrong with stiffnesses of which one is too much by this factor."""
        return (
            f"stiffness_n_m, rotation.stiffness_n_m_rad: with them the end effector swings at "
            f"{self.fastest / (2.0 * pi):.2g} Hz, too much for its mass or its inertia; "
            f"divide the one that does by {1.05 * excess:.2g}"
        )

    def apply(self, commanded: Vector) -> None:
        """Set the torques of the robot's joints for the state that the plant was last refreshed in."""
        plant, wrench, k = self._plant, self._wrench, self._along
        x, y, z = plant.position.tolist()
        turned = self._orientation()
        turn = vector(product(self._goal, inverse(turned)))
        wrench[0], wrench[1], wrench[2] = k * (commanded[0] - x), k * (commanded[1] - y), k * (commanded[2] - z)
        k = self._about
        wrench[3], wrench[4], wrench[5] = k * turn[0], k * turn[1], k * turn[2]
        (aw, ax, ay, az), (bw, bx, by, bz) = turned, self._damped_at
        if abs(aw * bw + ax * bx + ay * by + az * bz) < STILL_ALIKE:
            self._damped_at, (_, self._damping) = turned, self._modes()
        plant.twist.dot(self._speed, self._twist)
        wrench -= self._damping.dot(self._twist)
        wrench.dot(plant.twist, self._torque)
        np.add(self._of_robot, self._bias, self._applied)
        if self._posture is not None:
            self._applied += self._posture.torque()

    def _modes(self) -> tuple[Array, Array]:
        """Frequencies of what can move, the slowest first [rad/s], and D, both in the pose of the last `refresh`."""
        plant, roots = self._plant, self._roots
        mobility = plant.twist @ plant.inverse_mass() @ plant.twist.T
        squares, modes = np.linalg.eigh(roots[:, None] * mobility * roots)
        free = squares > IMMOBILE * squares[-1]
        frequencies = np.sqrt(squares[free])
        shapes = roots[:, None] * modes[:, free]
        return frequencies, (shapes * (2.0 * self._ratio / frequencies)) @ shapes.T

    def _orientation(self) -> Quaternion:
        mujoco.mju_mat2Quat(self._turned, self._plant.turned)
        w, x, y, z = self._turned.tolist()
        return (w, x, y, z)
