"""What the daemon and the process of the servo loop exchange: two slots in shared memory, and lines of JSON."""

from struct import Struct
from typing import NamedTuple

from weberlink.geometry.vector import Vector
from weberlink.hardware.slot import size_of

FORCE = Struct("<4d")
"""When it was commanded [s], and the force [N] in the frame of the library."""
STATE = Struct("<Qd3d9d3diIi")
"""See `ServoState`; the transform by columns, without its last row."""
FORCE_AT = 0
STATE_AT = 64
MEMORY_SIZE = STATE_AT + size_of(STATE)

END = b"x"
"""From the daemon: end the servo loop."""


class ServoState(NamedTuple):
    """One frame of the servo loop.

    Args:
        frames: number of the frame.
        at: when it began [s, CLOCK_MONOTONIC].
        position: of the handle, in the frame of the library [mm].
        axes: x, y and z axis of the handle in the frame of the library, one after another.
        force: that the frame put on the hand [N], in the frame of the library.
        buttons: bit i while button i is pressed.
        error: of the frame; 0 for none.
        internal: the number that the device gave for the error.
    """

    frames: int
    at: float
    position: Vector
    axes: tuple[Vector, Vector, Vector]
    force: Vector
    buttons: int
    error: int
    internal: int


def unpacked(values: tuple[float, ...]) -> ServoState:
    """The state from the values of its slot."""
    frames, at, px, py, pz, xx, xy, xz, yx, yy, yz, zx, zy, zz, fx, fy, fz, buttons, error, internal = values
    return ServoState(
        int(frames),
        at,
        (px, py, pz),
        ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz)),
        (fx, fy, fz),
        int(buttons),
        int(error),
        int(internal),
    )
