"""What the daemon and the process of the servo loop exchange: three slots in shared memory."""

import json
from enum import IntEnum
from mmap import mmap
from struct import Struct
from typing import Any, NamedTuple

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slot import Slot, size_of

FORCE = Struct("<4dB")
"""When it was commanded [s], the force [N] in the frame of the library, and 1 to end the servo loop."""
STATE = Struct("<Qd3d9d3diIi")
"""A `ServoState`."""
REPORT = Struct("<B1000s")
"""A `Phase`, and JSON padded with spaces: of a `READY` device what the library says of it, of a `FAILED` one why."""
FORCE_AT = 0
STATE_AT = FORCE_AT + size_of(FORCE)
REPORT_AT = STATE_AT + size_of(STATE)
MEMORY_SIZE = REPORT_AT + size_of(REPORT)


class Phase(IntEnum):
    """What the process of the servo loop is doing."""

    STARTING = 0
    READY = 1
    FAILED = 2
    """There is no force, and it waits to be ended."""


class ServoState(NamedTuple):
    """One frame of the servo loop; vectors are in the frame of the library."""

    frames: int  # number of the frame
    at: float  # when it began [s, CLOCK_MONOTONIC]
    position: Vector  # of the handle [mm]
    axes: tuple[Vector, Vector, Vector]  # x, y and z axis of the handle
    force: Vector  # that the frame put on the hand [N]
    buttons: int  # bit i while button i is pressed
    error: int  # of the frame; 0 for none
    internal: int  # the number that the device gave for the error


BEFORE_FIRST = ServoState(0, 0.0, ZERO, (ZERO, ZERO, ZERO), ZERO, 0, 0, 0)


class ServoMemory:
    """The slots in `MEMORY_SIZE` bytes, for either end."""

    def __init__(self, memory: mmap | bytearray) -> None:
        self._memory = memory
        self.force = Slot(memory, FORCE_AT, FORCE)
        self.state = Slot(memory, STATE_AT, STATE)
        self._report = Slot(memory, REPORT_AT, REPORT)
        self._watched = Slot(memory, FORCE_AT, FORCE)
        self._ends = False

    def newest_state(self) -> ServoState | None:
        """The newest state if it is another one than at the last call; None otherwise."""
        values = self.state.newest()
        if values is None:
            return None
        frames, at, px, py, pz, xx, xy, xz, yx, yy, yz, zx, zy, zz, fx, fy, fz, buttons, error, internal = values
        axes = ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))
        return ServoState(frames, at, (px, py, pz), axes, (fx, fy, fz), buttons, error, internal)

    def told_to_end(self) -> bool:
        """Whether the daemon ends the servo loop; takes nothing from who else reads the slot of the force."""
        values = self._watched.newest()
        if values is not None:
            self._ends = bool(values[4])
        return self._ends

    def say(self, phase: Phase, content: object = None) -> None:
        """Report a phase; a text that is too long is cut."""
        text = json.dumps(content)
        while len(text) > REPORT.size - 1:
            content = str(content)[:-100]
            text = json.dumps(content)
        self._report.write(phase, text.ljust(REPORT.size - 1).encode())

    def heard(self) -> tuple[Phase, Any] | None:
        """The newest report if it is another one than at the last call; None otherwise."""
        values = self._report.newest()
        return None if values is None else (Phase(values[0]), json.loads(values[1]))

    def close(self) -> None:
        if isinstance(self._memory, mmap):
            self._memory.close()
