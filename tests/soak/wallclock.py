"""A wall clock that can be stepped for some processes only: a small library that they preload (`wallclock.c`).

The clock of the machine stays as it is, and so does every monotonic clock. A witness, which runs under it all the time,
shows that a step is seen by who is already running. Not libfaketime: version 0.9.10 also shifts absolute timers on the
monotonic clock (timerfd_settime), which no step of a wall clock does: one armed under it expires an hour off.
"""

import mmap
import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import time

SOURCE = Path(__file__).with_name("wallclock.c")
_SHARED = struct.Struct("<qq")
_SAY = "import sys, time\nfor _ in sys.stdin: print(time.time(), flush=True)"


class WallClock:
    """The stepped clock; `offset` is what it is ahead of the machine's [s]."""

    def __init__(self, folder: Path, library: Path) -> None:
        path = folder / "wall-clock"
        path.write_bytes(bytes(_SHARED.size))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _SHARED.size)
        self.offset = 0
        self.environment = {"LD_PRELOAD": str(library), "SOAK_WALL_CLOCK": str(path)}
        self._witness = subprocess.Popen(
            [sys.executable, "-c", _SAY],
            env={**os.environ, **self.environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    @property
    def asked(self) -> int:
        """How often any process under it has asked for the time of day."""
        asked: int = _SHARED.unpack_from(self._map)[1]
        return asked

    def step(self, offset: int) -> None:
        """Put the clock so far ahead of the machine's [s]."""
        self.offset = offset
        self._map[:8] = struct.pack("<q", offset)

    def witnessed(self) -> float:
        """By how much the witness sees its wall clock ahead of the machine's [s]."""
        assert self._witness.stdin is not None
        assert self._witness.stdout is not None
        self._witness.stdin.write("\n")
        self._witness.stdin.flush()
        return float(self._witness.stdout.readline()) - time()

    def close(self) -> None:
        assert self._witness.stdin is not None
        assert self._witness.stdout is not None
        self._witness.stdin.close()
        self._witness.wait(5.0)
        self._witness.stdout.close()
        self._map.close()


def build(folder: Path) -> Path | None:
    """The library, made in a folder; None where there is no C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    library = folder / "wallclock.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", str(library), str(SOURCE), "-ldl"], check=True)
    return library


@contextmanager
def wall_clock(folder: Path) -> Iterator[WallClock | None]:
    """A wall clock for the daemons, or None where it cannot be built."""
    library = build(folder)
    if library is None:
        yield None
        return
    clock = WallClock(folder, library)
    try:
        yield clock
    finally:
        clock.close()
