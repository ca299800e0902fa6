"""`python -m tests.franka.reference HOST SECONDS`: the least that pylibfranka can do, a loop that brakes the joints.

What it reaches is what this machine and the simulator allow; the driver is judged beside it. Prints one line of JSON.
"""

import json
import sys
from time import monotonic

import numpy as np
import pylibfranka

BRAKE_N_M_S = 2.0
STEP_N_M = 0.99


def main() -> None:
    host, seconds = sys.argv[1], float(sys.argv[2])
    robot = pylibfranka.Robot(host, pylibfranka.RealtimeConfig.kIgnore)
    robot.automatic_error_recovery()
    control = robot.start_torque_control()
    state, _ = control.readOnce()
    began, times, success = monotonic(), [], []
    while monotonic() < began + seconds:
        torque = -BRAKE_N_M_S * np.array(state.dq)
        last = np.array(state.tau_J_d)
        command = pylibfranka.Torques((last + np.clip(torque - last, -STEP_N_M, STEP_N_M)).tolist())
        control.writeOnce(command)
        state, _ = control.readOnce()
        times.append(monotonic())
        success.append(state.control_command_success_rate)
    command.motion_finished = True
    control.writeOnce(command)
    print(json.dumps({"began": times[0], "ended": times[-1], "success": float(np.mean(success[100:]))}))  # noqa: T201


if __name__ == "__main__":
    main()
