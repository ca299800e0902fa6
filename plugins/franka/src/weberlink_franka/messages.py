"""What the daemon and the controller process tell each other: one slot in shared memory for each direction.

Times are of `time.monotonic`, which all processes of a machine share [s]. Positions, forces and orientations are in the
base frame of the robot.
"""

from enum import IntEnum
from mmap import mmap
from struct import Struct
from typing import NamedTuple, Self

from weberlink.geometry.rotation import IDENTITY, Quaternion
from weberlink.geometry.vector import ZERO, Vector
from weberlink.slot import Slot, size_of

COMMAND = Struct("<d3d4dQ")
STATE = Struct("<Qd3d3d3dddQQd256s")
COMMAND_AT = 0
STATE_AT = 128
MEMORY_SIZE = 1024
assert size_of(COMMAND) <= STATE_AT
assert STATE_AT + size_of(STATE) <= MEMORY_SIZE


class Phase(IntEnum):
    """What the controller is doing."""

    STARTING = 0  # it connects, and measures the offset of the force; the arm holds
    FOLLOWING = 1  # the arm follows fresh commands, and holds without
    ENDED = 2  # the arm came to rest, and the controller has left it
    FAILED = 3  # the robot or the connection refuses, as the text says; the robot stops by itself


class ArmCommand(NamedTuple):
    """Where the tip is to go."""

    at: float  # when it was commanded [s]
    position: Vector = ZERO  # of the tip [m]
    orientation: Quaternion = IDENTITY  # relative to that at opening
    ends: bool = False  # the controller is to bring the arm to rest and end

    def put(self, slot: Slot) -> None:
        slot.write(self.at, *self.position, *self.orientation, self.ends)

    @classmethod
    def newest(cls, slot: Slot) -> Self | None:
        """What was written since the last call."""
        values = slot.newest()
        if values is None:
            return None
        at, x, y, z, qw, qx, qy, qz, ends = values
        return cls(at, (x, y, z), (qw, qx, qy, qz), bool(ends))


class ArmState(NamedTuple):
    """What the robot measures."""

    phase: Phase  # of the controller
    at: float  # when the state arrived [s]
    position: Vector = ZERO  # of the tip [m]
    force: Vector = ZERO  # of the environment on the robot [N], without the offset at opening
    torque: Vector = ZERO  # of the environment on the robot about the tip [N m]
    joint_speed: float = 0.0  # of the fastest joint [rad/s]
    success: float = 0.0  # share of the robot's last 100 cycles that were answered in time
    cycles: int = 0  # of the control loop
    lost: int = 0  # cycles of the robot that passed without an answer
    longest_s: float = 0.0  # longest time between two states [s]
    text: str = ""  # why it failed, or what a person should know

    def put(self, slot: Slot) -> None:
        (x, y, z), (fx, fy, fz), (tx, ty, tz) = self.position, self.force, self.torque
        text = self.text.encode()[:256].decode(errors="ignore").encode()
        slot.write(self.phase, self.at, x, y, z, fx, fy, fz, tx, ty, tz, *self[5:10], text)

    @classmethod
    def newest(cls, slot: Slot) -> Self | None:
        """What was written since the last call."""
        values = slot.newest()
        if values is None:
            return None
        phase, at, x, y, z, fx, fy, fz, tx, ty, tz, speed, success, cycles, lost, longest, text = values
        words = text.rstrip(b"\0").decode()
        place, force, torque = (x, y, z), (fx, fy, fz), (tx, ty, tz)
        return cls(Phase(phase), at, place, force, torque, speed, success, cycles, lost, longest, words)


def command_slot(memory: mmap) -> Slot:
    """From the daemon to the controller."""
    return Slot(memory, COMMAND_AT, COMMAND)


def state_slot(memory: mmap) -> Slot:
    """From the controller to the daemon."""
    return Slot(memory, STATE_AT, STATE)
