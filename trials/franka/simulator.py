"""`python -m trials.franka.simulator`: franka-sim with an arm above a table, and a record of the truth.

Runs in the environment of `make franka`. franka-sim 1.1.7 publishes zero in `O_F_ext_hat_K` and `tau_ext_hat_filtered`:
nothing in it estimates external forces. The contact force of its own physics (MuJoCo) is put there, with the sign that
libfranka documents: positive is what the robot exerts on its environment. It has no noise, bias or lag, unlike the
estimate of a real arm. A latched error outlives a connection, as on a robot.

franka-sim takes its model from MuJoCo Menagerie, which it downloads. Its wheel also holds the URDF that it serves to
clients, with the kinematics, inertias and joint friction of franka_description. The scene is made of that URDF, so it
needs no network, and the client's model of the arm agrees with the simulated arm but for the inertia of the drives.

SIGUSR1 makes the controller raise `cartesian_reflex`, as a robot does that hits something.
"""

import argparse
import logging
import signal
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from time import monotonic
from types import FrameType
from xml.etree import ElementTree

import mujoco
import numpy as np
from franka_sim import FrankaSimServer
from franka_sim.mujoco_franka_sim import MujocoFrankaSim

from trials.franka.robot import TruthWriter
from weberlink.realtime.process import die_with_parent, prepare

CARTESIAN_REFLEX = 7  # place in libfranka's list of errors
MOVE_MODE, REFLEX_MODE = 2, 4
LATCHED = ("robot_mode", "errors", "reflex_reason")
FLANGE = "link7"  # the body whose pose franka-sim publishes as O_T_EE
TIP, TABLE = "tip", "table"
TIP_RADIUS_M, TABLE_DEPTH_M = 0.01, 0.1
STIFFNESS_S_2, DAMPING_S = 37.5, 3.0
"""Of the table's surface, per effective mass of the arm: with `SHARE`, 5.5 kN/m and nearly critical damping."""
SHARE = 0.9  # constraint impedance of the surface, the same at any depth, so that force grows linearly with depth
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
    options = {"fusestatic": "false", "balanceinertia": "true"}
    ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", options)
    return ElementTree.tostring(root, encoding="unicode")


def scene(urdf: Path, table_m: float) -> str:
    """MJCF of the arm with a sphere at its flange, above a table whose top is at the height `table_m`.

    Only the sphere and the table collide: the contact force on the flange is then the whole external force on the arm.
    """
    spec = mujoco.MjSpec.from_string(without_meshes(urdf.read_text(encoding="utf-8")))
    for joint in spec.joints:
        joint.armature = ARMATURE_KG_M2
    sphere, box = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
    flange = spec.find_body(FLANGE)
    flange.add_geom(name=TIP, type=sphere, size=[TIP_RADIUS_M, 0, 0], mass=0, contype=1, conaffinity=2)
    spec.worldbody.add_geom(
        name=TABLE,
        type=box,
        pos=[0.5, 0, table_m - TABLE_DEPTH_M],
        size=[0.5, 0.5, TABLE_DEPTH_M],
        contype=2,
        conaffinity=1,
        solref=[-STIFFNESS_S_2, -DAMPING_S],
        solimp=[SHARE, SHARE, 0.001, 0.5, 2.0],
        friction=[0.3, 0.005, 0.0001],
    )
    spec.compile()  # only what is compiled can be written
    return str(spec.to_xml())


class TableArm(MujocoFrankaSim):
    """franka-sim's arm in the scene with the table."""

    def __init__(self, model_path: Path, truth: TruthWriter) -> None:
        super().__init__(model_path=model_path)
        self.truth = truth
        self._contact = np.zeros(6)
        self.server: Controller | None = None
        self.provoked = False

    def initialize_simulation(self) -> None:
        super().initialize_simulation()
        self._pair = {self.model.geom(TIP).id, self.model.geom(TABLE).id}

    def _read_and_publish_state(self) -> None:
        super()._read_and_publish_state()
        force = self.force_on_arm()
        jacobian = self._state_snapshot["O_J_EE"][:3]
        self._state_snapshot = {
            **self._state_snapshot,
            "O_F_ext_hat_K": [*-force, 0.0, 0.0, 0.0],
            "tau_ext_hat_filtered": jacobian.T @ -force,
        }
        if self.server is not None:
            self._record(force, self.server)
            if self.provoked:
                self.provoked = False
                self.server._abort_with_error(CARTESIAN_REFLEX, "cartesian_reflex provoked")

    def force_on_arm(self) -> np.ndarray:
        """Contact force of the table on the flange, in the base frame [N]."""
        force = np.zeros(3)
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            if {contact.geom1, contact.geom2} == self._pair:
                mujoco.mj_contactForce(self.model, self.data, index, self._contact)
                # Rows of the frame are its axes; the force is of the first geometry on the second.
                on_second = contact.frame.reshape(3, 3).T @ self._contact[:3]
                force += on_second if contact.geom2 == self.model.geom(TIP).id else -on_second
        return force

    def _record(self, force: np.ndarray, server: "Controller") -> None:
        row, state = self.truth.next_row(), server.robot_state.state
        row["at"] = monotonic()
        row["q"], row["dq"] = self._state_snapshot["q"], self._state_snapshot["dq"]
        row["torque"] = self.data.qfrc_applied[self.arm_dofs_idx]
        row["tip"], row["force"] = self.data.xpos[self.ee_body_id], force
        row["moving"], row["reflex"] = (state["robot_mode"] == mode for mode in (MOVE_MODE, REFLEX_MODE))
        row["success"] = state["control_command_success_rate"]
        row["lost"] = server.comm._consecutive_lost
        self.truth.close_row(row)


class Controller(FrankaSimServer):
    """franka-sim's server, whose latched error outlives a connection."""

    def __init__(self, arm: TableArm, **options: object) -> None:
        self._arm = arm
        super().__init__(physics_sim=arm, enable_gripper=False, **options)
        arm.server = self

    def reset_state(self) -> None:
        before = self.robot_state.state if hasattr(self, "robot_state") else {}
        super().reset_state()
        if before.get("robot_mode") == REFLEX_MODE:  # a robot keeps its error until it is cleared, whoever connects
            self.robot_state.state.update({name: before[name] for name in LATCHED})


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; the port is libfranka's, 1337")
    parser.add_argument("--table", type=float, default=0.565, metavar="Z", help="height of the table [m]")
    parser.add_argument("--truth", type=Path, required=True, help="file for the record of every step")
    parser.add_argument("--lenient", action="store_true", help="lost cycles and broken limits do not stop the arm")
    parser.add_argument("--priority", type=int, default=70, help="in SCHED_FIFO, if permitted")
    parser.add_argument("--parent", type=int, help="process that this one ends with")
    arguments = parser.parse_args()
    if arguments.parent is not None:
        die_with_parent(signal.SIGKILL, arguments.parent)
    prepare(arguments.priority, lock_memory=False, cpu=None)
    logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(levelname)s %(message)s")
    with tempfile.TemporaryDirectory() as folder:
        model, is_strict = Path(folder) / "fr3-table.xml", not arguments.lenient
        model.write_text(scene(FrankaSimServer.DEFAULT_ARM_URDF, arguments.table))
        arm = TableArm(model, TruthWriter(arguments.truth))
        options = {"enforce_comm_constraints": is_strict, "enforce_motion_limits": is_strict}
        server = Controller(arm, host=arguments.host, **options)

        def provoke(_number: int, _frame: FrameType | None) -> None:
            arm.provoked = True

        signal.signal(signal.SIGUSR1, provoke)
        with suppress(KeyboardInterrupt):
            server.start()
        server.stop()


if __name__ == "__main__":
    main()
