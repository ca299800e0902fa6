"""Access of the checks to this machine: a file tree and a few system calls, all replaceable in tests."""

import ctypes
import os
import resource
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import CLOCK_MONOTONIC, clock_getres
from typing import Any

from weberlink.apps.doctor.trial import RightsRequest, RightsTrial, run_trial

LOOK_UP_LIMIT_S = 3.0
"""For a name service that does not answer."""
TOOL_LIMIT_S = 10.0
CLOCK_UNSYNCHRONISED = 5  # TIME_ERROR of <sys/timex.h>
TIMEX_BYTES = 1024  # more than struct timex has anywhere


class Unreadable(Exception):  # noqa: N818 - a result, not a fault of the program
    """A part of the machine cannot be read; the text says why."""


def _affinity() -> frozenset[int]:
    return frozenset(os.sched_getaffinity(0))


def _clock_is_synchronised() -> bool:
    """Ask the kernel without changing anything: no bit of `modes`, the first word, is set."""
    state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    if state < 0:
        raise Unreadable(os.strerror(ctypes.get_errno()))
    return bool(state != CLOCK_UNSYNCHRONISED)


def _resolution_ns() -> float:
    return 1e9 * clock_getres(CLOCK_MONOTONIC)


def _free_bytes(path: Path) -> tuple[int, int]:
    status = os.statvfs(path)
    return status.f_frsize * status.f_blocks, status.f_frsize * status.f_bavail


def _bind(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind((host, port))


def _resolve(host: str) -> list[str]:
    """Addresses of a name, in the order in which a session tries them.

    Raises:
        OSError: the name has no address.
        Unreadable: the name service does not answer in time.
    """
    answer: list[Any] = []

    def ask() -> None:
        try:
            answer.append(socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM))
        except OSError as error:
            answer.append(error)

    # A look-up cannot be cancelled; a daemon thread does not delay the end of the program.
    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(LOOK_UP_LIMIT_S)
    if not answer:
        raise Unreadable(f"the name service does not answer within {LOOK_UP_LIMIT_S:g} s")
    if isinstance(answer[0], OSError):
        raise answer[0]
    found = sorted(answer[0], key=lambda entry: entry[0] != socket.AF_INET)
    return list(dict.fromkeys(str(entry[4][0]) for entry in found))


def _route(address: str) -> str:
    """Own address on the route to another; sends nothing. Raises OSError if there is no route."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((address, 9))
        return str(probe.getsockname()[0])


def _run(*command: str) -> tuple[int, str]:
    """Exit status and output of a read-only tool. Raises Unreadable if it cannot be run or does not end."""
    try:
        done = subprocess.run(  # noqa: S603 - the names are those of the checks
            command, capture_output=True, text=True, timeout=TOOL_LIMIT_S, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Unreadable(f"{command[0]} cannot be run: {error}") from None
    return done.returncode, done.stdout


@dataclass(frozen=True)
class Machine:
    """The machine; the defaults read this one.

    Args:
        root: the folder that has `proc`, `sys`, `etc`, `boot`, `dev` and `run`.
        user: effective user id of this process.
        affinity: processors that it may run on.
        limit: soft limit of a resource by its number in `resource`; -1 for none.
        resolution_ns: of the kernel's timers.
        trial: what the kernel grants a daemon, tried in a child process.
        which: path of a program, None if there is none.
        run: run a read-only program: exit status, output.
        bind: bind a UDP port and release it; OSError if that fails.
        resolve: addresses of a name.
        route: own address on the route to another.
        space: total and free bytes of a file system.
        clock_is_synchronised: whether NTP or PTP sets the wall clock.
        variables: of the environment.
    """

    root: Path = Path("/")
    user: int = field(default_factory=os.geteuid)
    affinity: Callable[[], frozenset[int]] = _affinity
    limit: Callable[[int], int] = lambda which: resource.getrlimit(which)[0]
    resolution_ns: Callable[[], float] = _resolution_ns
    trial: Callable[[RightsRequest], RightsTrial] = run_trial
    which: Callable[[str], str | None] = shutil.which
    run: Callable[..., tuple[int, str]] = _run
    bind: Callable[[str, int], None] = _bind
    resolve: Callable[[str], Sequence[str]] = _resolve
    route: Callable[[str], str] = _route
    space: Callable[[Path], tuple[int, int]] = _free_bytes
    clock_is_synchronised: Callable[[], bool] = _clock_is_synchronised
    variables: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))

    def read(self, path: str) -> str:
        """The text of a file, stripped. Raises Unreadable."""
        try:
            return (self.root / path.lstrip("/")).read_text(encoding="utf-8", errors="replace").strip()
        except FileNotFoundError:
            raise Unreadable(f"{path}: this kernel has no such file") from None
        except PermissionError:
            raise Unreadable(f"{path} cannot be read without root") from None
        except OSError as error:
            raise Unreadable(f"{path} cannot be read: {error.strerror}") from None

    def number(self, path: str) -> int:
        """The number in a file. Raises Unreadable if it cannot be read or holds something else."""
        text = self.read(path)
        try:
            return int(text)
        except ValueError:
            raise Unreadable(f"{path} holds no number but {text[:40]!r}") from None

    def has(self, path: str) -> bool:
        try:
            return (self.root / path.lstrip("/")).exists()
        except OSError:
            return False

    def find(self, pattern: str) -> list[str]:
        """Paths that match, from the root, in natural order."""
        return sorted((f"/{path.relative_to(self.root)}" for path in self.root.glob(pattern.lstrip("/"))), key=_natural)

    @property
    def in_container(self) -> bool:
        return self.has("/.dockerenv") or self.has("/run/.containerenv")


def _natural(path: str) -> list[tuple[int, str]]:
    digits = "".join(letter if letter.isdigit() else " " for letter in path).split()
    return [(int(number), path) for number in digits] or [(0, path)]
