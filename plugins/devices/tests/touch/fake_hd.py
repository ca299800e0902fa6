"""The fake libHD of `fake_hd.c`, compiled, and the board of a device that it drives."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import c_double, c_int32, c_int64, c_uint64
from math import hypot
from mmap import mmap
from pathlib import Path
from typing import Self

import pytest

from plugins.devices.tests.compiler import compiled
from weberlink.geometry.vector import ZERO, Vector, norm

SOURCE = Path(__file__).with_name("fake_hd.c")
FOLDER = "FAKE_HD_FOLDER"
DEFAULT = "Default Device"
FORCE_OUTPUT = 1
CYCLES, LOGGED = 1 << 17, 1 << 14


class Entry(ctypes.Structure):
    _fields_ = (("at", c_int64), ("force", c_double * 3))


class Board(ctypes.Structure):
    """`struct board` of the fake."""

    _fields_ = (
        ("centre", c_double * 3),
        ("radius", c_double),
        ("turns_per_s", c_double),
        ("rotation", c_double * 9),
        ("max_force", c_double),
        ("continuous_force", c_double),
        ("stiffness", c_double),
        ("workspace", c_double * 6),
        *((name, c_int32) for name in ("buttons", "calibration", "style", "unlicensed")),
        *((name, c_int32) for name in ("unplugged", "silent", "error", "errors_left")),
        *((name, c_int32) for name in ("jams", "jammed", "owner", "enabled")),
        ("force", c_double * 3),
        ("force_at", c_int64),
        *((name, c_uint64) for name in ("frames", "updates", "cycles", "logged")),
        ("late", c_int64 * CYCLES),
        ("log", Entry * LOGGED),
    )

    @classmethod
    def made(cls, path: Path) -> Self:
        """The board of a Touch in a new file: calibrated, its handle on a circle of 30 mm, two seconds a turn."""
        with path.open("w+b") as file:
            file.truncate(ctypes.sizeof(cls))
            board = cls.from_buffer(mmap(file.fileno(), 0))
        board.centre[:] = (0.0, 0.0, 0.0)
        board.radius, board.turns_per_s = 30.0, 0.5
        board.rotation[:] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        board.max_force, board.continuous_force, board.stiffness = 3.3, 0.88, 0.5
        board.workspace[:] = (-210.0, -110.0, -85.0, 210.0, 205.0, 130.0)
        board.calibration, board.style = 0x5000, 4
        return board

    @property
    def felt(self) -> Vector:
        """Force on the hand [N], in the frame of the driver: the library's is x right, y up, z toward the operator."""
        x, y, z = self.force
        return (z, x, y) if self.enabled & FORCE_OUTPUT else ZERO

    @property
    def displayed(self) -> float:
        """Its size [N]."""
        return norm(self.felt)

    @property
    def forces(self) -> list[tuple[float, float]]:
        """Each change of the force: when [s, CLOCK_MONOTONIC], and its size then [N]."""
        assert self.logged <= LOGGED
        return [(1e-9 * self.log[i].at, hypot(*self.log[i].force)) for i in range(self.logged)]


def library() -> Path:
    return compiled(SOURCE, "libHD.so")


@contextmanager
def plugged(folder: Path, *names: str) -> Iterator[tuple[Board, ...]]:
    """Devices with these names, which programs started meanwhile find."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER, str(folder))
        yield tuple(Board.made(folder / name) for name in names or (DEFAULT,))
