"""Files and folders that a long run writes are checked before its start."""

import os
from errno import EDQUOT, ENAMETOOLONG, ENOENT, ENOSPC
from pathlib import Path
from tempfile import NamedTemporaryFile

STANDARD_OUTPUT = Path("-")  # for the options that can write there
BLOCK = bytes(4096)  # written on trial, since a file system that is full still creates empty files


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
