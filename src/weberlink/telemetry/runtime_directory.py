"""The private in-memory directory of a user for rings, descriptions and control sockets.

It is the first of `$XDG_RUNTIME_DIR/weberlink`, `/run/user/UID/weberlink` and `/dev/shm/weberlink-UID`. The first two
need a parent directory of this user on a tmpfs. In `/dev/shm` everybody may create files; where another user has taken
the name, a random suffix is added.
"""

import os
import pwd
import socket
import stat
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import mkdtemp

NAME = "weberlink"
_KINDS = {
    stat.S_IFREG: "a file",
    stat.S_IFDIR: "a directory",
    stat.S_IFLNK: "a symbolic link",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
}
IN_MEMORY = ("tmpfs", "ramfs")


class RuntimeDirectoryError(OSError):
    """No directory in memory belongs to this user alone; the message says what to do."""


class ForeignFileError(OSError):
    """A file is of another kind, of another user, or larger than it may be."""


@dataclass(frozen=True)
class Places:
    """Where a runtime directory may be."""

    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)
    users: Path = Path("/run/user")  # directory with one directory for each user who is logged in
    # Directory in memory in which everybody may create files, with the sticky bit set
    shared: Path = Path("/dev/shm")  # noqa: S108 - what is there is checked
    mounts: Path = Path("/proc/self/mountinfo")  # the kernel's table of mounts

    def directory(self) -> Path:
        """The directory of this user, for new files; made if there is none. Raises RuntimeDirectoryError if there is
        none, and none can be made.
        """
        parent = self.memory()
        path = self._plain if parent == self.shared else parent / NAME
        try:
            with suppress(FileExistsError):
                path.mkdir(0o700)
            if parent == self.shared and path.lstat().st_uid != os.geteuid():
                return next(self._suffixed(), None) or Path(mkdtemp(prefix=f"{path.name}.", dir=self.shared))
        except OSError as error:
            raise RuntimeDirectoryError(
                f"no directory in memory for telemetry: none can be made in {parent} ({error.strerror}); mount a tmpfs"
                f" at {self.shared}, or set XDG_RUNTIME_DIR to a directory of yours on a tmpfs"
            ) from None
        if (trouble := _trouble(path)) is not None:
            raise RuntimeDirectoryError(trouble)
        return path

    def memory(self) -> Path:
        """The parent directory in memory in which the directory of this user is or would be created."""
        return next((base for base in self._bases() if self._is_private_memory(base)), self.shared)

    def directories(self) -> list[Path]:
        """All existing directories of this user: sessions started in other ways may use another one."""
        candidates = [*(base / NAME for base in self._bases()), self._plain, *self._suffixed()]
        return [path for path in candidates if _trouble(path) is None]

    @property
    def _plain(self) -> Path:
        return self.shared / f"{NAME}-{os.geteuid()}"

    def _bases(self) -> list[Path]:
        """The directories of a login, the one that the environment names first."""
        named = Path(self.environment.get("XDG_RUNTIME_DIR", ""))
        usual = self.users / str(os.geteuid())
        return [named, usual] if named.is_absolute() and named != usual else [usual]

    def _suffixed(self) -> Iterator[Path]:
        with suppress(OSError):
            for path in sorted(self.shared.iterdir()):
                if path.name.startswith(f"{self._plain.name}.") and _trouble(path) is None:
                    yield path

    def _is_private_memory(self, base: Path) -> bool:
        """Whether only this user can make files there, and no disk backs it: writing a page would delay a tick."""
        try:
            status = base.lstat()
            mounts = [line.split() for line in self.mounts.read_text(encoding="utf-8", errors="replace").splitlines()]
        except OSError:
            return False
        number = f"{os.major(status.st_dev)}:{os.minor(status.st_dev)}"
        is_private = stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid() and not status.st_mode & 0o022
        return is_private and any(mount[2] == number and mount[mount.index("-") + 1] in IN_MEMORY for mount in mounts)


def directory() -> Path:
    """As of `Places.directory`, on this host."""
    return Places().directory()


def directories() -> list[Path]:
    """As of `Places.directories`, on this host."""
    return Places().directories()


def open_file(path: Path, longest: int) -> int:
    """Open a file for reading; never waits, follows no symbolic link. Raises ForeignFileError if it is no regular file
    of this user or of root, or longer [bytes]; another OSError if it is not there, or cannot be opened."""
    if path.is_symlink():  # for the message alone: O_NOFOLLOW refuses a link in any case
        raise ForeignFileError(f"{path} is a symbolic link, not a file")
    fd = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        status = os.fstat(fd)
        check(path, status, stat.S_IFREG, longest)
    except BaseException:
        os.close(fd)
        raise
    return fd


def check(path: Path, status: os.stat_result, kind: int, longest: int = sys.maxsize) -> None:
    """Check that a file is of a kind, as of `stat.S_IFMT`, not larger, and belongs to this user or to root; raises
    ForeignFileError if it is not, or does not.
    """
    if stat.S_IFMT(status.st_mode) != kind:
        raise ForeignFileError(f"{path} is {_kind(status.st_mode)}, not {_kind(kind)}")
    if status.st_uid not in (0, os.geteuid()):
        raise ForeignFileError(f"{path} belongs to {user_name(status.st_uid)}, not to {user_name(os.geteuid())}")
    if status.st_size > longest:
        raise ForeignFileError(f"{path} has {status.st_size} bytes, more than {longest}")


def user_name(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"user {number}"


def _trouble(path: Path) -> str | None:
    """Why a directory is not one of this user alone, and what to do; None if it is."""
    try:
        status = path.lstat()
    except OSError as error:
        return f"{path} cannot be used: {error.strerror}"
    if not stat.S_ISDIR(status.st_mode):
        return f"{path} is {_kind(status.st_mode)}, not a directory; remove it"
    if status.st_uid != os.geteuid():
        return f"{path} belongs to {user_name(status.st_uid)}, not to {user_name(os.geteuid())}; have it removed"
    mode = stat.S_IMODE(status.st_mode)
    if mode != 0o700:
        return f"{path} is open to other users (mode {mode:04o}); run: chmod 700 {path}"
    return None


def _kind(mode: int) -> str:
    return _KINDS.get(stat.S_IFMT(mode), "a special file")


def listening_socket(path: Path) -> socket.socket:
    """A datagram socket with a file of mode 0600, in place of one that a killed process left; it does not block. Raises
    OSError if there is no room for the file.
    """
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    before = os.umask(0o177)
    try:
        listener.bind(str(path))
    except BaseException:
        listener.close()
        raise
    finally:
        os.umask(before)
    return listener
