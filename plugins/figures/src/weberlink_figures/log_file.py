"""The file of a log, which never blocks or raises."""

import os
import select
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from weberlink.config import ConfigurationError
from weberlink.session.targets import STANDARD_OUTPUT
from weberlink_figures.chain import Chain
from weberlink_figures.journal import Journal

LONGEST_LINE = 4096  # a pipe that accepts data takes so many bytes at once (PIPE_BUF of Linux, pipe(7))


class LogFile:
    """Appends lines to a file or, for "-", to standard output; a context manager. Raises ConfigurationError if the file
    cannot be opened; from then on a full disk, a closed pipe and a stopped reader cost lines, which are counted."""

    def __init__(self, target: Path) -> None:
        self.lost = 0  # lines that could not be written
        self._own = target != STANDARD_OUTPUT
        self._torn = False
        self._chain = Chain()
        try:
            # O_NONBLOCK: a FIFO without a reader is refused instead of waited for.
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NONBLOCK
            self._fd = os.open(target, flags, 0o640) if self._own else sys.stdout.fileno()
        except OSError as error:
            raise ConfigurationError(f"--log: {target}: {error.strerror}") from None

    def write_json(self, document: Mapping[str, Any]) -> bool:
        """Append a line of JSON to the chain of this session; ValueError for a number that is not finite."""
        line = self._chain.line(document)
        if is_written := self.write(line):
            self._chain.append(line)
        return is_written

    def write(self, line: str) -> bool:
        """Append a line, given without its end; returns whether all of it was written."""
        data = line.encode() + b"\n"
        if self._torn:  # an earlier line was written in part
            data = b"\n" + data
        done = 0
        if self._fd >= 0 and len(data) <= LONGEST_LINE:
            with suppress(OSError):
                look = select.poll()
                look.register(self._fd, select.POLLOUT)
                done = os.write(self._fd, data) if look.poll(0) else 0
        self._torn = (self._torn and done <= 0) or 0 < done < len(data)
        if done < len(data):
            self.lost += 1
        return done == len(data)

    def trace(self, entries: Sequence[str]) -> None:
        """Write the trace of an error that prevents the session."""
        Journal(self.write_json, 0.0).trace(entries)

    def close(self) -> None:
        """Close the file; may be repeated."""
        if self._own and self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
