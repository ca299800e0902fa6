"""The system under test, its rights, and the processes of the benchmarks.

A process of this package is started with an order as JSON and prints its answer as JSON. This module is such a process
too: it asks the kernel for the rights of a real-time process and prints what was granted.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from signal import SIGHUP
from typing import Any

from weberlink.config import Configuration, load
from weberlink.config.model import RealtimeSettings
from weberlink.realtime.process import die_with_parent, prepare

RATES_HZ = (1000.0, 2000.0, 4000.0)
MAIN_RATE_HZ = 1000.0  # rate of the figures on CPU time, memory and latency
DURATION_S = 20.0
ROOT = str(Path(__file__).parents[1])  # the clone of the repository, from which a process imports this package
QUICK_DURATION_S = 1.0

Ports = Callable[[list[str]], list[str]]  # returns overrides that name a free port, for given overrides


class BenchError(RuntimeError):
    """A measurement failed; the text is one line."""


@dataclass(frozen=True)
class Arrangement:
    """The system under test and the duration of each part."""

    file: Path  # the configuration
    key_file: Path  # a key for this run
    given: tuple[str, ...]  # overrides of the user, applied last but for the rate
    ports: Ports  # finds a free port
    duration_s: float = DURATION_S  # of the live run at one rate [s]; other parts take a share of it
    quick: bool = False  # measure briefly

    def overrides(self, rate_hz: float) -> list[str]:
        """Overrides of the file, with a port that is free now."""
        overrides = [
            "link.security=psk",
            f"link.key_file={json.dumps(str(self.key_file))}",
            "codec.force.predictor=hybrid",
            *self.given,
            f"rate_hz={rate_hz:g}",
        ]
        return [*overrides, *self.ports(overrides)]

    def configuration(self, overrides: Sequence[str]) -> Configuration:
        """Raises ConfigurationError for a wrong file or override."""
        return load(self.file, overrides)


@dataclass(frozen=True)
class Rights:
    """Rights of the daemons and of their limits."""

    priority: int  # of SCHED_FIFO; 0 for the ordinary scheduler
    lock_memory: bool  # whether memory is locked
    wakeful: bool  # whether processors are kept out of deep sleep
    cpus: tuple[int, int] | None  # processor of each daemon; None for any

    def cpu(self, place: int) -> int | None:
        return None if self.cpus is None else self.cpus[place]

    def take(self, place: int) -> None:
        """Give this process the rights of the daemon with this place (0 or 1)."""
        prepare(self.priority, self.lock_memory, self.cpu(place), wakeful=self.wakeful)

    def as_json(self) -> dict[str, Any]:
        return {
            "scheduler": f"SCHED_FIFO {self.priority}" if self.priority else "SCHED_OTHER",
            "lock_memory": self.lock_memory,
            "wakeful": self.wakeful,
            "cpus": None if self.cpus is None else list(self.cpus),
        }


def granted(asked: RealtimeSettings) -> Rights:
    """Ask the kernel for rights, in a process of its own because they outlive the question."""
    with child("arrangement", {"asked": asked.model_dump()}) as process:
        answer = answers([process], 30.0, "the check of real-time rights")[0]
    return Rights(
        priority=asked.priority if answer["priority"] else 0,
        lock_memory=answer["memory"],
        wakeful=answer["wakeful"],
        cpus=asked.cpus if answer["cpus"] else None,
    )


def _grants(order: Mapping[str, Any]) -> dict[str, bool]:
    asked = RealtimeSettings.model_validate(order["asked"])
    pinned = asked.cpus is not None and set(asked.cpus) <= os.sched_getaffinity(0)
    grants = prepare(asked.priority, asked.lock_memory, None, wakeful=asked.wakeful)
    return {name: bool(getattr(grants, name)) for name in ("priority", "memory", "wakeful")} | {"cpus": pinned}


@contextmanager
def child(module: str, order: Mapping[str, Any], rights: Rights | None = None) -> Iterator[subprocess.Popen[str]]:
    """Start a module of this package as a process; it is killed at the end of the block."""
    full = dict(order) | {"parent": os.getpid(), "rights": None if rights is None else asdict(rights)}
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, "-m", f"benchmarks.{module}", json.dumps(full)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (ROOT, os.environ.get("PYTHONPATH"))))},
    )
    try:
        yield process
    finally:
        process.kill()
        if process.stdout is not None and not process.stdout.closed:
            process.communicate()


def answers(processes: Sequence[subprocess.Popen[str]], timeout_s: float, what: str) -> list[Any]:
    """The answers of processes that end by themselves."""
    try:
        texts = [process.communicate(timeout=timeout_s)[0] for process in processes]
    except subprocess.TimeoutExpired:
        raise BenchError(f"{what}: did not end in time") from None
    if any(process.returncode for process in processes):
        raise BenchError(f"{what}: a process failed")
    return [json.loads(text) for text in texts]


def serve(work: Callable[[dict[str, Any]], Any]) -> int:
    """Main function of such a process: do the work of the order and print its result."""
    order = json.loads(sys.argv[1])
    die_with_parent(SIGHUP, order["parent"])
    tell(json.dumps(work(order)))
    return 0


def rights_of(order: Mapping[str, Any]) -> Rights:
    """The rights in an order."""
    return Rights(**order["rights"])


def tell(text: str) -> None:
    """Print a text of any length completely.

    After an event loop on io_uring, for example, the kernel may accept only a part of a long text, and Python drops the
    rest if its output is not buffered.
    """
    sys.stdout.flush()
    left = text.encode()
    while left:
        left = left[os.write(sys.stdout.fileno(), left) :]


if __name__ == "__main__":
    sys.exit(serve(_grants))
