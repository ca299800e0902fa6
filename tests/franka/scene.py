"""The scene that franka-sim simulates: its own FR3, without meshes, above a table.

franka-sim takes its model from MuJoCo Menagerie, which it downloads. Its wheel also holds the URDF that it serves to
clients, with the kinematics, inertias and joint friction of franka_description. This scene is made of that URDF, so it
needs no network, and the client's model of the arm agrees with the simulated arm but for the inertia of the drives.
"""

from pathlib import Path
from xml.etree import ElementTree

import mujoco

FLANGE = "link7"  # the body whose pose franka-sim publishes as O_T_EE
TIP = "tip"
TABLE = "table"
TIP_RADIUS_M = 0.01
TABLE_DEPTH_M = 0.1
STIFFNESS_S_2, DAMPING_S = 37.5, 3.0
"""Of the table's surface, per effective mass of the arm: with `SHARE`, 5.5 kN/m and nearly critical damping."""
SHARE = 0.9
"""Constraint impedance of the surface, the same at any depth, so that force grows linearly with depth."""
ARMATURE_KG_M2 = 0.195
"""Inertia of a drive behind its gear, of MuJoCo Menagerie's `fr3v2`: franka-sim's servos of the idle arm rely on it."""


def without_meshes(urdf: str) -> str:
    """Return the URDF without meshes, and with the flange under the name that franka-sim looks for.

    On the robot O_T_EE is the flange if no end effector is set. franka-sim publishes the body `link7`, which is 107 mm
    behind it, while the model in the client has the flange. So `link7` becomes `wrist`, and `link8`, the flange,
    becomes `link7`.
    """
    root = ElementTree.fromstring(urdf)
    for link in root.iter("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)
    names = {"link7": "wrist", "link8": FLANGE}
    for element in root.iter():
        for attribute in ("name", "link"):
            if element.tag in {"link", "parent", "child"} and element.get(attribute) in names:
                element.set(attribute, names[element.attrib[attribute]])
    ElementTree.SubElement(
        ElementTree.SubElement(root, "mujoco"), "compiler", fusestatic="false", balanceinertia="true"
    )
    return ElementTree.tostring(root, encoding="unicode")


def build(urdf: Path, table_m: float) -> mujoco.MjSpec:
    """Build the arm with a sphere at its flange, above a table whose top is at the height `table_m`.

    Only the sphere and the table collide: the contact force on the flange is then the whole external force on the arm.
    """
    spec = mujoco.MjSpec.from_string(without_meshes(urdf.read_text(encoding="utf-8")))
    for joint in spec.joints:
        joint.armature = ARMATURE_KG_M2
    spec.find_body(FLANGE).add_geom(
        name=TIP, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[TIP_RADIUS_M, 0, 0], mass=0, contype=1, conaffinity=2
    )
    spec.worldbody.add_geom(
        name=TABLE,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[0.5, 0, table_m - TABLE_DEPTH_M],
        size=[0.5, 0.5, TABLE_DEPTH_M],
        contype=2,
        conaffinity=1,
        solref=[-STIFFNESS_S_2, -DAMPING_S],
        solimp=[SHARE, SHARE, 0.001, 0.5, 2.0],
        friction=[0.3, 0.005, 0.0001],
    )
    return spec


def written(urdf: Path, table_m: float) -> str:
    """Return the scene as MJCF."""
    spec = build(urdf, table_m)
    spec.compile()  # only what is compiled can be written
    return str(spec.to_xml())
