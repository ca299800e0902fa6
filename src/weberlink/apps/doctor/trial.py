"""Tries in a child process what the kernel grants a daemon of this user, and measures its timer latency.

The child imports the same modules and makes the same calls as a daemon, then waits for a timer for half a second.
Run as a program, this file is that child and writes a JSON result to standard output.
"""

import json
import os
import select
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from math import ceil
from pathlib import Path
from time import monotonic_ns
from typing import Any, TypeVar

from weberlink.child_process import python
from weberlink.realtime import timerfd
from weberlink.realtime.process import prepare

T = TypeVar("T")

MEASURE_S = 0.5
LIMIT_S = 30.0
"""Time limit for a child that hangs."""
IMPORTS = (
    "asyncio",
    "uvloop",
    "weberlink.system.daemon",
    "weberlink.system.composition.master",
    "weberlink.system.composition.slave",
)
"""Modules that every daemon imports."""


@dataclass(frozen=True, slots=True)
class RightsRequest:
    """Rights to try, as a configuration asks for them."""

    priority: int
    lock_memory: bool
    wakeful: bool
    cpu: int | None
    """To pin the process to."""
    rate_hz: float
    encrypted: bool = False
    """Whether a daemon loads the encryption library."""


@dataclass(frozen=True, slots=True)
class RightsTrial:
    """Result of the trial."""

    grants: dict[str, dict[str, bool | str]] = field(default_factory=dict)
    """Name to `granted` and `detail`, as in the report of a session."""
    memory_bytes: int = 0
    """Address space of such a process, which a limit on locked memory must allow."""
    lateness_us: dict[str, float] = field(default_factory=dict)
    """From deadline to wake-up: `p50`, `p99`, `max`."""
    missed: int = 0
    """Deadlines without a wake-up."""
    failure: str | None = None
    """Why there is no result."""


def run_trial(request: RightsRequest) -> RightsTrial:
    """Run the trial in a child process; a failure is in the result."""
    return run_child(__name__, request, RightsTrial)


def run_child(module: str, request: Any, answer: Callable[..., T], limit_s: float = LIMIT_S) -> T:
    """Run a module as a program.

    Args:
        module: reads a request as JSON from its command line, and writes the fields of an answer as JSON.
        request: a dataclass.
        answer: what to make of these fields, or of `failure`: why there are none.
        limit_s: time limit for a child that hangs.
    """
    try:
        done = subprocess.run(  # noqa: S603
            python("-m", module, json.dumps(asdict(request))),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return answer(failure=f"a child process cannot be tried: {error}")
    try:
        return answer(**json.loads(done.stdout))
    except (ValueError, TypeError):
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        return answer(failure=f"the child process of the trial failed: {last}")


def main(text: str) -> None:
    """The child process."""
    request = RightsRequest(**json.loads(text))
    for name in (*IMPORTS, *(["weberlink.protocol.psk"] if request.encrypted else [])):
        __import__(name)
    grants = prepare(request.priority, request.lock_memory, request.cpu, wakeful=request.wakeful)
    lateness, missed = measure(request.rate_hz)
    answer = RightsTrial(
        grants=grants.as_dict(),
        memory_bytes=address_space_bytes(),
        lateness_us={"p50": nearest_rank(lateness, 0.5), "p99": nearest_rank(lateness, 0.99), "max": max(lateness)},
        missed=missed,
    )
    sys.stdout.write(json.dumps(asdict(answer)))


def measure(rate_hz: float, seconds: float = MEASURE_S) -> tuple[list[float], int]:
    """Lateness of wake-ups from a timer at this rate [us], and how many deadlines passed without one."""
    lateness: list[float] = []
    missed = 0
    period_ns = round(1e9 / rate_hz)
    start_ns = monotonic_ns() + period_ns
    count = max(2, int(seconds * rate_hz))
    index = -1
    fd = timerfd.create()
    try:
        timerfd.arm(fd, start_ns, period_ns)
        while index < count - 1:
            select.select([fd], [], [])
            now = monotonic_ns()
            passed = timerfd.expirations(fd)
            index += passed
            missed += max(0, passed - 1)
            lateness.append((now - start_ns - index * period_ns) * 1e-3)
    finally:
        os.close(fd)
    return lateness, missed


def nearest_rank(values: list[float], share: float) -> float:
    """The smallest value that this share of the values does not exceed."""
    return sorted(values)[max(0, ceil(share * len(values)) - 1)]


def address_space_bytes() -> int:
    """Address space of this process: with all present and future memory locked, this counts against the limit."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmSize:")), 0)


if __name__ == "__main__":
    main(sys.argv[1])
