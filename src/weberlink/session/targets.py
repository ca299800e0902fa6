"""What a long run writes: files and folders are checked before the start, and the log never blocks or raises."""

import os
import select
import sys
from collections.abc import Mapping
from contextlib import suppress
from errno import EDQUOT, ENAMETOOLONG, ENOENT, ENOSPC
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import TracebackType
from typing import Any, Self

from weberlink.figures.chain import Chain

STANDARD_OUTPUT = Path("-")  # for the options that can write there
BLOCK = bytes(4096)  # written on trial, since a file system that is full still creates empty files
LONGEST_LINE = 4096  # a pipe that accepts data takes so many bytes at once (PIPE_BUF of Linux, pipe(7))


class TargetError(ValueError):
    """The file or folder cannot be written; the text is one line that says what to do."""


def check_file(path: Path) -> None:
    """See that a file can be written; nothing is left behind, and an existing file keeps its content. Raises
    TargetError if it cannot."""
    _refuse_standard_output(path, "file")
    try:
        if path.is_dir():
            raise TargetError(f"{path} is a folder; give the name of a file")
        if path.is_file():
            os.close(os.open(path, os.O_WRONLY | os.O_CLOEXEC))
        elif path.exists():  # a FIFO, whose opening would wait for a reader, or a terminal
            if not os.access(path, os.W_OK):
                raise TargetError(f"{path} cannot be written: Permission denied; give another place")
        elif not path.parent.is_dir():
            raise TargetError(f"{path.parent} is not a folder; create it first")
        else:
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
            try:
                os.write(descriptor, BLOCK)
            finally:
                os.close(descriptor)
                path.unlink(missing_ok=True)
    except OSError as error:
        raise TargetError(_words(path, error)) from None


def check_folder(path: Path) -> None:
    """See that files can be written in a folder, which may have to be created later; nothing is left behind. Raises
    TargetError if they cannot."""
    _refuse_standard_output(path, "folder")
    try:
        there = next(each for each in (path, *path.absolute().parents) if each.exists())
        if not there.is_dir():
            raise TargetError(f"{there} is not a folder; give another place")
        with NamedTemporaryFile(dir=there, prefix=".weberlink-") as file:
            file.write(BLOCK)
            file.flush()
    except OSError as error:
        raise TargetError(_words(path, error)) from None


def _refuse_standard_output(path: Path, kind: str) -> None:
    if path == STANDARD_OUTPUT:
        raise TargetError(f"{path} is standard output, for --json and --log alone; give the name of a {kind}")


def _words(path: Path, error: OSError) -> str:
    advice = {
        ENOSPC: "free some space, or give another place",
        EDQUOT: "free some space, or give another place",
        ENAMETOOLONG: "give a shorter name",
        ENOENT: "give a place where files can be created",
    }.get(error.errno or 0, "give another place, or change its permissions")
    return f"{path} cannot be written: {error.strerror}; {advice}"


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
            from weberlink.config import ConfigurationError  # noqa: PLC0415 - who checks targets needs no configuration

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

    def close(self) -> None:
        """Close the file; may be repeated."""
        if self._own and self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
