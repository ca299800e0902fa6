"""Control of an end effector as a spring and damper of place and orientation, and of redundant joints."""

from collections.abc import Sequence
from math import pi

import mujoco
import numpy as np

from weberlink.geometry.rotation import Quaternion, inverse, product, unit_quaternion, vector
from weberlink.geometry.vector import Vector
from weberlink_mujoco.arms.models import Array
from weberlink_mujoco.robot.plant import Plant

IMMOBILE = 1e-6  # a direction whose mobility is less than this share of the largest counts as blocked
STILL_ALIKE = 0.9986  # cosine of half the angle (6 degrees) by which it may turn before its damping is computed anew


class PostureControl:
    """Draws redundant joints home, critically damped, without accelerating the end effector.

    tau = M a - J^T Lambda J a with a = -w^2 (q - q_home) - 2 w v: the dynamically consistent null space (Khatib 1987),
    with the mass matrix at home. A null-space torque does no work on the end effector, so the force at rest is that of
    the impedance.
    """

    def __init__(self, plant: Plant, inverse_mass: Array, frequency_hz: float) -> None:
        dofs = plant.dofs
        self._plant = plant
        self._omega = 2.0 * pi * frequency_hz
        self._inverse = np.ascontiguousarray(inverse_mass[dofs, dofs])
        self._mass = np.linalg.inv(self._inverse)
        self._home = plant.home
        self._away: Array = np.zeros(plant.model.nv)
        self._away_of_robot = self._away[dofs]
        self._speed = plant.data.qvel[dofs]
        self._jacobian = plant.twist[:, dofs]
        mobility = self._jacobian @ self._inverse @ self._jacobian.T
        self._floor = 1e-9 * mobility.trace() * np.eye(len(mobility))  # regularises blocked directions

    def torque(self) -> Array:
        """Of the robot's joints: [N m], or [N] for a slide joint."""
        plant, omega, jacobian = self._plant, self._omega, self._jacobian
        mujoco.mj_differentiatePos(plant.model, self._away, 1.0, self._home, plant.data.qpos)
        wanted = self._away_of_robot * (-omega * omega)
        wanted -= self._speed * (2.0 * omega)
        mobility = jacobian.dot(self._inverse).dot(jacobian.T)
        mobility += self._floor
        torque: Array = self._mass.dot(wanted)
        torque -= np.linalg.solve(mobility, jacobian.dot(wanted)).dot(jacobian)
        return torque


class Impedance:
    """wrench = K e - D J v with the rows J of the position, and of the rotation where it has a stiffness.

    e is the difference to the commanded position and the rotation vector to the commanded orientation, K the stiffness
    of each: the torque is that of the spring k |e|^2 / 2 (Hogan 1985). D gives every mode of the end effector the same
    damping ratio r: with W the modes of K^(1/2) (J M^-1 J^T) K^(1/2) and w their frequencies (Khatib 1987), D = K^(1/2)
    W (2 r / w) W^T K^(1/2). A blocked mode has no damper. The inertia of a long, thin tool about the axes of the world
    changes as it turns, so with a rotation D is computed anew every 6 degrees.

    Of a plant at home; `stiffnesses` are that of the position [N/m], and perhaps of the orientation [N m/rad],
    `posture_hz` the natural frequency of redundant joints, 0 for none.
    """

    def __init__(self, plant: Plant, stiffnesses: Sequence[float], damping_ratio: float, posture_hz: float) -> None:
        self._along, *self._about = stiffnesses
        self._roots = np.sqrt(np.repeat(stiffnesses, 3))
        self._ratio, self._plant = damping_ratio, plant
        self._turned = np.zeros(4)
        self._goal = self._home = self._damped_at = self._orientation()
        frequencies, self._damping = self._modes()
        self.fastest = float(frequencies[-1])  # frequency of the fastest mode at home [rad/s]
        # By which the modes follow a ramp at home, the shortest first [s]; and the stiffnesses, for a message.
        self.lags: list[float] = (2.0 * damping_ratio / frequencies[::-1]).tolist()
        self.strength = " and ".join(f"{k:g} {unit}" for k, unit in zip(stiffnesses, ("N/m", "N m/rad"), strict=False))
        self._speed = plant.data.qvel
        self._wrench, self._twist = np.zeros_like(self._roots), np.zeros_like(self._roots)
        dofs = plant.dofs
        self._torque: Array = np.zeros(plant.model.nv)
        self._of_robot = self._torque[dofs]
        self._bias, self._applied = plant.data.qfrc_bias[dofs], plant.data.qfrc_applied[dofs]
        redundant = dofs.stop - dofs.start > len(frequencies) and posture_hz > 0.0
        self._posture = PostureControl(plant, plant.inverse_mass(), posture_hz) if redundant else None

    def reset(self) -> None:
        """Hold the orientation at home again."""
        self._goal = self._home
        if self._damped_at != self._home:
            self._damped_at, (_, self._damping) = self._home, self._modes()

    def point(self, orientation: Quaternion) -> None:
        """Set the orientation to hold, from that at home, axes of the world; ValueError keeps the last one."""
        held = unit_quaternion(orientation)
        if held is None:
            raise ValueError(f"mujoco: commanded an orientation that is none: {orientation}")
        self._goal = product(held, self._home)

    def too_strong(self, excess: float) -> str:
        """Error message for a stiffness that is too large by this factor."""
        options, which = (
            ("stiffness_n_m, rotation.stiffness_n_m_rad", "one") if self._about else ("stiffness_n_m", "it")
        )
        hertz = self.fastest / (2.0 * pi)
        return f"{options}: the end effector swings at {hertz:.2g} Hz; divide {which} by at least {1.05 * excess:.2g}"

    def apply(self, commanded: Vector) -> None:
        """Set the joint torques for the state of the last `refresh` of the plant."""
        plant, wrench, k = self._plant, self._wrench, self._along
        x, y, z = plant.position.tolist()
        wrench[0], wrench[1], wrench[2] = k * (commanded[0] - x), k * (commanded[1] - y), k * (commanded[2] - z)
        for k in self._about:
            turned = self._orientation()
            turn = vector(product(self._goal, inverse(turned)))
            wrench[3], wrench[4], wrench[5] = k * turn[0], k * turn[1], k * turn[2]
            (aw, ax, ay, az), (bw, bx, by, bz) = turned, self._damped_at
            if abs(aw * bw + ax * bx + ay * by + az * bz) < STILL_ALIKE:
                self._damped_at, (_, self._damping) = turned, self._modes()
        plant.twist.dot(self._speed, self._twist)
        wrench -= self._damping.dot(self._twist)
        wrench.dot(plant.twist, self._torque)  # tau = J^T wrench + gravity and velocity terms + posture
        np.add(self._of_robot, self._bias, self._applied)
        if self._posture is not None:
            self._applied += self._posture.torque()

    def _modes(self) -> tuple[Array, Array]:
        """Frequencies of the free modes, the slowest first [rad/s], and D, at the last `refresh` of the plant."""
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
