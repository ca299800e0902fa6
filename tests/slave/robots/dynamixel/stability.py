"""The arm and its impedance near rest, as one linear map from cycle to cycle: the worst of what a bus may do."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from weberlink.slave.robots.dynamixel.arm import ROTOR_INERTIA_KG_M2, VISCOUS_N_M_S, Joints, arm_pose, inverse_nearest
from weberlink.slave.robots.dynamixel.impedance import ImpedanceGains, joint_torques
from weberlink.slave.robots.dynamixel.options import DynamixelOptions

Matrix = NDArray[np.float64]


def workspace(count: int = 3) -> Iterator[Joints]:
    """Joint angles over the default workspace, at two pitches."""
    low, high = DynamixelOptions().workspace_m
    axes = [np.linspace(a, b, count) for a, b in zip(low, high, strict=True)]
    for x in axes[0]:
        for z in axes[2]:
            for pitch in (0.0, 0.8):
                joints = inverse_nearest((float(x), 0.03, float(z)), pitch)
                assert joints is not None
                yield joints


def largest_eigenvalue(
    joints: Joints,
    gains: ImpedanceGains,
    period: float,
    *,
    rotor: float = ROTOR_INERTIA_KG_M2,
    torque: float = 1.0,
    viscous: float = 0.0,
    wall: float = 0.0,
) -> float:
    """Of the map over a cycle, where currents act a whole period after what they answer was measured.

    Args:
        joints: about which the arm moves a little [rad].
        gains: of the impedance.
        period: of the cycle [s].
        rotor: inertia that each motor really has at its joint [kg m^2]; the gains say what the damping takes it to be.
        torque: that an ampere really makes, over what it is taken for.
        viscous: factor on the friction of the joints.
        wall: stiffness of a floor that the tip is in [N/m].
    """
    mass = _mass(joints, rotor)
    up = np.array(arm_pose(joints).jacobian()[2])
    springs = wall * np.outer(up, up)
    friction = viscous * np.diag(VISCOUS_N_M_S)
    inverse = np.linalg.inv(mass)
    motion = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ springs, -inverse @ friction]])
    drive = np.vstack([np.zeros((4, 4)), inverse])
    held = _exponential(np.block([[motion, drive], [np.zeros((4, 12))]]) * period)
    step = np.block([[held[:8, :8], held[:8, 8:]], [torque * _feedback(joints, gains), np.zeros((4, 4))]])
    return float(max(abs(np.linalg.eigvals(step))))


def _feedback(joints: Joints, gains: ImpedanceGains) -> Matrix:
    """Torques over angles and rates, by differences of the impedance itself, gravity known exactly."""
    here, step = arm_pose(joints), 1e-6

    def torques(moved: Matrix) -> Matrix:
        there = arm_pose(_four(np.array(joints) + moved[:4]))
        given = joint_torques(there, _four(moved[4:]), here.tip, here.pitch, gains)
        return np.array([torque - weight for torque, weight in zip(given, there.gravity, strict=True)])

    differences: Matrix = np.array([torques(step * e) - torques(-step * e) for e in np.eye(8)])
    return differences.T * (0.5 / step)


def _mass(joints: Joints, rotor: float) -> Matrix:
    here = arm_pose(joints)
    return np.array([here.momentum(_four(e), rotor) for e in np.eye(4)])


def _four(values: Matrix) -> Joints:
    a, b, c, d = values.tolist()
    return (a, b, c, d)


def _exponential(matrix: Matrix) -> Matrix:
    """By its series, after halving until that converges at once."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=1).max(), 1e-9)))) + 4)
    scaled, term, total = matrix / 2.0**halvings, np.eye(len(matrix)), np.eye(len(matrix))
    for number in range(1, 12):
        term = term @ scaled / number
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
