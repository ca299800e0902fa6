"""The robot `franka`: the daemon's end, which only writes and reads slots in shared memory."""

import os
from collections.abc import Sequence
from math import sqrt
from time import monotonic, sleep
from typing import ClassVar, Final

from weberlink.child_process import Child, process_columns, python, shared_memory
from weberlink.geometry.rotation import IDENTITY, Quaternion, unit_quaternion
from weberlink.geometry.vector import Vector, is_finite, within
from weberlink.hardware.discovery import PluggedDevice
from weberlink.registry import Tier
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.scenes.scene import Scene
from weberlink.slot import Slot
from weberlink_franka.messages import MEMORY_SIZE, ArmCommand, ArmState, Phase, command_slot, state_slot
from weberlink_franka.options import FrankaOptions

NAME: Final = "franka"
PROGRAM: Final = tuple(python("-m", "weberlink_franka.controller"))
RATE_HZ: Final = 1000.0
TIP_KG: Final = 5.0  # mass that the arm has at its tip, about: 4 to 6 kg in franka-sim, by direction
START_S: Final = 15.0  # longest time from the start of the controller to the end of its tare [s]
LATE_S: Final = 0.03  # time without a state after which it is checked that the controller lives [s]
FORCE_ERROR_N: Final = 2.0
"""What the estimate shows at rest without any contact, and changes with the posture (franka_ros issue 404) [N]."""
END_S: Final = 2.0  # longest time for the controller to bring the arm to rest and end [s]
POLL_S: Final = 0.005
POOR: Final = 0.95  # share of the robot's cycles; with fewer answered in time it is worth a word


class FrankaRobot:
    """An FR3 under Cartesian impedance, whose controller process owns the connection; ValueError if given a scene."""

    TIER: ClassVar[Tier] = "judged by others"
    Options = FrankaOptions
    # The package that the controller needs, and the extra of this project that brings it.
    NEEDS: ClassVar[tuple[str, str]] = ("pylibfranka", "franka")

    @classmethod
    def plugged(cls) -> list[PluggedDevice] | None:
        """None, since it cannot be listed: a robot in a network is named by the option `host`."""
        return None

    def __init__(
        self,
        options: FrankaOptions,
        scene: Scene | None,
        tick_period: float,  # noqa: ARG002
        program: Sequence[str] = PROGRAM,
    ) -> None:
        if scene is not None:
            raise ValueError(f"scene: {NAME} is a real robot and touches what is in front of it; leave the scene out")
        self._options, self._program = options, program
        self.spec = _spec(options)
        self._child: Child | None = None
        self._commands: Slot | None = None
        self._states: Slot | None = None
        self._state = ArmState(Phase.STARTING, 0.0)
        self._reading: tuple[float, RobotReading] | None = None
        self._orientation = IDENTITY

    @property
    def state(self) -> ArmState:
        """The newest state that `latest` or `open` has seen."""
        return self._state

    @property
    def controller_pid(self) -> int | None:
        """Process id of the controller; None while there is none."""
        return None if self._child is None else self._child.pid

    @property
    def trouble(self) -> str | None:
        state, child = self._state, self._child
        if state.phase is not Phase.FOLLOWING or child is None:
            return None
        silent = monotonic() - state.at
        if silent > LATE_S:
            words = "; its controller process is stopped" if _is_stopped(child.pid) else ""
            return f"no state of the robot for {1e3 * silent:.0f} ms{words}"
        if state.success >= POOR or state.cycles < RATE_HZ:
            return None
        words = f"the controller answers {state.success:.0%} of the robot's cycles in time"
        return f"{words} ({state.text})" if state.text else words

    def open(self, now: float) -> None:  # noqa: ARG002
        self.close()
        try:
            with shared_memory("weberlink-franka", MEMORY_SIZE) as (shared, memory):
                self._child = Child(
                    [*self._program, str(memory), str(os.getpid()), self._options.model_dump_json()],
                    stdout=2,
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # its threads would only take processors away
                    pass_fds=(memory,),
                )
        except OSError as error:
            raise RobotFault(f"{NAME}: its controller process cannot be started: {error.strerror}") from None
        self._commands, self._states = command_slot(shared), state_slot(shared)
        self._orientation = IDENTITY
        try:
            self._wait_for_start(monotonic() + START_S)
        except BaseException:
            self.close()
            raise

    def _wait_for_start(self, until: float) -> None:
        assert self._states is not None
        while self._state.phase is not Phase.FOLLOWING:
            self._state = ArmState.newest(self._states) or self._state
            if self._state.phase is Phase.FAILED or monotonic() > until:
                break
            self._check_alive()
            sleep(POLL_S)
        if self._state.phase is Phase.FAILED:
            raise RobotFault(f"{NAME}: {self._state.text}")
        if self._state.phase is not Phase.FOLLOWING:
            raise RobotFault(f"{NAME}: no answer from {self._options.host} within {START_S:g} s")

    def command(self, position: Vector, now: float) -> None:
        if not is_finite(position):
            raise ValueError(f"{NAME}: commanded a position that is not finite: {position}")
        if self._commands is not None:
            ArmCommand(now, position, self._orientation).put(self._commands)

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
        """Turn with the next command; no effect without the option `torque_n_m`."""
        held = unit_quaternion(orientation)
        if held is None:
            raise ValueError(f"{NAME}: commanded an orientation that is none: {orientation}")
        if self._options.torque_n_m > 0.0:
            self._orientation = held

    def latest(self, now: float) -> RobotReading:
        if self._states is None:
            raise RobotFault(f"{NAME}: not open")
        self._state = ArmState.newest(self._states) or self._state
        if self._reading is not None and now <= self._reading[0]:
            return self._reading[1]
        self._check(now)
        state, options = self._state, self._options
        force, torque = within(state.force, options.force_n), within(state.torque, options.torque_n_m)
        at = min(state.at, now)
        reading = RobotReading(at, state.position, force, torque, sampled_at=at)
        self._reading = (now, reading)
        return reading

    def _check(self, now: float) -> None:
        """Raises RobotFault if the controller cannot go on."""
        state = self._state
        if state.phase is Phase.FAILED:
            raise RobotFault(f"{NAME}: {state.text}")
        if state.phase is Phase.ENDED:
            raise RobotFault(f"{NAME}: its controller process has ended")
        if now - state.at > LATE_S:
            self._check_alive()
        if now - state.at > self._options.lost_s:
            raise RobotFault(f"{NAME}: no state of the robot for {1e3 * (now - state.at):.0f} ms")

    def _check_alive(self) -> None:
        assert self._child is not None
        if self._child.running or self._states is None:
            return
        self._state = ArmState.newest(self._states) or self._state  # its last words may have come after the last look
        if self._state.phase is Phase.FAILED:
            raise RobotFault(f"{NAME}: {self._state.text}")
        if self._state.phase is not Phase.ENDED:
            raise RobotFault(f"{NAME}: its controller process {self._child.how_it_ended}; the robot stops by itself")

    def close(self) -> None:
        """Have the controller bring the arm to rest and end; at most 2 s, then it is killed and the robot stops."""
        child, self._child = self._child, None
        commands, self._commands, self._states = self._commands, None, None
        self._state, self._reading = ArmState(Phase.STARTING, 0.0), None
        if child is None:
            return
        if commands is not None:
            ArmCommand(monotonic(), ends=True).put(commands)
        child.end(END_S)


def _is_stopped(pid: int) -> bool:
    """Whether a signal has stopped this process."""
    return (process_columns(pid) or [""])[0] == "T"


def _spec(options: FrankaOptions) -> RobotSpec:
    # Behind a ramp of the command, for the mass of the arm at its tip.
    lag_s = 2.0 * options.damping_ratio * sqrt(TIP_KG / options.stiffness_n_m)
    return RobotSpec(
        name=NAME,
        axes="xyz",
        force_n=options.force_n,
        stiffness_n_m=options.stiffness_n_m,
        workspace_m=options.workspace_m,
        rate_hz=RATE_HZ,
        force_sensing=True,
        lag_s=1.0 / RATE_HZ,
        force_error=(FORCE_ERROR_N, 0.0),
        torque_n_m=options.torque_n_m,
        watchdog_s=options.stale_s,
        note=(
            "the force is the robot's estimate (O_F_ext_hat_K), without its offset at opening; the tip lags its "
            f"command by about {lag_s:.2f} s, for which codec.force.predictor zoh feels contacts best"
        ),
    )
