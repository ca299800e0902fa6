"""Position control of an end effector as a spring and a damper in Cartesian space. Knows no time and no contact."""

from math import sqrt

import numpy as np

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.mjcf.plant import Array, Plant
from weberlink.slave.robots.mjcf.posture import Posture

IMMOBILE = 1e-6
"""A direction in which the end effector moves this much less readily than in the freest has no mobility."""


class Impedance:
    """tau = J^T (k (commanded - x) - D J v) + bias (Hogan 1985), and what the posture takes of the joints left over.

    Gravity and velocity terms are compensated exactly. D = 2 r sqrt(k) Lambda^(1/2) with the mass Lambda that the end
    effector has at home (Khatib 1987), so the damping ratio is r in every direction there; it is not worked out anew
    on the way. A direction in which the end effector cannot move has neither spring nor damper.

    Attributes:
        masses_kg: what the end effector weighs at home in its lightest and in its heaviest direction.
        lags: by which it follows a ramp in these directions [s].
        fastest: frequency of the lightest [rad/s].
        strength: what it holds, and with how much, for a person.
    """

    def __init__(self, plant: Plant, stiffness: float, damping_ratio: float, posture_hz: float) -> None:
        """Take the mass where the plant is now, which is home.

        Args:
            plant: what is moved.
            stiffness: k [N/m].
            damping_ratio: r.
            posture_hz: natural frequency of the joints left over.
        """
        inverse = plant.inverse_mass()
        mobility, directions = np.linalg.eigh(plant.jacobian @ inverse @ plant.jacobian.T)
        free = mobility > IMMOBILE * mobility[-1]
        roots = np.zeros(3)
        roots[free] = mobility[free] ** -0.5
        damping = 2.0 * damping_ratio * sqrt(stiffness) * (directions * roots) @ directions.T
        self.masses_kg = (1.0 / float(mobility[-1]), 1.0 / float(mobility[free][0]))
        self.lags = [2.0 * damping_ratio * sqrt(mass / stiffness) for mass in self.masses_kg]
        self.fastest = sqrt(stiffness / self.masses_kg[0])
        least, most = (format(mass, ".2g") for mass in self.masses_kg)
        self.strength = f"{stiffness:g} N/m on {least if least == most else f'{least} to {most}'} kg"
        self._stiffness = stiffness
        (self._xx, self._xy, self._xz), (_, self._yy, self._yz), (_, _, self._zz) = damping.tolist()
        self._plant = plant
        self._speed = plant.data.qvel
        self._velocity = np.zeros(3)
        self._force = np.zeros(3)
        self._torque: Array = np.zeros(plant.model.nv)
        dofs = plant.dofs
        self._of_robot = self._torque[dofs]
        self._bias = plant.data.qfrc_bias[dofs]
        self._applied = plant.data.qfrc_applied[dofs]
        redundant = dofs.stop - dofs.start > int(np.count_nonzero(free))
        self._posture = Posture(plant, inverse, posture_hz) if redundant and posture_hz > 0.0 else None

    def too_strong(self, excess: float) -> str:
        """What is wrong with a stiffness that is too much by this factor."""
        stiffness = self._stiffness
        return (
            f"stiffness_n_m: {stiffness:g} is too much for the {self.masses_kg[0]:.2g} kg of the end effector; "
            f"use at most {0.95 * stiffness / excess:.2g}"
        )

    def apply(self, commanded: Vector) -> None:
        """Set the torques of the robot's joints for the state that the plant was last refreshed in."""
        plant, k, force = self._plant, self._stiffness, self._force
        x, y, z = plant.position.tolist()
        u, v, w = plant.jacobian.dot(self._speed, self._velocity).tolist()
        force[0] = k * (commanded[0] - x) - self._xx * u - self._xy * v - self._xz * w
        force[1] = k * (commanded[1] - y) - self._xy * u - self._yy * v - self._yz * w
        force[2] = k * (commanded[2] - z) - self._xz * u - self._yz * v - self._zz * w
        force.dot(plant.jacobian, self._torque)
        np.add(self._of_robot, self._bias, self._applied)
        if self._posture is not None:
            self._applied += self._posture.torque()
