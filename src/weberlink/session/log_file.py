"""The target of a log: a file that is appended to, or standard output.

Nothing here blocks or raises once the target is open: a full disk, a closed pipe and a stopped reader cost lines, which
are counted.
"""

import os
import select
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from weberlink.config import ConfigurationError
from weberlink.session.targets import STANDARD_OUTPUT

LONGEST_LINE = 4096
"""A pipe that accepts data takes so many bytes at once (PIPE_BUF of Linux, pipe(7))."""


class LogFile:
    """Writes lines; a context manager.

    Args:
        target: a path, or "-" for standard output.

    Raises:
        ConfigurationError: the file cannot be opened.
    """

    def __init__(self, target: Path) -> None:
        self.lost = 0
        """Lines that could not be written."""
        self._own = target != STANDARD_OUTPUT
        self._torn = False
        try:
            # O_NONBLOCK: a FIFO without a reader is refused instead of waited for.
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NONBLOCK
            self._fd = os.open(target, flags, 0o640) if self._own else sys.stdout.fileno()
        except OSError as error:
            raise ConfigurationError(f"--log: {target}: {error.strerror}") from None

    def write(self, line: str) -> bool:
        """Append a line, given without its end; returns whether all of it was written."""
        data = line.encode() + b"\n"
        if self._torn:  # an earlier line was written in part
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
        """Close the file; may be repeated."""
        if self._own and self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
