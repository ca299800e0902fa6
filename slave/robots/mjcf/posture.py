"""What a robot does with joints that the end effector leaves over, and the pose in which it reaches a point."""

from math import inf, pi

import mujoco
import numpy as np

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.mjcf.plant import Array, Plant

CLOSE_ENOUGH = 1e-6
"""A point counts as reached [m]."""
ROUNDS = 500
LONGEST_STRIDE = 0.02
"""Of the end effector in one round of the search [m]."""


class Posture:
    """Draws the joints home, critically damped, in so far as that does not accelerate the end effector.

    tau = M a - J^T Lambda J a with a = -w^2 (q - q_home) - 2 w v: the dynamically consistent null space (Khatib 1987),
    with the mass matrix of home throughout. A torque of the null space does no work on the end effector, whatever mass
    is taken, so the force that it exerts at rest is that of the impedance.
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
        self._floor = 1e-9 * mobility.trace() * np.eye(len(mobility))  # for directions in which it cannot move

    def torque(self) -> Array:
        """Of the robot's joints [N m], or [N] where they slide."""
        plant, omega, jacobian = self._plant, self._omega, self._jacobian
        mujoco.mj_differentiatePos(plant.model, self._away, 1.0, self._home, plant.data.qpos)
        wanted = self._away_of_robot * (-omega * omega)
        wanted -= self._speed * (2.0 * omega)
        mobility = jacobian.dot(self._inverse).dot(jacobian.T)
        mobility += self._floor
        torque: Array = self._mass.dot(wanted)
        torque -= np.linalg.solve(mobility, jacobian.dot(wanted)).dot(jacobian)
        return torque


def settle(plant: Plant, goal: Vector) -> None:
    """Make a pose in which the end effector is at `goal` [m] the plant's home.

    Found from the pose that it is in, by damped least squares.

    Raises:
        ValueError: if no such pose is found within the limits of its joints.
    """
    model, data, dofs = plant.model, plant.data, plant.dofs
    target = np.array(goal)
    turn: Array = np.zeros(model.nv)
    nearest = inf
    for _ in range(ROUNDS):
        missing = target - plant.position
        length = float(np.linalg.norm(missing))
        nearest = min(nearest, length)
        if length < CLOSE_ENOUGH:
            break
        jacobian = plant.jacobian[:, dofs]
        square = jacobian @ jacobian.T
        square.flat[::4] += 1e-6 * square.trace()
        stride = missing * min(1.0, LONGEST_STRIDE / length)
        turn[dofs] = jacobian.T @ np.linalg.solve(square, stride)
        mujoco.mj_integratePos(model, data.qpos, turn, 1.0)
        _keep_limits(plant)
        plant.refresh()
    else:
        raise ValueError(f"home_m: the end effector comes no closer than {nearest:.2g} m to {list(goal)}")
    plant.home[:] = data.qpos
    plant.reset()


def _keep_limits(plant: Plant) -> None:
    model, qpos = plant.model, plant.data.qpos
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    for joint in np.flatnonzero(model.jnt_limited):
        if int(model.jnt_type[joint]) in simple:
            address = model.jnt_qposadr[joint]
            qpos[address] = np.clip(qpos[address], *model.jnt_range[joint])
