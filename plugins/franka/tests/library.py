"""A stand-in for `pylibfranka`: the same names, and behind them an arm of seven independent joints over a ground.

Three joints move the tip along x, y and z, three turn the tool, and the seventh moves nothing: so the Jacobian is
constant and everything can be said in numbers. The host name says how it begins, for example "reflex", "offset=8" or
"offset=2,ground=0.4". SIGUSR1 provokes a reflex, SIGUSR2 cuts the link. `trials/franka` drives the real library
with the same driver. `PROGRAM` is the command that starts the controller with it, for `FrankaRobot`.
"""

import enum
import sys
from pathlib import Path
from signal import SIGUSR1, SIGUSR2, signal
from time import monotonic, sleep

import numpy as np

from weberlink.geometry.rotation import quaternion, turned

ROOT = Path(__file__).parents[3]
PROGRAM = (
    *(sys.executable, "-c"),
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from plugins.franka.tests.library import main; main()",
)
CYCLE_S = 0.001
GROUND_N_M = 2000.0
GROUND_N_S_M = 20.0
MASS = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1, 0.2])
HOME = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0])
TIP = (0.5, 0.0, 0.45)  # place of the tip at home [m]
COLUMNS_OF_MASS: list[float] = np.diag(MASS).ravel().tolist()
COLUMNS_OF_JACOBIAN: list[float] = np.eye(6, 7).T.ravel().tolist()
RATE_N_M = 1.0  # largest change of a torque in a cycle


class ControlException(RuntimeError): ...  # noqa: N818 - the maker's names, here and below


class NetworkException(RuntimeError): ...  # noqa: N818


RealtimeConfig = enum.Enum("RealtimeConfig", "kEnforce kIgnore", start=0)
RobotMode = enum.Enum("RobotMode", "Other Idle Move Guiding Reflex UserStopped AutomaticErrorRecovery", start=0)


class Errors(list[str]):
    def __str__(self) -> str:
        return "[" + ", ".join(f'"{name}"' for name in self) + "]"


class Duration(float):
    to_sec = float.__float__


class Torques:
    def __init__(self, arg0: list[float]) -> None:
        assert len(arg0) == 7
        self.tau_J = list(arg0)
        self.motion_finished = False


class RobotState:
    """As the arm was when it was read."""

    def __init__(self, arm: "Arm") -> None:
        self.q: list[float] = arm.q.tolist()
        self.dq: list[float] = arm.dq.tolist()
        turn = quaternion((self.q[3] - HOME[3], self.q[4] - HOME[4], self.q[5] - HOME[5]))
        columns = [turned(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        tip = [start + way for start, way in zip(TIP, self.q, strict=False)]
        self.O_T_EE = [number for column in columns for number in (*column, 0.0)] + [*tip, 1.0]
        self.tau_J_d: list[float] = arm.torque.tolist()
        self.O_F_ext_hat_K = [0.0, 0.0, -arm.sign * (arm.contact() + arm.offset), 0.0, 0.0, 0.0]
        self.control_command_success_rate = 1.0
        self.robot_mode = arm.mode
        self.current_errors, self.last_motion_errors = arm.errors, arm.errors
        self.time = Duration(arm.time)


class Arm:
    """The arm itself, in steps of a millisecond."""

    def __init__(self, scenario: str) -> None:
        words = dict((*word.split("="), "1")[:2] for word in scenario.split(","))
        self.offset = float(words.get("offset", 0.0))
        self.sign = -1.0 if "reversed" in words else 1.0
        self.ground = float(words.get("ground", 0.30))
        self.q, self.dq, self.torque = HOME.copy(), np.zeros(7), np.zeros(7)
        self.mode, self.errors, self.time = RobotMode.Idle, Errors(), 0.0
        if "reflex" in words:
            self.stop("cartesian_reflex")
        if "user_stop" in words:
            self.mode = RobotMode.UserStopped

    def contact(self) -> float:
        """Upward force of the ground on the tip [N]."""
        deep = self.ground - TIP[2] - float(self.q[2])
        return max(0.0, GROUND_N_M * deep - GROUND_N_S_M * float(self.dq[2])) if deep > 0.0 else 0.0

    def step(self) -> None:
        self.dq += self.torque / MASS * CYCLE_S
        self.dq[2] += self.contact() / MASS[2] * CYCLE_S
        if self.mode is not RobotMode.Move:
            self.dq *= 0.9
        self.q += CYCLE_S * self.dq
        self.time += CYCLE_S

    def stop(self, error: str) -> None:
        self.mode, self.torque = RobotMode.Reflex, np.zeros(7)
        self.errors.append(error)


class Model:
    def coriolis(self, arg0: RobotState) -> list[float]:
        return [0.0] * 7

    def mass(self, arg0: RobotState) -> list[float]:
        return COLUMNS_OF_MASS

    def zero_jacobian(self, arg0: RobotState) -> list[float]:
        return COLUMNS_OF_JACOBIAN


class ActiveControlBase:
    """The loop: a state each millisecond of real time."""

    def __init__(self, arm: Arm, robot: "Robot") -> None:
        self._arm, self._robot = arm, robot
        self._due = monotonic()

    def readOnce(self) -> tuple[RobotState, Duration]:  # noqa: N802
        arm, cycles = self._arm, 0
        self._due += CYCLE_S
        sleep(max(0.0, self._due - monotonic()))
        while cycles == 0 or self._due < monotonic() - CYCLE_S:
            arm.step()
            cycles += 1
            self._due += CYCLE_S if cycles > 1 else 0.0
        self._check()
        return RobotState(arm), Duration(cycles * CYCLE_S)

    def writeOnce(self, arg0: Torques) -> None:  # noqa: N802
        self._check()
        wanted = np.array(arg0.tau_J)
        if np.abs(wanted - self._arm.torque).max() > RATE_N_M:
            self._arm.stop("controller_torque_discontinuity")
        self._check()
        self._arm.torque = wanted
        if arg0.motion_finished:
            self._arm.mode, self._arm.torque = RobotMode.Idle, np.zeros(7)

    def _check(self) -> None:
        if self._robot.is_cut:
            raise NetworkException("libfranka: UDP receive: Timeout")
        if self._arm.errors:
            raise ControlException(f"libfranka: Move command aborted: motion aborted by reflex! {self._arm.errors}")


class Robot:
    def __init__(self, robot_ip_address: str, realtime_config: RealtimeConfig = RealtimeConfig.kEnforce) -> None:
        self._arm = Arm(robot_ip_address)
        self.is_cut = False
        signal(SIGUSR1, lambda *_: self._arm.stop("cartesian_reflex"))
        signal(SIGUSR2, lambda *_: setattr(self, "is_cut", True))

    def read_once(self) -> RobotState:
        if self.is_cut:
            raise NetworkException("libfranka: UDP receive: Timeout")
        return RobotState(self._arm)

    def load_model(self) -> Model:
        return Model()

    def set_collision_behavior(self, *thresholds: list[float]) -> None:
        assert [len(each) for each in thresholds] == [7, 7, 6, 6]

    def start_torque_control(self) -> ActiveControlBase:
        self._arm.mode = RobotMode.Move
        return ActiveControlBase(self._arm, self)

    def stop(self) -> None:
        self._arm.mode, self._arm.torque = RobotMode.Idle, np.zeros(7)

    def automatic_error_recovery(self) -> None:
        self._arm.mode, self._arm.errors = RobotMode.Idle, Errors()


def main() -> None:
    sys.modules["pylibfranka"] = sys.modules[__name__]
    from weberlink_franka import controller  # noqa: PLC0415

    sys.exit(controller.main(sys.argv[1:]))
