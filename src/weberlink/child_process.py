"""Child processes that run Python: how they start, what they say, and how they end.

They import nothing from the current folder, where anybody may put a `json.py`.
"""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from mmap import mmap
from pathlib import Path
from select import select
from signal import SIG_BLOCK, SIG_SETMASK, SIGKILL, Signals, pthread_sigmask
from subprocess import DEVNULL, Popen, TimeoutExpired
from typing import Any, Final, Self

READ_BYTES: Final = 1 << 16


def python(*arguments: str) -> list[str]:
    """A command that runs this interpreter with these arguments; PYTHONPATH counts as ever."""
    return [sys.executable, "-P", *arguments]


def isolated_python(*arguments: str) -> list[str]:
    """The same, with the standard library alone: neither the user's environment nor installed packages."""
    return [sys.executable, "-I", "-S", *arguments]


def process_columns(pid: int | str) -> list[str] | None:
    """What /proc/PID/stat says of a process, from its state on: parent second, start 20th; None if there is none."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return None
    return status.rpartition(")")[2].split()  # before it, the program's name in parentheses, which may hold anything


@dataclass(frozen=True)
class Order:
    """What a child is to do, for its command line; subclasses are dataclasses of JSON values and tuples of them. The
    child ends with the process `parent` (see `weberlink.realtime.process.die_with_parent`).
    """

    parent: int = field(default_factory=os.getpid, kw_only=True)

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Self:
        pairs = json.loads(text).items()
        values: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in pairs}
        return cls(**values)


@contextmanager
def shared_memory(name: str, size: int) -> Iterator[tuple[mmap, int]]:
    """Memory to share with a child: ours, and the descriptor for `pass_fds`, which is closed at the end of the block;
    raises OSError if there is none.
    """
    descriptor = os.memfd_create(name)
    try:
        os.ftruncate(descriptor, size)
        yield mmap(descriptor, size), descriptor
    finally:
        os.close(descriptor)


class Child:
    """A process in a session of its own: Ctrl-C on the terminal reaches the parent, which ends its children in order.

    Args:
        command: see `python`.
        stdin: `PIPE` for `write_line`.
        stdout: `PIPE` for `lines` and `end`; 2 for standard error, since that of a daemon is its report.
        blocked: signals that wait in the child until it unblocks them: an early one is an orderly end too.
        options: others of `subprocess.Popen`.

    Raises:
        OSError: it does not start.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        stdin: int = DEVNULL,
        stdout: int = DEVNULL,
        blocked: Iterable[Signals] = (),
        **options: Any,
    ) -> None:
        self._text = b""
        self._output: bytes | None = None
        before = pthread_sigmask(SIG_BLOCK, blocked)
        try:
            self._process: Popen[bytes] = Popen(  # noqa: S603 - our own
                command, bufsize=0, stdin=stdin, stdout=stdout, start_new_session=True, **options
            )
        except BaseException:
            pthread_sigmask(SIG_SETMASK, before)
            raise
        try:
            pthread_sigmask(SIG_SETMASK, before)
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    os.set_blocking(pipe.fileno(), False)
        except BaseException:  # Ctrl-C since: nobody has this object, so nobody else ends the process
            self._process.kill()
            self._process.communicate()
            raise

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    @property
    def status(self) -> int | None:
        """Its exit status, or minus the signal that ended it; None while it runs."""
        return self._process.poll()

    @property
    def how_it_ended(self) -> str:
        """For example "was killed by SIGKILL" or "ended with status 1"; for a process that has ended."""
        status = self._process.returncode
        if status >= 0:
            return f"ended with status {status}"
        names = {signal.value: signal.name for signal in Signals}
        return f"was killed by {names.get(-status, f'signal {-status}')}"

    def send_signal(self, number: Signals) -> None:
        """Without effect once it has ended."""
        self._process.send_signal(number)

    def kill(self) -> None:
        self._process.kill()

    def write_line(self, text: str) -> None:
        """Write to its standard input without waiting; without effect once it has ended or was told to."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError, ValueError):
            self._process.stdin.write(text.encode() + b"\n")

    def lines(self, limit_s: float = 0.0) -> list[bytes]:
        """The whole lines that it wrote since the last call; waits at most `limit_s` for something to come."""
        stdout = self._process.stdout
        if stdout is None or stdout.closed:
            return []
        if limit_s > 0.0:
            select((stdout,), (), (), limit_s)
        with suppress(BlockingIOError):
            while data := os.read(stdout.fileno(), READ_BYTES):
                self._text += data
        *lines, self._text = self._text.split(b"\n")
        return lines

    def end(self, limit_s: float, *signals: Signals) -> bytes:
        """Wait until it has ended: at most so long, as long again after each of these signals, then it is killed;
        returns what it wrote and `lines` has not returned. Closes its standard input. May be repeated.
        """
        if self._output is not None:
            return self._output
        for number in (None, *signals, SIGKILL):
            if number is not None:
                self._process.send_signal(number)
            with suppress(TimeoutExpired):
                said = self._process.communicate(timeout=None if number == SIGKILL else limit_s)[0]
                break
        self._output = self._text + (said or b"")
        return self._output
