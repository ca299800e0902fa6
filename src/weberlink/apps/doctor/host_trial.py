"""Measures in a child process what the host takes, with processors kept awake and not, in turns.

Run as a program, this file is that child and writes a JSON result to standard output.
"""

import json
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import monotonic

from weberlink.apps.doctor.trial import nearest_rank, run_child
from weberlink.realtime.host import Steal, WakeUp, wake_ups
from weberlink.realtime.process import LATENCY_REQUEST, prepare

MOST_PROCESSORS = 8
"""Threads that wake up at once take turns in the interpreter, some 10 us each."""
PAIRS = 4
STRETCH_S = 0.3
"""Of each stretch: some hundred wake-ups of each processor, and 2.4 s in total."""
LEAD_S = 0.01
"""From the start of the threads to the first deadline."""
AWAKE_US = 0
"""Latency that keeps processors out of all idle states."""


@dataclass(frozen=True, slots=True)
class HostRequest:
    """What to measure.

    Args:
        priority: of SCHED_FIFO; above that of daemons, which may run meanwhile.
        processors: numbers; the first 8 are measured.
        rate_hz: of wake-ups.
    """

    priority: int
    processors: Sequence[int]
    rate_hz: float


@dataclass(frozen=True, slots=True)
class HostTrial:
    """Result: of each stretch `p99_us` (lateness), `missed` (share of ticks), `steal` (share; None if not counted)."""

    asleep: list[dict[str, float | None]] = field(default_factory=list)
    """Processors may enter idle states."""
    awake: list[dict[str, float | None]] = field(default_factory=list)
    """The same number, each measured next to one of the others; none if that was not possible."""
    not_awake: str | None = None
    """Why not."""
    failure: str | None = None
    """Why there is no result."""


def run_host_trial(request: HostRequest) -> HostTrial:
    """Run the trial in a child process; a failure is in the result."""
    return run_child(__name__, request, HostTrial)


def main(text: str) -> None:
    """The child process."""
    sys.stdout.write(json.dumps(asdict(trial(HostRequest(**json.loads(text))))))


def trial(request: HostRequest) -> HostTrial:
    """Measure; changes the scheduling class of this process."""
    grant = prepare(request.priority, lock_memory=False, cpu=None).priority
    if not grant:
        return HostTrial(failure=f"SCHED_FIFO {request.priority} {grant.detail}")
    processors = tuple(request.processors)[:MOST_PROCESSORS]
    found: dict[bool, list[dict[str, float | None]]] = {False: [], True: []}
    not_awake = _cannot_keep_awake()
    for pair in range(PAIRS):
        for awake in (False, True) if pair % 2 else (True, False):
            if awake and not_awake is None:
                with kept_awake():
                    found[True].append(stretch(processors, 1.0 / request.rate_hz))
            elif not awake:
                found[False].append(stretch(processors, 1.0 / request.rate_hz))
    return HostTrial(found[False], found[True], not_awake)


def _cannot_keep_awake() -> str | None:
    """Why processors cannot be kept awake and not, in turns; None if they can."""
    try:
        with Path(LATENCY_REQUEST).open("r+b", buffering=0) as device:
            in_force = int.from_bytes(device.read(4), sys.byteorder)
    except OSError as error:
        return f"{LATENCY_REQUEST}: {error.strerror}"
    return "another program keeps them awake" if in_force == AWAKE_US else None


@contextmanager
def kept_awake() -> Iterator[None]:
    """Hold the request that a daemon makes with `realtime: {wakeful: true}`."""
    with Path(LATENCY_REQUEST).open("wb", buffering=0) as device:
        device.write(AWAKE_US.to_bytes(4, sys.byteorder))
        yield


def stretch(processors: Sequence[int], period: float, seconds: float = STRETCH_S) -> dict[str, float | None]:
    """One stretch of wake-ups on each processor at once."""
    first = monotonic() + LEAD_S
    seen: list[WakeUp] = []

    def watch(processor: int) -> None:
        os.sched_setaffinity(0, {processor})  # of this thread
        seen.extend(list(wake_ups(first, period, first + seconds)))

    before = Steal.read(processors)
    watchers = [threading.Thread(target=watch, args=(processor,)) for processor in processors]
    for watcher in watchers:
        watcher.start()
    for watcher in watchers:
        watcher.join()
    after = Steal.read(processors)
    missed = sum(int(wake_up.late / period) for wake_up in seen)
    return {
        "p99_us": 1e6 * nearest_rank([wake_up.late for wake_up in seen], 0.99),
        "missed": missed / (missed + len(seen)),
        "steal": None if before is None or after is None else after.share_since(before),
    }


if __name__ == "__main__":
    main(sys.argv[1])
