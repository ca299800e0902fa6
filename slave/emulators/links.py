"""What the OpenMANIPULATOR-X is made of: lengths, masses and friction of its links and joints. Only data.

Lengths and joints: ROBOTIS, open_manipulator, the arm's URDF. Masses (weighed), centres of mass and inertia tensors
(CAD, scaled to the weight): the URDF of smorales2405/open_manipulator_x_torque_control; friction: that project's sweep
at constant speeds (motorXM430W350T_params.yaml). A third party's figures for its own arm, not verified here. Sideways
offsets of the centres of mass, below 0.7 mm, are left out: the arm is flat. The driver has figures of its own, written
apart from these, so that each checks the other.
"""

from math import pi
from typing import NamedTuple

BASE_TO_SHOULDER = (0.012, 0.0, 0.0765)
"""From the base frame to where the axes of joints 1 and 2 cross [m]."""
UPPER_ARM = (0.024, 0.128)
FOREARM = (0.124, 0.0)
HAND = (0.126, 0.0)
"""From joint to joint to tip, x and z in the frame of the first of the two [m]."""


class Link(NamedTuple):
    """A rigid body in the frame of the joint that moves it: mass [kg], centre of mass [m], tensor about it [kg m^2]."""

    mass: float
    x: float
    z: float
    ixx: float
    iyy: float
    izz: float
    ixz: float


WAIST_IZZ = 1.627e-5
"""Of link 2, which only turns about the vertical axis [kg m^2]."""
LINK_3 = Link(0.1235, 0.007606, 0.099924, 1.979680e-4, 2.046627e-4, 3.374865e-5, -2.497601e-5)
LINK_4 = Link(0.1151, 0.089168, 0.0, 1.930305e-5, 1.483284e-4, 1.547550e-4, 0.0)
LINK_5 = Link(0.2226, 0.062451, 0.005878, 1.344328e-4, 1.892619e-4, 2.174510e-4, 2.259163e-5)
"""With the gripper and its fingers."""


class Joint(NamedTuple):
    """Where it stops [rad]."""

    lower: float
    upper: float


JOINTS = (Joint(-pi, pi), Joint(-1.5, 1.5), Joint(-1.5, 1.4), Joint(-1.7, 1.97))
COULOMB = (0.037, 0.085, 0.132, 0.045)
"""Dry friction of the joints [N m]."""
VISCOUS = (0.037, 0.0, 0.0, 0.005)
"""[N m s]"""
ROTOR_INERTIA = 0.045
"""Of a motor, seen at its joint [kg m^2]: as a fitted model of a robot with the same motors has it (mujoco_menagerie,
robotis_op3)."""
