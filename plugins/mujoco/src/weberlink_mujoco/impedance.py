"""Position control of an end effector as a Cartesian spring and damper, and control of redundant joints."""

from math import pi, sqrt

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink_mujoco.plant import Array, Plant

IMMOBILE = 1e-6
"""A direction whose mobility is less than this share of the largest counts as blocked."""


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


class JointTorques:
    """Applies a force or wrench at the end effector, compensates gravity and velocity terms, and adds the posture.

    Args:
        plant: What is moved, at home.
        free: How many directions the control holds; more joints than that are redundant.
        posture_hz: Natural frequency of redundant joints; 0 for none.
    """

    def __init__(self, plant: Plant, free: int, posture_hz: float) -> None:
        dofs = plant.dofs
        self._torque: Array = np.zeros(plant.model.nv)
        self._of_robot = self._torque[dofs]
        self._bias = plant.data.qfrc_bias[dofs]
        self._applied = plant.data.qfrc_applied[dofs]
        redundant = dofs.stop - dofs.start > free
        self._posture = (
            PostureControl(plant, plant.inverse_mass(), posture_hz) if redundant and posture_hz > 0 else None
        )

    def apply(self, wrench: Array, jacobian: Array) -> None:
        """Set tau = J^T wrench + bias + posture."""
        wrench.dot(jacobian, self._torque)
        np.add(self._of_robot, self._bias, self._applied)
        if self._posture is not None:
            self._applied += self._posture.torque()


class Impedance:
    """f = k (commanded - x) - D v (Hogan 1985).

    D = 2 r sqrt(k) Lambda^(1/2) with the apparent mass Lambda of the end effector at home (Khatib 1987), so the damping
    ratio is r in every direction there; D is constant. A blocked direction has neither spring nor damper.

    Args:
        plant: What is moved, at home.
        stiffness: k [N/m].
        damping_ratio: r.
        posture_hz: Natural frequency of redundant joints.

    Attributes:
        lags: By which it follows a ramp in the lightest and in the heaviest direction [s].
        fastest: Frequency of the lightest direction [rad/s].
        strength: Stiffness and apparent masses, for a message.
    """

    def __init__(self, plant: Plant, stiffness: float, damping_ratio: float, posture_hz: float) -> None:
        mobility, directions = np.linalg.eigh(plant.jacobian @ plant.inverse_mass() @ plant.jacobian.T)
        free = mobility > IMMOBILE * mobility[-1]
        roots = np.zeros(3)
        roots[free] = mobility[free] ** -0.5
        damping = 2.0 * damping_ratio * sqrt(stiffness) * (directions * roots) @ directions.T
        masses = (1.0 / float(mobility[-1]), 1.0 / float(mobility[free][0]))
        self._lightest_kg = masses[0]
        self.lags = [2.0 * damping_ratio * sqrt(mass / stiffness) for mass in masses]
        self.fastest = sqrt(stiffness / masses[0])
        least, most = (format(mass, ".2g") for mass in masses)
        self.strength = f"{stiffness:g} N/m on {least if least == most else f'{least} to {most}'} kg"
        self._stiffness = stiffness
        (self._xx, self._xy, self._xz), (_, self._yy, self._yz), (_, _, self._zz) = damping.tolist()
        self._plant = plant
        self._speed = plant.data.qvel
        self._velocity = np.zeros(3)
        self._force = np.zeros(3)
        self._joints = JointTorques(plant, int(np.count_nonzero(free)), posture_hz)

    def too_strong(self, excess: float) -> str:
        """Error message for a stiffness that is too large by this factor."""
        stiffness = self._stiffness
        return (
            f"stiffness_n_m: {stiffness:g} is too much for the {self._lightest_kg:.2g} kg of the end effector; "
            f"use at most {0.95 * stiffness / excess:.2g}"
        )

    def apply(self, commanded: Vector) -> None:
        """Set the joint torques for the state of the last `refresh` of the plant."""
        plant, k, force = self._plant, self._stiffness, self._force
        x, y, z = plant.position.tolist()
        u, v, w = plant.jacobian.dot(self._speed, self._velocity).tolist()
        force[0] = k * (commanded[0] - x) - self._xx * u - self._xy * v - self._xz * w
        force[1] = k * (commanded[1] - y) - self._xy * u - self._yy * v - self._yz * w
        force[2] = k * (commanded[2] - z) - self._xz * u - self._yz * v - self._zz * w
        self._joints.apply(force, plant.jacobian)
