"""A session under trial: daemons started by the commands of a user, and all that their rings say.

Who looks at a session for long takes the records in pieces (`take`), the others read all of them (`records`).
"""

import json
import os
import re
import shutil
import signal
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np
import yaml

from tests.program import ENGAGED, ROOT, Program, Records, Telemetry, free_port
from tests.wait import until
from trials.relay import Wire
from weberlink.config import MASTER, SIDES, SLAVE, Configuration, load
from weberlink.protocol.keys import generate
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.ring import default_path

T = TypeVar("T")

CONFIGS = ROOT / "configs"
LINK = "127.0.0.1"
SILENCE_MS = 250.0
"""A shared machine stalls for up to 110 ms now and then, which is not the fault that is being looked for."""
NOTHING: Records = np.empty(0, DTYPE)
END_S = 20.0  # until a command that shall end is killed
# What the ends may agree on adds to the limit of silence, and they keep it for a while after a slow link.
LONGEST_ROUND_TRIP_MS = 150.0
LOOK_S = 0.01
# A trial that is killed leaves no session behind.
ENDS_WITH_TRIAL = ("setpriv", "--pdeathsig", "TERM") if shutil.which("setpriv") else ()


def within(seconds: float, condition: Callable[[], T]) -> T | None:
    """The first value of the condition that counts as true; None if there is none in this time."""
    deadline = monotonic() + seconds
    while not (value := condition()):
        if monotonic() > deadline:
            return None
        sleep(LOOK_S)
    return value


class Ring(Telemetry):
    def take(self) -> Records:
        """What is new since the last call, and is not kept."""
        self._read()
        with self._one_at_a_time:
            taken, self._count = self._buffer[: self._count].copy(), 0
        return taken

    @property
    def overrun(self) -> int:
        return self._reader.overrun


class Command(Program):
    """`weberlink ARGUMENTS`, and what it says; dead at the end of the `with`."""

    def __init__(self, *arguments: object, prefix: tuple[str, ...] = (), given: str | None = None) -> None:
        self._folder = TemporaryDirectory(prefix="weberlink-command-")
        self._out = Path(self._folder.name, "said")
        with self._out.open("w+b") as out:
            super().__init__(*arguments, prefix=(*ENDS_WITH_TRIAL, *prefix), terminal=out.fileno(), given=given)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        super().__exit__(kind, error, at)
        self._folder.cleanup()

    @property
    def said(self) -> str:
        return self._out.read_text(errors="replace")

    @property
    def last_line(self) -> str:
        return (self.said.strip().splitlines() or [""])[-1].strip()

    def until_said(self, pattern: str) -> str:
        """Wait for words of it; returns what the pattern's last group matched, or all of it."""
        until(lambda: re.search(pattern, self.said) or self.status is not None, pattern)
        if (found := re.search(pattern, self.said)) is None:
            raise RuntimeError(f"it has ended: {self.last_line}")
        return found[found.re.groups]

    @property
    def status(self) -> int | None:
        return self._process.poll()

    def ends(self, seconds: float) -> bool:
        return within(seconds, lambda: self.status is not None) is not None


class Side(Command):
    """`weberlink SIDE FILE ARGUMENTS`: one daemon and its launcher, begun at `began` [s].

    `last` is the newest record that was taken; None before the first.
    """

    def __init__(
        self, side: str, file: Path | str, *arguments: object, prefix: tuple[str, ...] = (), given: str | None = None
    ) -> None:
        self.side, self.began, self.last = side, monotonic(), None
        self._ring: Ring | None = None
        self._reports = TemporaryDirectory(prefix="weberlink-report-")
        self._report = Path(self._reports.name, "report.json")
        super().__init__(side, file, "--json", self._report, *arguments, prefix=prefix, given=given)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        super().__exit__(kind, error, at)
        if self._ring is not None:
            self._ring.close()
        self._reports.cleanup()

    @property
    def report(self) -> dict[str, Any]:
        """Its report, once it has ended; empty if it gave none."""
        with suppress(FileNotFoundError, json.JSONDecodeError):
            report: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
            return report
        return {}

    @property
    def outcome(self) -> str:
        return str(self.report.get("outcome", self.last_line))

    @property
    def ring(self) -> Ring | None:
        """None until its daemon has made it."""
        if self._ring is None and (path := default_path(f"{self.pid}-{self.side}")).exists():
            self._ring = Ring(path)
        return self._ring

    @property
    def records(self) -> Records:
        return NOTHING if self.ring is None else self.ring.records

    def take(self) -> Records:
        """What its daemon has recorded since the last call."""
        taken = NOTHING if self.ring is None else self.ring.take()
        if len(taken):
            self.last = taken[-1]
        return taken

    @property
    def is_engaged(self) -> bool:
        return self.ring is not None and bool(self.ring.last["state"] == ENGAGED)

    @property
    def daemon(self) -> int:
        """Process id of its daemon; 0 until it has a ring."""
        return 0 if self.ring is None else self.ring.pid

    def signal(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.kill(self.daemon or self.pid, number)

    def first_engaged(self, seconds: float) -> float | None:
        """The first tick in a session [s]; None if there is none in this time, or the command ends."""

        def engaged() -> Records:
            records = self.records
            return records["at"][records["state"] == ENGAGED]

        within(seconds, lambda: len(engaged()) or self.status is not None)
        return float(engaged()[0]) if len(engaged()) else None

    def end(self) -> dict[str, Any]:
        """Stop it in order, if it still runs; its report."""
        if self.status is None:
            self.signal(signal.SIGCONT)
            self.send(signal.SIGTERM)
            if not self.ends(END_S):
                self._process.kill()
        self._process.wait()
        return self.report


class Loopback(Program):
    """`weberlink loopback ARGUMENTS`, engaged; interrupted at the end of the `with`, which brings its `summary`."""

    def __init__(self, *arguments: object) -> None:
        any_port = ("--set", f"link.listen={LINK}:0", "--set", f"link.slave={LINK}:0")
        super().__init__("loopback", *arguments, "--json", "-", *any_port, prefix=ENDS_WITH_TRIAL)
        self.summary: dict[str, Any] = {}

    def __enter__(self) -> Self:
        try:
            self.name = str(self.pid)
            self.sides = {side: Ring(default_path(f"{self.pid}-{side}")) for side in SIDES}
            for side, ring in self.sides.items():
                until(lambda ring=ring: ring.last["state"] == ENGAGED, f"the {side} to engage")  # type: ignore[misc]
        except BaseException:
            super().__exit__(None, None, None)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self.send(signal.SIGINT)
            self.summary = json.loads(self.finish()[1])
        super().__exit__(kind, error, at)
        for ring in self.sides.values():
            ring.close()


class Session:
    """Both sides of a file, whose link is replaced: with a relay of this seed, and a key of their own.

    `wire` is the relay, and `sides` those that are running, by name.
    """

    def __init__(
        self,
        file: Path = CONFIGS / "loopback.yaml",
        *,
        seed: int = 1,
        silence_ms: float = SILENCE_MS,
        overrides: tuple[str, ...] = (),
    ) -> None:
        self._origin, self._seed, self._silence_ms, self._overrides = file, seed, silence_ms, overrides
        self.sides: dict[str, Side] = {}
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with self._stack:
            self.folder = Path(self._stack.enter_context(TemporaryDirectory(prefix="weberlink-trial-")))
            self.slave_address = (LINK, free_port())
            self.wire = self._stack.enter_context(Wire(self.slave_address, self._seed))
            self.file, self.key = self.folder / self._origin.name, self.folder / "trial.key"
            generate(self.key)
            described = yaml.safe_load(self._origin.read_text(encoding="utf-8"))
            described["link"] = {
                "listen": "{}:{}".format(*self.slave_address),
                "slave": "{}:{}".format(*self.wire.front),
                "security": "psk",
                "key_file": str(self.key),
                "silence_ms": self._silence_ms,
                "longest_round_trip_ms": LONGEST_ROUND_TRIP_MS,
            }
            self.file.write_text(yaml.safe_dump(described, sort_keys=False), encoding="utf-8")
            self.configuration: Configuration = load(self.file, self._overrides)
            self._stack.callback(self._end)
            for side in (SLAVE, MASTER):
                self.start(side)
            self._stack = self._stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def _end(self) -> None:
        for side in self.sides.values():
            side.__exit__(None, None, None)

    @property
    def silence(self) -> float:
        return self.configuration.system.link.silence_ms * 1e-3

    @property
    def limit(self) -> float:
        """After which of the last datagram a session is over at both ends, at most [s]."""
        return self.silence + self.configuration.system.link.longest_round_trip_ms * 1e-3

    def start(self, side: str, *settings: str) -> Side:
        if side in self.sides:
            self.sides.pop(side).__exit__(None, None, None)
        words = [word for each in (*self._overrides, *settings) for word in ("--set", each)]
        started = self.sides[side] = Side(side, self.file, *words)
        return started

    def kill(self, side: str) -> Side:
        """kill -9 of its daemon; its launcher has ended then."""
        killed = self.sides.pop(side)
        killed.signal(signal.SIGKILL)
        killed.end()
        return killed

    def stop(self) -> dict[str, dict[str, Any]]:
        """End both in order, the master first; their reports."""
        return {name: self.sides[name].end() for name in SIDES if name in self.sides}
