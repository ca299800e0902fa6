"""The control loop on the stand-in arm, in virtual time."""

from collections.abc import Callable

from plugins.franka.tests.library import Arm, Model, RobotMode, RobotState
from weberlink.geometry.rotation import IDENTITY, Quaternion
from weberlink.geometry.vector import Vector
from weberlink_franka.control_loop import CYCLE_S, ControlLoop
from weberlink_franka.messages import MEMORY_SIZE, ArmCommand, ArmState, Phase, command_slot, state_slot
from weberlink_franka.options import FrankaOptions


class LoopBench:
    """An arm under the loop, after its force was tared."""

    def __init__(self, scenario: str = "arm", **options: object) -> None:
        self.arm = Arm(scenario)
        self.arm.mode = RobotMode.Move
        self.now = 100.0
        self.orphaned = False
        self.largest_step = 0.0  # largest change of a torque in a cycle [N m]
        memory = bytearray(MEMORY_SIZE)
        self._written, self._read = command_slot(memory), state_slot(memory)
        slots = command_slot(memory), state_slot(memory)
        self.loop = ControlLoop(FrankaOptions.model_validate(options), Model(), *slots, lambda: self.orphaned)
        self.loop.begin(RobotState(self.arm))
        self.state = ArmState(Phase.STARTING, self.now)
        while self.state.phase is Phase.STARTING:
            self.cycle()

    def cycle(self, elapsed: float = CYCLE_S, goal: Vector | None = None) -> ArmState:
        """One cycle of the robot; a longer one is a pause of the loop. A goal is commanded just before it."""
        self.now += elapsed
        if goal is not None:
            self.command(goal)
        for _ in range(round(elapsed / CYCLE_S)):
            self.arm.step()
        state = RobotState(self.arm)
        torques = self.loop.step(state, self.now)
        self.largest_step = max(self.largest_step, *(abs(a - b) for a, b in zip(torques, self.arm.torque, strict=True)))
        self.arm.torque[:] = torques
        self.loop.report(state, self.now, elapsed)
        self.state = ArmState.newest(self._read) or self.state
        return self.state

    def command(self, position: Vector, orientation: Quaternion = IDENTITY, *, ends: bool = False) -> None:
        ArmCommand(self.now, position, orientation, ends).put(self._written)

    def lead(self, goal: Vector, seconds: float, orientation: Quaternion = IDENTITY) -> ArmState:
        """Command the same place in every cycle."""
        for _ in range(round(seconds / CYCLE_S)):
            self.command(goal, orientation)
            self.cycle()
        return self.state

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> ArmState:
        """Let it run without commands."""
        end = self.now + seconds
        while self.now < end - 0.5 * CYCLE_S and not until():
            self.cycle()
        return self.state
