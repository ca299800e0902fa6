"""Start-up time of the program to its first engaged tick, by part, and to its help, beside a bare interpreter."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from signal import SIGTERM
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any, NamedTuple

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from benchmarks.live_side import resources
from weberlink.protocol.states import State
from weberlink.system.order import SIDES
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

ROUNDS, QUICK_ROUNDS = 3, 1
PATIENCE_S = 60.0
LOOK_S = 0.005
LOOPBACK, HELP, INTERPRETER = "loopback", "help", "interpreter"
LAUNCHER_PARTS = (INTERPRETER, "command", "configuration", "spawning")
DAEMON_PARTS = ("imports", "composition", "opening", "engaging")
"""Parts of the start of a loopback, one after the other; their sum is the whole.

`command`: imports of the command line. `configuration`: imports and validation. `spawning`: trial of the parts, and the
rest until both daemons exist. `imports`: of a daemon with its interpreter and its configuration, on an idle processor.
`composition`: the rest until both rings exist, with what the daemons that start at once cost each other. `opening`:
until the first tick of both. `engaging`: until both are engaged.
"""
PROBE = """
import json, sys
from pathlib import Path
from time import perf_counter
begun = perf_counter()
if sys.argv[1] == "launcher":
    import weberlink.cli
else:
    import weberlink.system.daemon, weberlink.system.composition.slave
imported = perf_counter()
from weberlink.system.configuration import load
load(Path(sys.argv[2]), sys.argv[3:])
print(json.dumps([imported - begun, perf_counter() - imported]))
"""


class Start(NamedTuple):
    """Times of the later side since the start of the program [s], and CPU time of all processes until then [s]."""

    spawned: float
    composed: float
    opened: float
    engaged: float
    cpu: float


@dataclass(frozen=True)
class StartUp:
    """Start-up times [s], by program.

    Args:
        seconds: of each program.
        parts: of the start of a loopback, by `LAUNCHER_PARTS` and `DAEMON_PARTS`.
        cpu: CPU time, user and system, of launcher and daemons until they are engaged.
    """

    seconds: Mapping[str, list[float]]
    parts: Mapping[str, list[float]] = field(default_factory=dict)
    cpu: list[float] = field(default_factory=list)

    def median_s(self, what: str) -> float:
        return median(self.seconds[what])

    def as_json(self) -> dict[str, Any]:
        limit = self.median_s(INTERPRETER)
        document: dict[str, Any] = {
            what: {
                "median_s": self.median_s(what),
                "min_s": min(values),
                "max_s": max(values),
                "rounds": len(values),
                "ratio_to_interpreter": self.median_s(what) / limit,
            }
            for what, values in self.seconds.items()
        }
        if self.parts:
            document[LOOPBACK]["parts_s"] = {part: median(values) for part, values in self.parts.items()}
            document[LOOPBACK]["cpu_s"] = median(self.cpu)
        return document


def lines(document: Mapping[str, Any]) -> list[str]:
    """Lines of the report, at most 80 characters each, of what `StartUp.as_json` gave."""
    said = [
        "start: "
        + ", ".join(
            f"{what} {start['median_s']:.2f} s ({start['ratio_to_interpreter']:.0f} x)"
            for what, start in document.items()
        )
    ]
    loopback = document[LOOPBACK]
    if "parts_s" in loopback:
        said += [
            f"{who}, ms: " + ", ".join(f"{part} {1e3 * loopback['parts_s'][part]:.0f}" for part in parts)
            for who, parts in (("launcher", LAUNCHER_PARTS), ("daemons", DAEMON_PARTS))
        ]
        said.append(f"CPU time of the three until then: {loopback['cpu_s']:.2f} s")
    return said


def measure(arrangement: Arrangement) -> StartUp:
    """Start all programs in turn, several times.

    What a process has compiled is kept for the next one, as on the host of a user, also where the environment forbids
    Python to write it; the first round, which compiles, does not count unless it is the only one.

    Raises:
        BenchError: if one of them fails.
    """
    rounds = QUICK_ROUNDS if arrangement.quick else 1 + ROUNDS
    with TemporaryDirectory(prefix="weberlink-bench-") as compiled:
        given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        programs = _Programs(arrangement, {**given, "PYTHONPYCACHEPREFIX": compiled})
        found = [programs.round() for _ in range(rounds)][-ROUNDS:]
    seconds = {what: [one.seconds[what] for one in found] for what in (INTERPRETER, HELP, LOOPBACK)}
    parts = {part: [one.parts[part] for one in found] for part in (*LAUNCHER_PARTS, *DAEMON_PARTS)}
    return StartUp(seconds, parts, [one.cpu for one in found])


class _Round(NamedTuple):
    """One start of each program: times [s] as of `StartUp`."""

    seconds: dict[str, float]
    parts: dict[str, float]
    cpu: float


class _Programs:
    """Starts programs with one environment."""

    def __init__(self, arrangement: Arrangement, environment: Mapping[str, str]) -> None:
        self._arrangement = arrangement
        self._environment = environment

    def round(self) -> _Round:
        program = [sys.executable, "-m", "weberlink"]
        file, overrides = str(self._arrangement.file), self._arrangement.overrides(MAIN_RATE_HZ)
        bare, shown = self._ended([sys.executable, "-c", "pass"]), self._ended([*program, "--help"])
        options = [word for override in overrides for word in ("--set", override)]
        whole = self._engaged([*program, "loopback", file, *options])
        command, configuration = self._probe("launcher", file, *overrides)
        imports = bare + sum(self._probe("daemon", file, *overrides))
        of_round = (
            bare, command, configuration, whole.spawned - bare - command - configuration,
            imports, whole.composed - whole.spawned - imports, whole.opened - whole.composed,
            whole.engaged - whole.opened,
        )  # fmt: skip
        parts = dict(zip((*LAUNCHER_PARTS, *DAEMON_PARTS), of_round, strict=True))
        return _Round({INTERPRETER: bare, HELP: shown, LOOPBACK: whole.engaged}, parts, whole.cpu)

    def _probe(self, who: str, *arguments: str) -> tuple[float, float]:
        """Time of the first imports and of the configuration of a process [s]."""
        imports, configuration = json.loads(self._output([sys.executable, "-c", PROBE, who, *arguments]))
        return imports, configuration

    def _ended(self, line: list[str]) -> float:
        began = monotonic()
        self._output(line)
        return monotonic() - began

    def _output(self, line: list[str]) -> str:
        ended = subprocess.run(line, capture_output=True, text=True, check=False, env=self._environment)  # noqa: S603
        if ended.returncode:
            raise BenchError(f"{' '.join(line[:4])}: ended with status {ended.returncode}: {ended.stderr.strip()}")
        return ended.stdout

    def _engaged(self, line: list[str]) -> Start:
        """Start the program, wait until both sides are engaged, and end it."""
        began = monotonic()
        program = subprocess.Popen(  # noqa: S603
            line,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=self._environment,
        )
        try:
            start = _follow(program)
            program.send_signal(SIGTERM)
            program.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            raise BenchError("weberlink loopback: did not end after SIGTERM") from None
        finally:
            program.kill()
            program.communicate()
        return Start(
            start.spawned - began, start.composed - began, start.opened - began, start.engaged - began, start.cpu
        )


class _SideStart:
    """The start of one side, by its ring."""

    def __init__(self, ring: Path) -> None:
        self._path = ring
        self._ring: RingReader | None = None
        self.opened: float | None = None
        self.engaged: float | None = None

    @property
    def composed(self) -> float:
        return 0.0 if self._ring is None else self._ring.started_monotonic_s

    def look(self) -> bool:
        """Whether the side is engaged."""
        if self._ring is None:
            with suppress(FileNotFoundError):
                self._ring = RingReader(self._path)
        elif self.engaged is None:
            records = self._ring.read()
            begun = records["at"] + records["lateness_us"] * 1e-6
            if len(begun) and self.opened is None:
                self.opened = float(begun[0])
            in_session = begun[records["state"] == State.ENGAGED.value]
            self.engaged = float(in_session[0]) if len(in_session) else None
        return self.engaged is not None

    def close(self) -> None:
        if self._ring is not None:
            self._ring.close()


def _follow(program: subprocess.Popen[str]) -> Start:
    """The times of a start on the monotonic clock."""
    sides = [_SideStart(default_path(f"{program.pid}-{side}")) for side in SIDES]
    spawned: float | None = None
    until = monotonic() + PATIENCE_S
    try:
        while monotonic() < until:
            if program.poll() is not None:
                assert program.stderr is not None
                raise BenchError(f"weberlink loopback: {program.stderr.read().strip() or 'ended before its session'}")
            if spawned is None and len(_children(program.pid)) == len(SIDES):
                spawned = monotonic()
            waiting = [side for side in sides if not side.look()]
            if spawned is not None and not waiting:
                return Start(
                    spawned,
                    max(side.composed for side in sides),
                    max(side.opened or 0.0 for side in sides),
                    max(side.engaged or 0.0 for side in sides),
                    sum(resources(pid).cpu_s for pid in (program.pid, *_children(program.pid))),
                )
            sleep(LOOK_S)
    finally:
        for side in sides:
            side.close()
    raise BenchError(f"weberlink loopback: no session in {PATIENCE_S:g} s")


def _children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]
    except OSError:
        return []
