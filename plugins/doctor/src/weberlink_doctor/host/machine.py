"""Access of the checks to this machine; tests replace its root folder and its methods."""

import ctypes
import os
import platform
import re
import resource
import shutil
import socket
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Mapping, Sequence
from errno import EACCES, ENOENT
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import CLOCK_MONOTONIC, clock_getres
from typing import Any

from weberlink.cli.devices import DriverStatus, survey
from weberlink.compiled import is_compiled
from weberlink_doctor.host import trial
from weberlink_doctor.host.trial import HostTrial, RightsTrial, run_child

LOOK_UP_LIMIT_S = 3.0  # how long a name service may take to answer
TOOL_LIMIT_S = 10.0
CLOCK_UNSYNCHRONISED = 5  # TIME_ERROR of <sys/timex.h>
TIMEX_BYTES = 1024  # more than struct timex has anywhere


class Unreadable(Exception):  # noqa: N818 - a result, not a fault of the program
    """A part of the machine cannot be read; the text says why."""


class Machine:
    """The machine; `root` is the folder that has `proc`, `sys`, `etc`, `boot`, `dev` and `run`."""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root
        self.variables: Mapping[str, str] = os.environ
        self.user = os.geteuid()

    def read(self, path: str, default: str | None = None) -> str:
        """The text of a file, stripped. Raises Unreadable where it cannot be read, unless there is a default."""
        try:
            return (self.root / path.lstrip("/")).read_text(encoding="utf-8", errors="replace").strip()
        except OSError as error:
            if default is not None:
                return default
            reasons = {ENOENT: f"{path}: this kernel has no such file", EACCES: f"{path} cannot be read without root"}
            raise Unreadable(reasons.get(error.errno or 0, f"{path} cannot be read: {error.strerror}")) from None

    def number(self, path: str) -> int:
        """The number in a file. Raises Unreadable if it cannot be read or holds something else."""
        text = self.read(path)
        try:
            return int(text)
        except ValueError:
            raise Unreadable(f"{path} holds no number but {text[:40]!r}") from None

    def may_have(self, path: str) -> bool:
        """Whether a file exists; also where only root can tell."""
        try:
            (self.root / path.lstrip("/")).stat()
        except OSError as error:
            return error.errno == EACCES
        return True

    def find(self, pattern: str) -> list[str]:
        """Paths that match, from the root, in natural order."""
        paths = [f"/{path.relative_to(self.root)}" for path in self.root.glob(pattern.lstrip("/"))]
        return sorted(paths, key=lambda path: [int(number) for number in re.findall(r"\d+", path)])

    @property
    def in_container(self) -> bool:
        return self.may_have("/.dockerenv") or self.may_have("/run/.containerenv")

    def command_that_holds(self, sockets: set[str]) -> str:
        """The command line of the process that has one of these sockets; empty if this user may not see it."""
        for link in (self.root / "proc").glob("[0-9]*/fd/*"):
            try:
                if str(link.readlink()) in sockets:
                    command = (link.parents[1] / "cmdline").read_bytes()
                    return command.decode(errors="replace").replace("\0", " ").strip()
            except OSError:
                continue
        return ""

    # System calls, programs and libraries of this machine, for tests to replace.
    which = staticmethod(shutil.which)
    is_compiled = staticmethod(is_compiled)
    rights_trial = staticmethod(partial(run_child, trial.__name__, RightsTrial, "rights"))
    host_trial = staticmethod(partial(run_child, trial.__name__, HostTrial, "host"))
    session_trial = staticmethod(trial.session_trial)

    def affinity(self) -> frozenset[int]:
        """Processors that this process may run on."""
        return frozenset(os.sched_getaffinity(0))

    def limit(self, number: int) -> int:
        """Soft limit of a resource by its number in `resource`; -1 for none."""
        return resource.getrlimit(number)[0]

    def resolution_ns(self) -> float:
        """Resolution of the kernel's timers."""
        return 1e9 * clock_getres(CLOCK_MONOTONIC)

    def drivers(self) -> Sequence[DriverStatus]:
        return survey().drivers

    def python(self) -> dict[str, Any]:
        """Version and kind of the build of Python."""
        return {
            "number": platform.python_version(),
            "is_debug": bool(sysconfig.get_config_var("Py_DEBUG")),
            "is_free_threaded": bool(sysconfig.get_config_var("Py_GIL_DISABLED")),
            "is_dev_mode": sys.flags.dev_mode,
        }

    def version(self, package: str) -> str | None:
        """Version of an installed package; None if it is not installed."""
        try:
            return version(package)
        except PackageNotFoundError:
            return None

    def space(self, path: Path) -> tuple[int, int]:
        """Total and free bytes of a file system."""
        status = os.statvfs(path)
        return status.f_frsize * status.f_blocks, status.f_frsize * status.f_bavail

    def clock_is_synchronised(self) -> bool:
        """Ask the kernel without changing anything: no bit of `modes`, the first word, is set."""
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
        if state < 0:
            raise Unreadable(os.strerror(ctypes.get_errno()))
        return bool(state != CLOCK_UNSYNCHRONISED)

    def run(self, *command: str) -> tuple[int, str]:
        """Exit status and output of a read-only tool. Raises Unreadable if it cannot be run or does not end."""
        try:
            done = subprocess.run(  # noqa: S603 - the names are those of the checks
                command, capture_output=True, text=True, timeout=TOOL_LIMIT_S, check=False, stdin=subprocess.DEVNULL
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise Unreadable(f"{command[0]} cannot be run: {error}") from None
        return done.returncode, done.stdout

    def bind(self, host: str, port: int) -> None:
        """Bind a UDP port and release it. Raises OSError if that fails."""
        with _udp(host) as probe:
            probe.bind((host, port))

    def route(self, address: str) -> str:
        """Own address on the route to another; sends nothing. Raises OSError if there is no route."""
        with _udp(address) as probe:
            probe.connect((address, 9))
            return str(probe.getsockname()[0])

    def resolve(self, host: str) -> Sequence[str]:
        """Addresses of a name, IPv4 first. Raises OSError if there is none, Unreadable if nothing answers in time."""
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


def _udp(address: str) -> socket.socket:
    return socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM)
