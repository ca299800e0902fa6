"""Trials in child processes: what the kernel grants a daemon of this user, what the host of a machine takes, and how
punctual a session is at a rate.

The first child imports the same modules and makes the same calls as a daemon, then wakes up at its rate for half a
second. The second wakes up on each processor, with processors kept awake and not, in turns. Run as a program, this file
is one of these two: the name of a trial and its arguments as JSON on the command line, a JSON result on standard
output. The third child runs a session of two simulated ends.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from math import ceil
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

from weberlink.child_process import python
from weberlink.realtime.process import LATENCY_REQUEST, prepare
from weberlink_figures.host import Steal, WakeUp, wake_ups

T = TypeVar("T")
Stretch = dict[str, float | None]
"""One stretch of wake-ups: `p99_us` (lateness), `missed` (share of ticks), `steal` (share; None if not counted)."""

MEASURE_S = 0.5
LIMIT_S = 30.0  # time limit for a child that hangs
IMPORTS = (
    "asyncio",
    "uvloop",
    "weberlink.session.daemon",
    "weberlink.session.composition.sides",
    "weberlink.session.composition.master",
    "weberlink.session.composition.slave",
)
"""Modules that every daemon imports."""
MOST_PROCESSORS = 8  # threads that wake up at once take turns in the interpreter, some 10 us each
PAIRS = 4
STRETCH_S = 0.3  # of each stretch: some hundred wake-ups of each processor, and 2.4 s in total
LEAD_S = 0.01  # from the start of the threads to the first deadline
SESSION_S = 1.0
AWAKE_US = 0  # latency that keeps processors out of all idle states


@dataclass(frozen=True, slots=True)
class RightsTrial:
    """Result of the trial of rights."""

    grants: dict[str, dict[str, bool | str]] = field(default_factory=dict)  # as in the report of a session
    memory_bytes: int = 0  # address space of such a process: with all memory locked, this counts against the limit
    lateness_us: dict[str, float] = field(default_factory=dict)  # from deadline to wake-up: `p50`, `p99`, `max`
    missed: int = 0  # deadlines without a wake-up
    failure: str | None = None  # why there is no result


@dataclass(frozen=True, slots=True)
class HostTrial:
    """Result of the trial of the host."""

    asleep: list[Stretch] = field(default_factory=list)  # processors may enter idle states
    awake: list[Stretch] = field(default_factory=list)  # as many, each measured next to one of the others; or none
    not_awake: str | None = None  # why none
    failure: str | None = None  # why there is no result


@dataclass(frozen=True, slots=True)
class SessionTrial:
    """Result of a session with both ends on this machine, of the end that was less punctual."""

    p99_us: float = 0.0  # lateness
    missed: float = 0.0  # share of ticks
    failure: str | None = None  # why there is no result


def run_child(module: str, answer: Callable[..., T], name: str, limit_s: float = LIMIT_S, **request: Any) -> T:
    """Run a module as a program with a name and a request in JSON; makes an answer of the fields that it writes as
    JSON, or of `failure`, why there are none."""
    said, why = run(python("-m", module, name, json.dumps(request)), limit_s)
    try:
        return answer(**json.loads(said))
    except (ValueError, TypeError):
        return answer(failure=f"the child process of the trial failed: {why}")


def run(command: Sequence[str], limit_s: float) -> tuple[str, str]:
    """What a command writes, and why it ended, if it ended badly."""
    try:
        done = subprocess.run(  # noqa: S603
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=limit_s, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return "", f"it cannot be tried: {error}"
    return done.stdout, (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]


def rights_trial(
    priority: int, *, lock_memory: bool, wakeful: bool, cpu: int | None, rate_hz: float, encrypted: bool = False
) -> RightsTrial:
    """Take the rights that a configuration asks for, and measure wake-ups."""
    for name in (*IMPORTS, *(["weberlink.protocol.psk"] if encrypted else [])):
        __import__(name)
    grants = asdict(prepare(priority, lock_memory, cpu, wakeful=wakeful))
    period = 1.0 / rate_hz
    first = monotonic() + period
    seen = list(wake_ups(first, period, first + max(MEASURE_S, 2.0 * period)))
    lateness = [1e6 * wake_up.late for wake_up in seen]
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    memory = next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmSize:")), 0)
    late = {"p50": nearest_rank(lateness, 0.5), "p99": nearest_rank(lateness, 0.99), "max": max(lateness)}
    return RightsTrial(grants, memory, late, missed_by(seen, period))


def missed_by(seen: Sequence[WakeUp], period: float) -> int:
    """Deadlines without a wake-up of their own."""
    return sum(int(wake_up.late / period) for wake_up in seen)


def nearest_rank(values: Sequence[float], share: float) -> float:
    """The smallest value that this share of the values does not exceed."""
    return sorted(values)[max(0, ceil(share * len(values)) - 1)]


def host_trial(priority: int, processors: Sequence[int], rate_hz: float) -> HostTrial:
    """Measure what the host takes; changes the scheduling class of this process."""
    grant = prepare(priority, lock_memory=False, cpu=None).priority
    if not grant:
        return HostTrial(failure=f"SCHED_FIFO {priority} {grant.detail}")
    chosen, period, not_awake = processors[:MOST_PROCESSORS], 1.0 / rate_hz, None
    try:
        with Path(LATENCY_REQUEST).open("r+b", buffering=0) as device:
            if int.from_bytes(device.read(4), sys.byteorder) == AWAKE_US:
                not_awake = "another program keeps them awake"
    except OSError as error:
        not_awake = f"{LATENCY_REQUEST}: {error.strerror}"
    found = HostTrial(not_awake=not_awake)
    for pair in range(PAIRS):
        for awake in (False, True) if pair % 2 else (True, False):
            if not awake:
                found.asleep.append(stretch(chosen, period))
            elif not_awake is None:
                with Path(LATENCY_REQUEST).open("wb", buffering=0) as device:  # as a daemon with `wakeful` does
                    device.write(AWAKE_US.to_bytes(4, sys.byteorder))
                    found.awake.append(stretch(chosen, period))
    return found


def stretch(processors: Sequence[int], period: float) -> Stretch:
    """One stretch of wake-ups on each processor at once."""
    first = monotonic() + LEAD_S

    def watch(processor: int) -> list[WakeUp]:
        os.sched_setaffinity(0, {processor})  # of this thread
        return list(wake_ups(first, period, first + STRETCH_S))

    before = Steal.read(processors)
    with ThreadPoolExecutor(len(processors)) as threads:
        seen = [wake_up for each in threads.map(watch, processors) for wake_up in each]
    after = Steal.read(processors)
    missed = missed_by(seen, period)
    return {
        "p99_us": 1e6 * nearest_rank([wake_up.late for wake_up in seen], 0.99),
        "missed": missed / (missed + len(seen)),
        "steal": None if before is None or after is None else after.share_since(before),
    }


def session_trial(settings: Mapping[str, object]) -> SessionTrial:
    """Run the default session with these settings of its file."""
    line = python("-m", "weberlink", "loopback", "--duration", f"{SESSION_S:g}", "--json", "-")
    line += [word for name, value in settings.items() for word in ("--set", f"{name}={json.dumps(value)}")]
    said, why = run(line, LIMIT_S)
    if not said:
        return SessionTrial(failure=why)
    sides = json.loads(said)["ticks"].values()
    missed = max(side["missed"] / (side["missed"] + side["count"]) for side in sides)
    return SessionTrial(max(side["lateness_us"]["p99"] for side in sides), missed)


if __name__ == "__main__":
    trials: dict[str, Callable[..., Any]] = {"rights": rights_trial, "host": host_trial}
    sys.stdout.write(json.dumps(asdict(trials[sys.argv[1]](**json.loads(sys.argv[2])))))
