"""The program as a process, and what its daemons record, for the tests that run it as its user does."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from typer import Context
from typer.main import get_command
from typer.testing import CliRunner

from tests.wait import PATIENCE, until
from weberlink.cli import app
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE, RingReader
from weberlink.telemetry.ring import default_path

Records = NDArray[Any]

ROOT = Path(__file__).parents[1]


def commands(group: Any, above: str = "") -> dict[str, Any]:
    """The commands of a group and of the groups in it, by their words; they are made when they are asked for."""
    context, found = Context(group), dict[str, Any]()
    for name in group.list_commands(context):
        found[f"{above}{name}"] = command = group.get_command(context, name)
        found |= commands(command, f"{above}{name} ") if hasattr(command, "list_commands") else {}
    return found


COMMANDS = commands(get_command(app))  # of the program and of the distributions that are installed
PATIENT = ("--set", "link.silence_ms=2000")
"""For live sessions of tests that are not about silence: a short stall of the host then causes no fault."""
ENGAGED = State.ENGAGED.value
DAEMON = b"weberlink.session.daemon"


def document(text: str) -> dict[str, Any]:
    """JSON as the standard has it: no NaN, nothing before and nothing behind."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"JSON has no {constant}")

    parsed = json.loads(text, parse_constant=refuse)
    assert isinstance(parsed, dict)
    return parsed


def faults_of(summary: dict[str, Any]) -> dict[str, dict[str, int]]:
    """Faults that a live session reports at each end, without stalls: those of 20 ms and more are the host's."""
    return {
        side: {fault: count for fault, count in counts.items() if fault != "stalled"}
        for side, counts in summary["faults"].items()
    }


def free_port() -> int:
    """A UDP port of the loopback interface that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    output: str
    errors: str

    def complaint(self, status: int = 2) -> str:
        """The one line on standard error of a command that failed and printed nothing else."""
        assert (self.status, self.output) == (status, ""), self
        (line,) = self.errors.splitlines()
        return line


def weberlink(*arguments: object) -> Ended:
    """Run a command in this process: 0.1 s instead of the 1 s of a process."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    errors = re.sub(r"(?m)^weberlink: \d+/\d+ s, after \d+ s\n", "", result.stderr)  # a slow machine says how far it is
    return Ended(result.exit_code, result.stdout, errors)


class Telemetry:
    """Everything a daemon records, also once it has ended; a thread reads the ring before it is full (10 s)."""

    def __init__(self, path: Path) -> None:
        until(path.exists, f"{path}")
        self._reader = RingReader(path)
        self._buffer: Records = np.empty(1000, DTYPE)  # twice as long whenever it is full
        self._count = 0
        self._closed = Event()
        self._one_at_a_time = Lock()
        Thread(target=self._keep_reading, daemon=True).start()

    def _keep_reading(self) -> None:
        while not self._closed.wait(1.0) and self._read():
            pass

    def _read(self) -> bool:
        """Take the new records; returns whether there can be more."""
        with self._one_at_a_time:
            if self._closed.is_set():
                return False
            alive = self._reader.alive
            new, count = self._reader.read(), self._count
            end = count + len(new)
            if end > len(self._buffer):
                longer = np.empty(2 * end, DTYPE)
                longer[:count] = self._buffer[:count]
                self._buffer = longer
            self._buffer[count:end] = new
            self._count = end  # last: another thread may look
            return alive

    @property
    def pid(self) -> int:
        """Of the daemon, not of the launcher."""
        return self._reader.pid

    @property
    def started(self) -> float:
        """When the daemon was about to open its socket, on the clock of the records [s]."""
        return self._reader.started_monotonic_s

    @property
    def records(self) -> Records:
        self._read()
        assert self._reader.overrun == 0
        return self._buffer[: self._count]

    @property
    def last(self) -> Any:
        """The newest record; before the first, one of zeros."""
        records = self.records
        return records[-1] if len(records) else np.zeros(1, DTYPE)[0]

    def close(self) -> None:
        """Take what there is, and let go of the ring."""
        self._read()
        with self._one_at_a_time:
            self._closed.set()
            self._reader.close()


def children(pid: int) -> dict[int, bytes]:
    """The child processes of a process that live, and their command lines."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            state, parent = path.read_text(errors="replace").rpartition(")")[2].split()[:2]
            if int(parent) == pid and state not in "ZX":
                found[int(path.parent.name)] = (path.parent / "cmdline").read_bytes()
    return found


def child(pid: int, word: str) -> int | None:
    """The child process of a process with a word in its command line; None if there is none."""
    return next((each for each, line in children(pid).items() if word.encode() in line), None)


class Program:
    """A command as a process of its own, which is dead at the end of the `with`, and its daemons with it.

    Args:
        arguments: of the command line.
        module: what `python -m` runs.
        prefix: a command that runs it.
        terminal: file descriptor for its three streams instead of pipes.
        given: what it reads on standard input; None for nothing.
    """

    def __init__(
        self,
        *arguments: object,
        module: str = "weberlink",
        prefix: tuple[str, ...] = (),
        terminal: int | None = None,
        given: str | None = None,
    ) -> None:
        streams = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE if terminal is None else terminal)
        if given is not None:
            streams["stdin"] = subprocess.PIPE
        elif terminal is None:
            streams["stdin"] = subprocess.DEVNULL
        unset = ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE")
        environment = {name: value for name, value in os.environ.items() if name not in unset}
        self._process: subprocess.Popen[str] = subprocess.Popen(
            [*prefix, sys.executable, "-m", module, *map(str, arguments)],
            cwd=ROOT,
            env={**environment, "TERM": "xterm"},
            text=True,
            **streams,  # type: ignore[call-overload]
        )
        if given is not None:
            assert self._process.stdin is not None
            self._process.stdin.write(given)
            self._process.stdin.flush()
        self._telemetry: list[Telemetry] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        children = self.children()
        self._process.kill()
        self._process.wait()
        for pid in children:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()
        for telemetry in self._telemetry:
            telemetry.close()
        for path in self.rings():
            path.unlink(missing_ok=True)

    @property
    def pid(self) -> int:
        """Of the launcher."""
        return self._process.pid

    def next_error(self) -> str:
        """The next line on standard error; empty at its end."""
        assert self._process.stderr is not None
        return self._process.stderr.readline()

    def children(self) -> dict[int, bytes]:
        """Its child processes that live, and their command lines."""
        return children(self.pid)

    def daemons(self) -> list[int]:
        return [pid for pid, command in self.children().items() if DAEMON in command]

    def rings(self) -> list[Path]:
        path = default_path(f"{self.pid}-side")
        return list(path.parent.glob(path.name.replace("side", "*") + "*"))

    def telemetry(self, side: str) -> Telemetry:
        telemetry = Telemetry(default_path(f"{self.pid}-{side}"))
        self._telemetry.append(telemetry)
        return telemetry

    def engaged(self, side: str) -> Telemetry:
        """The telemetry of a side that is in a session."""
        telemetry = self.telemetry(side)
        until(lambda: telemetry.last["state"] == ENGAGED, f"the {side} to engage")
        return telemetry

    def send(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def finish(self, lasts: float = 0.0) -> tuple[int, str, str]:
        """Wait for the end, which is due in `lasts` [s]: exit status, standard output, standard error."""
        output, errors = self._process.communicate(timeout=lasts + PATIENCE)
        return self._process.returncode, output, errors
