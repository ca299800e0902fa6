"""One cycle of the control loop: from the state of the robot to torques, between the slots of the daemon."""

from collections.abc import Callable
from typing import Any, Final, Protocol

import numpy as np

from weberlink.geometry.rotation import IDENTITY
from weberlink.geometry.vector import ZERO, Vector, subtract
from weberlink.slot import Slot
from weberlink_franka.goal import REST_RAD_S, Goal
from weberlink_franka.impedance import JOINTS, Array, Impedance, Joints, orientation_of, permitted, turn_between
from weberlink_franka.messages import ArmCommand, ArmState, Phase
from weberlink_franka.options import FrankaOptions
from weberlink_franka.sensing import ExternalForce

CYCLE_S: Final = 0.001
REFRESH_CYCLES: Final = 20  # inertia and damping are computed anew so often
STALL_S: Final = 0.02
"""After so long between two cycles the arm stops where it is; the robot itself gives up after 20 ms."""
REST_LEAST_S: Final = 0.1
REST_MOST_S: Final = 1.0  # shortest and longest time from the order to end to the last torque


class Model(Protocol):
    """The model of `pylibfranka`; matrices are stored column by column."""

    def mass(self, state: Any, /) -> list[float]: ...
    def coriolis(self, state: Any, /) -> list[float]: ...
    def zero_jacobian(self, state: Any, /) -> list[float]: ...


class ControlLoop:
    """Follows the newest command of a slot, which the daemon writes, and publishes what the robot measures in another.

    `is_orphan` tells that the daemon is gone; `notice` is the text of the states.
    """

    def __init__(
        self,
        options: FrankaOptions,
        model: Model,
        commands: Slot,
        states: Slot,
        is_orphan: Callable[[], bool],
        notice: str = "",
    ) -> None:
        self._options, self._model, self._commands, self._states = options, model, commands, states
        self._is_orphan, self._notice = is_orphan, notice
        self._impedance: Impedance
        self._goal: Goal
        self._sensing = ExternalForce(options.tare_n)
        self._cycles = self._lost = 0
        self._last, self._longest = 0.0, 0.0
        self._ordered_at: float | None = None
        self._tip, self._speed = ZERO, 0.0
        self.finished = False  # the torques of the last `step` are to be the last ones

    def begin(self, state: Any) -> None:
        """Hold the robot where it is."""
        # With a cycle that is not sent: what is done for the first time takes several milliseconds.
        self._tip = position_of(state.O_T_EE)
        self._impedance = Impedance(self._options, np.array(state.q))
        self._goal = Goal(self._options, self._tip, orientation_of(state.O_T_EE))
        joints = self._joints(state)
        self._refresh(state, joints)
        permitted(self._impedance.torques(joints, ZERO, IDENTITY), np.array(state.tau_J_d))

    def step(self, state: Any, now: float) -> list[float]:
        """The torques of this cycle [N m], for a `pylibfranka.RobotState` that arrived `now`; ArithmeticError if they
        are not finite.
        """
        elapsed = now - self._last if self._cycles else CYCLE_S
        self._last, self._longest = now, max(self._longest, elapsed)
        joints, goal = self._joints(state), self._goal
        if self._cycles % REFRESH_CYCLES == 0:
            self._refresh(state, joints)
        self._tip, turned = position_of(state.O_T_EE), orientation_of(state.O_T_EE)
        self._speed = max(map(abs, state.dq))
        if elapsed > STALL_S:
            goal.stop()
        self._hear(now)
        goal.step(now, elapsed, self._tip, turned, self._speed)
        wanted = self._impedance.torques(joints, subtract(goal.position, self._tip), turn_between(turned, goal.turned))
        torques = permitted(wanted, np.array(state.tau_J_d))
        if not np.isfinite(torques).all():
            raise ArithmeticError("the torques are not finite")
        self._cycles += 1
        sent: list[float] = torques.tolist()
        return sent

    def report(self, state: Any, now: float, period: float) -> None:
        """Publish the state, after its torques were sent, `period` [s] after the last by the robot's clock;
        SensingError if the force cannot be used.
        """
        sensing = self._sensing
        sensing.take(state.O_F_ext_hat_K, self._impedance.spring, self._speed)
        if self._cycles > 1:
            self._lost += max(0, round(period / CYCLE_S) - 1)
        ArmState(
            phase=Phase.ENDED if self.finished else Phase.FOLLOWING if sensing.ready else Phase.STARTING,
            at=now,
            position=self._tip,
            force=sensing.force,
            torque=sensing.torque,
            joint_speed=self._speed,
            success=state.control_command_success_rate,
            cycles=self._cycles,
            lost=self._lost,
            longest_s=self._longest,
            text=self._notice,
        ).put(self._states)

    def pace(self) -> str:
        """How well the loop has kept the robot's time, for a message."""
        missing = f"; {self._notice}" if self._notice else ""
        return f"{self._lost} of {self._cycles} cycles lost, longest pause {1e3 * self._longest:.1f} ms{missing}"

    def _hear(self, now: float) -> None:
        """Take the daemon's newest command; end if it says so, or is gone."""
        command = ArmCommand.newest(self._commands)
        ends = self._is_orphan() or (command is not None and command.ends)
        if self._ordered_at is None:
            if ends:
                self._ordered_at = now
                self._goal.stop()
            elif command is not None and self._sensing.ready:
                self._goal.take(command)
            return
        since = now - self._ordered_at
        self.finished = since > REST_MOST_S or (since > REST_LEAST_S and self._speed < REST_RAD_S)

    def _joints(self, state: Any) -> Joints:
        model = self._model
        jacobian = np.array(model.zero_jacobian(state)).reshape(JOINTS, 6).T
        return Joints(np.array(state.q), np.array(state.dq), jacobian, np.array(model.coriolis(state)))

    def _refresh(self, state: Any, joints: Joints) -> None:
        mass: Array = np.array(self._model.mass(state)).reshape(JOINTS, JOINTS)
        self._impedance.refresh(mass, joints.jacobian)


def position_of(pose: list[float]) -> Vector:
    """The place of a homogeneous transform, 16 numbers, column by column [m]."""
    return (pose[12], pose[13], pose[14])
