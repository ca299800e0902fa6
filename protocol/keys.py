"""Keys, what each may be used for, and the files that hold them, which only their owner may read.

Each line is `weberlink-key-1 <64 hexadecimal digits> [RIGHT [NAME]]`. The line at the robot's end decides what a key is
good for; the other end has a file with the same line alone.
"""

import errno
import os
import secrets
import shlex
import stat
from enum import StrEnum
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

KEY_BYTES = 32
LONGEST_NAME = 64  # characters of the name of an end
_LABEL = "weberlink-key-1"
_LONGEST_FILE = 65_536


class Right(StrEnum):
    """What a key is good for, and what a call asks for."""

    DRIVE = "drive"  # all of these
    WATCH = "watch"  # to be told how the robot's end is, and whom it serves
    STOP = "stop"  # to stop the robot's end

    def allows(self, asked: str) -> bool:
        return self in (Right.DRIVE, asked)


class Grant(NamedTuple):
    """What a key is good for, under which name ("" for any), and its number, which does not tell the key."""

    right: Right = Right.DRIVE
    name: str = ""
    number: str = ""


class HeldKey(NamedTuple):
    """A key of `KEY_BYTES`, its right, and the only name that may use it; "" for all that no other key has."""

    key: bytes
    right: Right = Right.DRIVE
    name: str = ""

    @property
    def grant(self) -> Grant:
        return Grant(self.right, self.name, sha256(b"number of a weberlink key" + self.key).hexdigest()[:16])


def is_name(name: object) -> bool:
    return isinstance(name, str) and 1 <= len(name) <= LONGEST_NAME and name.isprintable()


def check_name(name: str) -> str:
    """The name of an end; ValueError if it is empty, too long, or not printable."""
    if not is_name(name):
        raise ValueError(f"a name has 1 to {LONGEST_NAME} printable characters, not {name!r}")
    return name


class KeyFileError(ValueError):
    """The key file cannot be used; the message says which and what to do."""


def generate(path: Path, right: Right = Right.DRIVE, name: str = "") -> None:
    """Write a new random key, mode 0600, for the end of this name; "" for any, which may drive.

    Raises KeyFileError if there is such a file already (it is left as it is), if none can be made there, or if a key
    that may not drive has no name."""
    words = [_LABEL, secrets.token_hex(KEY_BYTES), *([right, name] if name else [])]
    if right is not Right.DRIVE and not name:
        raise KeyFileError(_NAMELESS)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise KeyFileError(f"{path} exists already; a key is never overwritten") from None
    except OSError as problem:
        raise KeyFileError(f"{path} cannot be written: {problem.strerror}") from None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        os.fchmod(descriptor, 0o600)
        file.write(" ".join(words) + "\n")


def load(path: Path) -> tuple[HeldKey, ...]:
    """Read the keys, one at least; KeyFileError as of `read_private`, or if it is not a key file."""
    content = read_private(path, f"`weberlink keygen {shlex.quote(str(path))}` makes a key")
    keys = tuple(_read_line(path, line) for line in content.decode(errors="replace").splitlines() if line.strip())
    if not keys:
        raise KeyFileError(f"{path} is not a key file; {_EXPECTED}")
    names = [key.name for key in keys]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise KeyFileError(f"{path} has two keys for {twice!r}; remove one")
    if names.count("") > 1:
        raise KeyFileError(f"{path} has two keys without a name; write behind one: drive NAME")
    return keys


def _read_line(path: Path, line: str) -> HeldKey:
    label, digits, right, name = (*line.split(maxsplit=3), "", "", "", "")[:4]
    try:
        key = bytes.fromhex(digits)
    except ValueError:
        key = b""
    if not key:
        raise KeyFileError(f"{path} is not a key file; {_EXPECTED}")
    if label != _LABEL:
        raise KeyFileError(f"{path} starts with {label!r}; expected {_LABEL!r}")
    if len(key) != KEY_BYTES:
        raise KeyFileError(f"{path} holds a key of {len(key)} bytes; expected {KEY_BYTES}")
    if right not in ("", *Right):
        raise KeyFileError(f"{path}: a key may {', '.join(Right)}, not {right!r}")
    held = HeldKey(key, Right(right or Right.DRIVE), name.strip())
    if held.name and not is_name(held.name):
        raise KeyFileError(f"{path}: a name has at most {LONGEST_NAME} printable characters, not {held.name!r}")
    if held.right is not Right.DRIVE and not held.name:
        raise KeyFileError(f"{path}: {_NAMELESS}")
    return held


_EXPECTED = f"expected in each line: {_LABEL}, hexadecimal digits, and perhaps a right and a name"
_NAMELESS = "a key that may not drive needs the name of the host that holds it"


def read_private(path: Path, advice: str, longest: int = _LONGEST_FILE) -> bytes:
    """The first `longest` bytes of a file that only its owner may read; `advice` says what to do if it is missing.

    Raises KeyFileError if the file is missing, a symbolic link, of another user than this one or root, or open to
    other users."""
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
