"""Where lines of a log go: a file that is added to, or standard output. Losing a line is better than waiting for one.

Knows nothing of what the lines say. Nothing here blocks or raises once it is open: a full disk, a closed pipe and a
reader that has stopped cost lines, which are counted.
"""

import os
import select
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from weberlink.system.configuration import ConfigurationError

STANDARD_OUTPUT = "-"
LONGEST_LINE = 4096
"""A pipe that can be written to at all takes so much at once (PIPE_BUF of Linux, pipe(7))."""


class LogFile:
    """Takes lines; a context manager.

    Args:
        target: a path, or "-" for standard output.

    Raises:
        ConfigurationError: the file cannot be opened.
    """

    def __init__(self, target: Path) -> None:
        self.lost = 0
        """Lines that could not be written."""
        self._own = str(target) != STANDARD_OUTPUT
        self._torn = False
        try:
            # Without waiting: a FIFO that nobody reads is refused.
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NONBLOCK
            self._fd = os.open(target, flags, 0o640) if self._own else sys.stdout.fileno()
        except OSError as error:
            raise ConfigurationError(f"--log: {target}: {error.strerror}") from None

    def write(self, line: str) -> bool:
        """Add a line, which has no end of line yet; returns whether it is there."""
        data = line.encode() + b"\n"
        if self._torn:  # part of an earlier line stands there
            data = b"\n" + data
        done = self._write(data)
        self._torn = (self._torn and done <= 0) or 0 < done < len(data)
        if done < len(data):
            self.lost += 1
        return done == len(data)

    def _write(self, data: bytes) -> int:
        if self._fd < 0 or len(data) > LONGEST_LINE:
            return 0
        try:
            look = select.poll()
            look.register(self._fd, select.POLLOUT)
            return os.write(self._fd, data) if look.poll(0) else 0
        except OSError:
            return 0

    def close(self) -> None:
        """Let go of it; may be repeated."""
        if self._own and self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
