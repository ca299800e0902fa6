"""Write and read key files: `weberlink-key-1 <64 hexadecimal digits>`, one line that only its owner may read."""

import errno
import os
import secrets
import shlex
import stat
from pathlib import Path

KEY_BYTES = 32
_LABEL = "weberlink-key-1"
_LONGEST_FILE = 256


class KeyFileError(ValueError):
    """The key file cannot be used; the message says which and what to do."""


def generate(path: Path) -> None:
    """Write a new random key, mode 0600.

    Raises KeyFileError if there is such a file already (it is left as it is), or none can be made there.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise KeyFileError(f"{path} exists already; a key is never overwritten") from None
    except OSError as problem:
        raise KeyFileError(f"{path} cannot be written: {problem.strerror}") from None
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        os.fchmod(descriptor, 0o600)
        file.write(f"{_LABEL} {secrets.token_hex(KEY_BYTES)}\n")


def load(path: Path) -> bytes:
    """Read the key, of `KEY_BYTES`; KeyFileError as of `read_private`, or if it is not a key file."""
    content = read_private(path, f"`weberlink keygen {shlex.quote(str(path))}` makes a key")
    words = content.decode("ascii", errors="replace").split()
    try:
        label, digits = words
        key = bytes.fromhex(digits)
    except ValueError:
        raise KeyFileError(f"{path} is not a key file; expected one line: {_LABEL} and hexadecimal digits") from None
    if label != _LABEL:
        raise KeyFileError(f"{path} starts with {label!r}; expected {_LABEL!r}")
    if len(key) != KEY_BYTES:
        raise KeyFileError(f"{path} holds a key of {len(key)} bytes; expected {KEY_BYTES}")
    return key


def read_private(path: Path, advice: str, longest: int = _LONGEST_FILE) -> bytes:
    """The first `longest` bytes of a file that only its owner may read; `advice` says what to do if it is missing.

    Raises KeyFileError if the file is missing, a symbolic link, of another user than this one or root, or open to
    other users.
    """
    quoted = shlex.quote(str(path))
    try:
        # O_NONBLOCK: nothing waits for a pipe by that name.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
    except FileNotFoundError:
        raise KeyFileError(f"{path} does not exist; {advice}") from None
    except OSError as problem:
        if problem.errno == errno.ELOOP:
            raise KeyFileError(f"{path} is a symbolic link; name the file itself") from None
        raise KeyFileError(f"{path} cannot be read: {problem.strerror}") from None
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise KeyFileError(f"{path} is not a file")
        owner, user = status.st_uid, os.geteuid()
        if owner not in (0, user):  # the owner could replace the key at any time
            raise KeyFileError(f"{path} belongs to user id {owner}, this is {user}; run: sudo chown {user} {quoted}")
        if status.st_mode & 0o077:
            mode = stat.S_IMODE(status.st_mode)
            raise KeyFileError(f"{path} is open to other users (mode {mode:04o}); run: chmod 600 {quoted}")
        return os.read(descriptor, longest)
    finally:
        os.close(descriptor)
