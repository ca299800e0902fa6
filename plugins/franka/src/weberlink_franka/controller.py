"""The controller process of the robot `franka`: it runs the 1 kHz loop of the robot's control interface (FCI).

The daemon starts it with the descriptor of the shared memory, its own process id, and the options as JSON. It is the
only module that imports `pylibfranka`. The daemon's interpreter is never in the loop: commands and states pass through
two slots that nobody waits for. The arm stops when commands do, and the process brings it to rest and ends when the
daemon asks for it or is gone.
"""

import os
import sys
from contextlib import suppress
from importlib import import_module
from mmap import mmap
from signal import SIG_DFL, SIG_IGN, SIGHUP, SIGINT, SIGTERM, signal
from time import monotonic
from typing import Any, Final

from weberlink.installation import install_line
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.process import die_with_parent, forbid_core_dumps, prepare
from weberlink_franka.control_loop import ControlLoop, position_of
from weberlink_franka.messages import MEMORY_SIZE, ArmState, Phase, command_slot, state_slot
from weberlink_franka.options import FrankaOptions

LIBRARY: Final = "pylibfranka"
WRIST_SHARE: Final = 0.25  # torque at which the three joints of the wrist stop with a reflex, of that of the others


class RefusedError(RuntimeError):
    """The robot does not take commands, or has stopped; one line that says why."""


def control(library: Any, options: FrankaOptions, memory: mmap, parent: int) -> None:
    """Connect, control until the daemon, which is the process `parent`, ends it or is gone, and leave the arm at rest.

    Raises RefusedError if the robot does not take commands, or has stopped by itself.
    """
    robot = library.Robot(options.host, library.RealtimeConfig.kIgnore)
    check_mode(library, robot, options)
    check_place(robot.read_once(), options)
    torques = [options.reflex_n_m] * 4 + [options.reflex_n_m * WRIST_SHARE] * 3
    wrench = [options.reflex_n] * 3 + [options.reflex_n_m] * 3
    robot.set_collision_behavior(torques, torques, wrench, wrench)
    slots, model = (command_slot(memory), state_slot(memory)), robot.load_model()
    notice = real_time(options)  # not before: what is done until here takes long, and would keep the daemons waiting
    loop = ControlLoop(options, model, *slots, lambda: os.getppid() != parent, notice)
    signal(SIGTERM, SIG_IGN)  # from here on the end of the daemon is seen in the loop, which brings the arm to rest
    try:
        run(library, robot, loop, options.priority)
    except library.ControlException as error:
        raise RefusedError(f"{stop_of(robot, error)}; {loop.pace()}") from None
    except Exception:
        with suppress(Exception):  # the connection may be the reason
            robot.stop()
        raise


def run(library: Any, robot: Any, loop: ControlLoop, priority: int) -> None:
    """The loop, from the first torque to the last."""
    loop.begin(robot.read_once())
    freeze_garbage()
    motion = robot.start_torque_control()
    schedule(priority)
    while not loop.finished:
        state, period = motion.readOnce()
        now = monotonic()
        torques = library.Torques(loop.step(state, now))
        torques.motion_finished = loop.finished
        motion.writeOnce(torques)
        loop.report(state, now, period.to_sec())


def schedule(priority: int) -> None:
    """Return to the option's priority: libfranka takes the highest of all, 99, when it starts to control."""
    policy = os.SCHED_FIFO if priority else os.SCHED_OTHER
    with suppress(PermissionError):
        os.sched_setscheduler(0, policy, os.sched_param(priority))


def check_mode(library: Any, robot: Any, options: FrankaOptions) -> None:
    """See that the robot takes commands; clear its error if the options say so. RefusedError tells what to do."""
    modes, state = library.RobotMode, robot.read_once()
    if state.robot_mode == modes.Reflex or state.current_errors:
        if not options.recover:
            raise RefusedError(
                f"the robot has stopped ({errors_of(state)}); see that the arm is free, then start once with "
                "slave.robot.recover=true"
            )
        robot.automatic_error_recovery()
        state = robot.read_once()
    if state.robot_mode == modes.UserStopped:
        raise RefusedError("the robot is stopped by its user stop; release it")
    if state.robot_mode != modes.Idle:
        raise RefusedError(
            f"the robot is in the mode {state.robot_mode.name} ({errors_of(state)}); in Desk, unlock its joints and "
            "activate FCI"
        )


def check_place(state: Any, options: FrankaOptions) -> None:
    """Raises RefusedError if the tip is outside of the workspace, from where the first command would draw it."""
    place, (low, high) = position_of(state.O_T_EE), options.workspace_m
    if not all(a <= x <= b for a, x, b in zip(low, place, high, strict=True)):
        shown = ", ".join(f"{x:.3f}" for x in place)
        raise RefusedError(
            f"the tip is at [{shown}], outside of workspace_m; guide the arm inside, or set another workspace"
        )


def errors_of(state: Any) -> str:
    """The robot's names of its present errors."""
    return ", ".join(str(state.current_errors).strip("[]").replace('"', "").split(", ")) or "no error is named"


def stop_of(robot: Any, error: Exception) -> str:
    """Why the robot has stopped by itself, by its names."""
    with suppress(Exception):
        state = robot.read_once()
        if state.current_errors:
            return f"the robot has stopped ({errors_of(state)})"
    return f"the robot has stopped: {line_of(error)}"


def line_of(error: BaseException) -> str:
    """The message of an exception, in one line."""
    return " ".join(str(error).split()).removeprefix("libfranka: ") or type(error).__name__


def real_time(options: FrankaOptions) -> str:
    """Ask the kernel for real time; returns what was not granted."""
    with suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))  # the daemon may run on one alone
    grants = prepare(options.priority, lock_memory=True, cpu=options.cpu)
    asked = [grants.priority] * (options.priority > 0) + [grants.memory] + [grants.cpu] * (options.cpu is not None)
    return "; ".join(grant.detail for grant in asked if not grant)


def main(arguments: list[str]) -> int:
    """Run the process; 0 if the arm was left at rest, 1 if the robot or the connection failed."""
    descriptor, parent, options = int(arguments[0]), int(arguments[1]), FrankaOptions.model_validate_json(arguments[2])
    signal(SIGTERM, SIG_DFL)
    signal(SIGINT, SIG_IGN)
    signal(SIGHUP, SIG_IGN)
    die_with_parent(SIGTERM, parent)  # while it connects and nothing moves
    forbid_core_dumps()
    memory = mmap(descriptor, MEMORY_SIZE)
    try:
        control(import_module(LIBRARY), options, memory, parent)
    except ModuleNotFoundError as error:
        reason = f"needs {error.name}; install it with: {install_line('franka')}"
    except Exception as error:  # whatever the library raises: the daemon names it
        reason = line_of(error)
    else:
        return 0
    ArmState(Phase.FAILED, monotonic(), text=reason).put(state_slot(memory))
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
