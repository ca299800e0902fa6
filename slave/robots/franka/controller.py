"""The controller process of the robot `franka`: it runs the 1 kHz loop of the robot's control interface.

The daemon starts it with the descriptor of the shared memory, its own process id, and the options as JSON. It is the
only module that imports `pylibfranka`. The daemon's interpreter is never in the loop: commands and states pass through
two slots that nobody waits for. The arm stops when commands do, and the process brings it to rest and ends when the
daemon asks for it or is gone.
"""

import gc
import os
import sys
from contextlib import suppress
from importlib import import_module
from math import isfinite
from mmap import mmap
from signal import SIG_DFL, SIG_IGN, SIGHUP, SIGINT, SIGTERM, signal
from time import monotonic
from typing import Any, Final

import numpy as np

from weberlink.geometry.rotation import IDENTITY
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale, subtract
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.process import die_with_parent, forbid_core_dumps, prepare
from weberlink.slave.robots.franka.goal import Goal
from weberlink.slave.robots.franka.impedance import Impedance, Joints, orientation_of, permitted, turn_between
from weberlink.slave.robots.franka.messages import (
    MEMORY_SIZE,
    ArmCommand,
    ArmState,
    Phase,
    command_slot,
    state_slot,
)
from weberlink.slave.robots.franka.options import FrankaOptions

LIBRARY: Final = "pylibfranka"
CYCLE_S: Final = 0.001
REFRESH_CYCLES: Final = 50
SETTLE_CYCLES: Final = 200
TARE_CYCLES: Final = 200
"""The offset of the force is the mean over so many cycles, after the arm has held for the cycles before."""
STALL_S: Final = 0.02
"""The robot gives up after 20 cycles without an answer; after that long a pause the goal starts from the tip."""
REST_RAD_S: Final = 0.02
REST_MOST_S: Final = 1.0
"""The arm is at rest when no joint is faster; the controller waits so long for that before it leaves."""
WRIST_SHARE: Final = 0.25
"""Torque at which the joints of the wrist stop with a reflex, of that of the others."""


class ControlRefusedError(RuntimeError):
    """The robot or the connection refuses, with one line that says why."""


class Controller:
    """Runs the loop on a connected robot.

    Args:
        options: of the driver.
        memory: shared with the daemon.
        parent: process id of the daemon.
        notice: for the state's text.
    """

    def __init__(self, options: FrankaOptions, memory: mmap, parent: int, notice: str = "") -> None:
        self._options, self._parent = options, parent
        self._commands, self._states = command_slot(memory), state_slot(memory)
        self._state = ArmState(Phase.STARTING, monotonic(), text=notice)
        self._bias: tuple[Vector, Vector] = (ZERO, ZERO)
        self._library: Any = None
        self._robot: Any = None
        self._model: Any = None

    def run(self, library: Any) -> None:
        """Connect, control until the end, and leave the arm at rest.

        Args:
            library: `pylibfranka`.

        Raises:
            ControlRefusedError: the robot refuses or has stopped.
        """
        self._state.put(self._states)
        self._library = library
        self._robot = library.Robot(self._options.host, library.RealtimeConfig.kIgnore)
        self._check_mode()
        options = self._options
        torques = [options.reflex_n_m] * 4 + [options.reflex_n_m * WRIST_SHARE] * 3
        wrench = [options.reflex_n] * 3 + [options.reflex_n_m] * 3
        self._robot.set_collision_behavior(torques, torques, wrench, wrench)
        self._model = self._robot.load_model()
        state = self._robot.read_once()
        self._check_place(state)
        freeze_garbage()
        try:
            self._control(state)
        except library.ControlException as error:
            raise ControlRefusedError(self._abort(error)) from None

    def _check_mode(self) -> None:
        """See that the robot takes commands; clear its error if the options say so."""
        state = self._robot.read_once()
        modes = self._library.RobotMode
        if state.robot_mode == modes.Reflex or state.current_errors:
            name = str(state.current_errors) or str(state.last_motion_errors) or "an error"
            if not self._options.recover:
                raise ControlRefusedError(
                    f"the robot has stopped with {name}; see that the arm is free, then start once with "
                    "slave.robot.recover=true"
                )
            self._robot.automatic_error_recovery()
            state = self._robot.read_once()
        if state.robot_mode == modes.UserStopped:
            raise ControlRefusedError("the robot is stopped by its user stop; release it")
        if state.robot_mode != modes.Idle:
            mode = state.robot_mode.name
            raise ControlRefusedError(f"the robot is in the mode {mode}; in Desk, unlock the joints and activate FCI")

    def _check_place(self, state: Any) -> None:
        place = _position(state.O_T_EE)
        low, high = self._options.workspace_m
        if not all(a <= x <= b for a, x, b in zip(low, place, high, strict=True)):
            shown = ", ".join(f"{x:.3f}" for x in place)
            raise ControlRefusedError(
                f"the tip is at [{shown}], outside of workspace_m; guide the arm inside, or set another workspace"
            )

    def _control(self, state: Any) -> None:
        """The loop, from the first torque to the last."""
        options, model, commands, states = self._options, self._model, self._commands, self._states
        torque_command, put = self._library.Torques, ArmState.put
        impedance = Impedance(options, np.array(state.q))
        goal = Goal(options, _position(state.O_T_EE), orientation_of(state.O_T_EE))
        self._warm_up(impedance, state)
        control = self._robot.start_torque_control()
        last, cycles, lost, longest = monotonic(), 0, 0, 0.0
        ends_at: float | None = None
        while True:
            state, period = control.readOnce()
            now = monotonic()
            elapsed, last = now - last, now
            tip, turned = _position(state.O_T_EE), orientation_of(state.O_T_EE)
            joints = self._joints(state)
            if cycles % REFRESH_CYCLES == 0:
                impedance.refresh(np.array(model.mass(state)).reshape(7, 7), joints.jacobian)
            command = ArmCommand.newest(commands)
            if command is not None:
                goal.take(command)
            if ends_at is None and (command is not None and command.ends or os.getppid() != self._parent):
                ends_at = now + REST_MOST_S
                goal.stop(tip, turned)
            if cycles and elapsed > STALL_S:
                goal.stop(tip, turned)
            if ends_at is None and self._state.phase is Phase.FOLLOWING:
                goal.step(now, elapsed, tip, turned)
            wanted = impedance.torques(joints, subtract(goal.position, tip), turn_between(turned, goal.orientation))
            torques = torque_command(permitted(wanted, np.array(state.tau_J_d)).tolist())
            speed = float(np.abs(joints.dq).max())
            finished = ends_at is not None and (speed < REST_RAD_S or now > ends_at)
            if finished:
                torques.motion_finished = True
            control.writeOnce(torques)
            cycles += 1
            if cycles > 1:
                longest = max(longest, elapsed)
                lost += max(0, round(period.to_sec() / CYCLE_S) - 1)
            self._state = self._measured(state, now, tip, speed)._replace(cycles=cycles, lost=lost, longest_s=longest)
            if finished:
                self._state = self._state._replace(phase=Phase.ENDED)
            put(self._state, states)
            if finished:
                return

    def _warm_up(self, impedance: Impedance, state: Any) -> None:
        """Compute a cycle that is not sent: what is done for the first time takes several milliseconds."""
        joints = self._joints(state)
        impedance.refresh(np.array(self._model.mass(state)).reshape(7, 7), joints.jacobian)
        permitted(impedance.torques(joints, ZERO, IDENTITY), np.array(state.tau_J_d))

    def _joints(self, state: Any) -> Joints:
        model = self._model
        jacobian = np.array(model.zero_jacobian(state)).reshape(7, 6).T
        return Joints(np.array(state.q), np.array(state.dq), jacobian, np.array(model.coriolis(state)))

    def _measured(self, state: Any, now: float, tip: Vector, speed: float) -> ArmState:
        """What the robot measures, without the offset at opening; begins to follow once that is known.

        The robot states the force that it applies to its surroundings (libfranka, robot_state.h); ours is the reaction.
        """
        fx, fy, fz, tx, ty, tz = state.O_F_ext_hat_K
        force, torque = (-fx, -fy, -fz), (-tx, -ty, -tz)
        if not isfinite(fx + fy + fz + tx + ty + tz):
            raise ControlRefusedError("the robot reports a force that is not finite")
        phase, (force_bias, torque_bias), cycles = self._state.phase, self._bias, self._state.cycles
        if phase is Phase.STARTING and cycles >= SETTLE_CYCLES:
            share = 1.0 / TARE_CYCLES
            force_bias, torque_bias = add(force_bias, scale(force, share)), add(torque_bias, scale(torque, share))
            self._bias = force_bias, torque_bias
            if cycles + 1 >= SETTLE_CYCLES + TARE_CYCLES:
                self._check_bias(force_bias)
                phase = Phase.FOLLOWING
        force, torque = subtract(force, force_bias), subtract(torque, torque_bias)
        success = state.control_command_success_rate
        return self._state._replace(
            phase=phase, at=now, position=tip, force=force, torque=torque, joint_speed=speed, success=success
        )

    def _check_bias(self, force: Vector) -> None:
        if norm(force) > self._options.tare_n:
            raise ControlRefusedError(
                f"the robot reports {norm(force):.1f} N at rest; free it from contact, or set mass and centre of its "
                "end effector in Desk"
            )

    def _abort(self, error: Exception) -> str:
        """The robot's own stop, with its name."""
        name = ""
        with suppress(Exception):
            state = self._robot.read_once()
            name = str(state.current_errors) or str(state.last_motion_errors)
        return f"the robot stopped with {name}" if name else f"the robot stopped: {_line(error)}"

    def fail(self, reason: str) -> None:
        """Tell the daemon that the control has ended, and why."""
        self._state._replace(phase=Phase.FAILED, text=reason).put(self._states)


def _position(pose: list[float]) -> Vector:
    return (pose[12], pose[13], pose[14])


def _line(error: BaseException) -> str:
    """The message of an exception, in one line."""
    return " ".join(str(error).split()).removeprefix("libfranka: ") or type(error).__name__


def _notice(options: FrankaOptions) -> str:
    """Ask for real time; says what was not granted."""
    with suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))  # the daemon may run on one alone
    grants = prepare(options.priority, lock_memory=True, cpu=options.cpu)
    asked = [grants.priority] * (options.priority > 0) + [grants.memory] + [grants.cpu] * (options.cpu is not None)
    return "; ".join(grant.detail for grant in asked if not grant)


def main(arguments: list[str]) -> int:
    memory, parent = int(arguments[0]), int(arguments[1])
    options = FrankaOptions.model_validate_json(arguments[2])
    signal(SIGTERM, SIG_DFL)
    die_with_parent(SIGTERM, parent)  # while it connects, and nothing moves
    forbid_core_dumps()
    signal(SIGINT, SIG_IGN)
    signal(SIGHUP, SIG_IGN)
    shared = mmap(memory, MEMORY_SIZE)
    controller = Controller(options, shared, parent, _notice(options))
    try:
        controller.run(import_module(LIBRARY))
    except ModuleNotFoundError as error:
        controller.fail(f'needs {error.name}; install it with: pip install "weberlink[franka]"')
    except Exception as error:  # noqa: BLE001 - whatever the library raises; the daemon tells
        controller.fail(_line(error))
    else:
        return 0
    return 1


if __name__ == "__main__":
    gc.disable()
    sys.exit(main(sys.argv[1:]))
