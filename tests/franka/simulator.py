"""`python -m tests.franka.simulator`: franka-sim with the scene of this folder, and a record of the truth.

Runs in the environment of `make franka`. franka-sim 1.1.7 publishes zero in `O_F_ext_hat_K` and `tau_ext_hat_filtered`:
nothing in it estimates external forces. The contact force of its own physics (MuJoCo) is put there, with the sign that
libfranka documents: positive is what the robot exerts on its environment. It has no noise, bias or lag, unlike the
estimate of a real arm. A latched error outlives a connection, as on a robot.

SIGUSR1 makes the controller raise `cartesian_reflex`, as a robot does that hits something.
"""

import argparse
import logging
import signal
import sys
import tempfile
from pathlib import Path
from time import monotonic
from types import FrameType

import mujoco
import numpy as np
from franka_sim import FrankaSimServer
from franka_sim.comm_constraints import CommConstraintTracker
from franka_sim.mujoco_franka_sim import MujocoFrankaSim

from tests.franka.scene import TABLE, TIP, written
from tests.franka.truth import TruthWriter
from weberlink.realtime.process import die_with_parent, prepare

CARTESIAN_REFLEX = 7
"""Place in libfranka's list of errors."""
MOVE_MODE, REFLEX_MODE = 2, 4
LATCHED = ("robot_mode", "errors", "reflex_reason")


class TableArm(MujocoFrankaSim):
    """franka-sim's arm in the scene with the table."""

    def __init__(self, model_path: Path, truth: Path | None) -> None:
        super().__init__(model_path=model_path)
        self.truth = TruthWriter(truth) if truth is not None else None
        self._contact = np.zeros(6)
        self.server: Controller | None = None
        self.provoked = False

    def initialize_simulation(self) -> None:
        super().initialize_simulation()
        self._pair = {self.model.geom(TIP).id, self.model.geom(TABLE).id}

    def _read_and_publish_state(self) -> None:
        super()._read_and_publish_state()
        pressing = -self.force_on_arm()
        jacobian = self._state_snapshot["O_J_EE"][:3]
        self._state_snapshot = {
            **self._state_snapshot,
            "O_F_ext_hat_K": [*pressing, 0.0, 0.0, 0.0],
            "tau_ext_hat_filtered": jacobian.T @ pressing,
        }
        if self.server is not None:
            self._record(-pressing)
            if self.provoked:
                self.provoked = False
                self.server.provoke()

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

    def _record(self, force: np.ndarray) -> None:
        if self.truth is None or self.server is None:
            return
        row, state = self.truth.next_row(), self.server.robot_state.state
        row["at"] = monotonic()
        row["q"], row["dq"] = self._state_snapshot["q"], self._state_snapshot["dq"]
        row["torque"] = self.data.qfrc_applied[self.arm_dofs_idx]
        row["tip"], row["force"] = self.data.xpos[self.ee_body_id], force
        row["moving"], row["reflex"] = (state["robot_mode"] == mode for mode in (MOVE_MODE, REFLEX_MODE))
        row["success"] = state["control_command_success_rate"]
        row["lost"] = self.server.comm._consecutive_lost
        self.truth.close_row(row)


class Controller(FrankaSimServer):
    """franka-sim's server, which also notes when commands arrive."""

    def __init__(self, arm: TableArm, **options: object) -> None:
        self._arm = arm
        super().__init__(physics_sim=arm, enable_gripper=False, **options)
        arm.server = self

    def reset_state(self) -> None:
        before = self.robot_state.state if hasattr(self, "robot_state") else {}
        super().reset_state()
        if before.get("robot_mode") == REFLEX_MODE:  # a robot keeps its error until it is cleared, whoever connects
            self.robot_state.state.update({name: before[name] for name in LATCHED})
        tracker: CommConstraintTracker = self.comm
        received = tracker.command_received

        def note(message_id: int) -> bool:
            if self._arm.truth is not None:
                self._arm.truth.arrived(monotonic())
            return bool(received(message_id))

        tracker.command_received = note

    def provoke(self) -> None:
        """Stop the motion as a robot does that hits something."""
        self._abort_with_error(CARTESIAN_REFLEX, "cartesian_reflex provoked")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; the port is libfranka's, 1337")
    parser.add_argument("--table", type=float, default=0.565, metavar="Z", help="height of the table [m]")
    parser.add_argument("--truth", type=Path, help="file for the record of every step")
    parser.add_argument("--lenient", action="store_true", help="lost cycles and broken limits do not stop the arm")
    parser.add_argument("--priority", type=int, default=70, help="in SCHED_FIFO, if permitted")
    parser.add_argument("--parent", type=int, help="process that this one ends with")
    arguments = parser.parse_args()
    if arguments.parent is not None:
        die_with_parent(signal.SIGKILL, arguments.parent)
    prepare(arguments.priority, lock_memory=False, cpu=None)
    logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(levelname)s %(message)s")
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "fr3-table.xml"
        model.write_text(written(FrankaSimServer.DEFAULT_ARM_URDF, arguments.table))
        arm = TableArm(model, arguments.truth)
        server = Controller(
            arm,
            host=arguments.host,
            enforce_comm_constraints=not arguments.lenient,
            enforce_motion_limits=not arguments.lenient,
        )

        def provoke(_number: int, _frame: FrameType | None) -> None:
            arm.provoked = True

        signal.signal(signal.SIGUSR1, provoke)
        try:
            server.start()
        except KeyboardInterrupt:
            pass
        finally:
            server.stop()


if __name__ == "__main__":
    main()
