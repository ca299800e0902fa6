"""A wall clock that can be stepped for some processes only: a small library that they preload (`wallclock.c`).

The clock of the machine stays as it is, and so does every monotonic clock. A witness, which runs under it all the time,
shows that a step is seen by who is already running. Not libfaketime: version 0.9.10 also shifts absolute timers on the
monotonic clock (timerfd_settime), which no step of a wall clock does: one armed under it expires an hour off.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from mmap import mmap
from pathlib import Path
from time import time

SOURCE = Path(__file__).with_name("wallclock.c")
SHARED_BYTES = 16
SAY = "import sys, time\nfor _ in sys.stdin: print(time.time(), flush=True)"


class WallClock:
    """The stepped clock.

    Attributes:
        offset: what it is ahead of the machine's [s].
        environment: of who runs under it.
    """

    def __init__(self, shared: mmap, environment: dict[str, str]) -> None:
        self._shared = shared
        self.offset, self.environment = 0, environment
        self.witness = subprocess.Popen(
            [sys.executable, "-c", SAY],
            env=os.environ | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def step(self, offset: int) -> None:
        """Put the clock so far ahead of the machine's [s]."""
        self.offset = offset
        self._shared[:8] = offset.to_bytes(8, sys.byteorder, signed=True)

    def witnessed(self) -> float:
        """By how much the witness sees its wall clock ahead of the machine's [s]."""
        assert self.witness.stdin is not None and self.witness.stdout is not None
        self.witness.stdin.write("\n")
        self.witness.stdin.flush()
        return float(self.witness.stdout.readline()) - time()


@contextmanager
def wall_clock(folder: Path) -> Iterator[WallClock | None]:
    """A wall clock for the daemons, or None where there is no C compiler."""
    if (compiler := shutil.which("cc")) is None:
        yield None
        return
    library, path = folder / "wallclock.so", folder / "wall-clock"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", str(library), str(SOURCE), "-ldl"], check=True)
    path.write_bytes(bytes(SHARED_BYTES))
    with path.open("r+b") as file, mmap(file.fileno(), SHARED_BYTES) as shared:
        clock = WallClock(shared, {"LD_PRELOAD": str(library), "SOAK_WALL_CLOCK": str(path)})
        try:
            yield clock
        finally:
            clock.witness.communicate(timeout=5.0)
