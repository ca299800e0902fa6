"""What the kernel grants a real-time process here, so that a limit is measured with the same rights as a daemon.

Also a process: it asks as a daemon does, and prints the answers.
"""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

from benchmarks.arrangement import BenchError, module, tell
from weberlink.realtime.process import prepare
from weberlink.system.configuration.model import RealtimeSettings


@dataclass(frozen=True)
class Rights:
    """What was granted: priority of SCHED_FIFO (0 for the ordinary scheduler), locked memory, processors kept awake,
    and the processor of each daemon."""

    priority: int
    lock_memory: bool
    wakeful: bool
    cpus: tuple[int, int] | None

    def cpu(self, place: int) -> int | None:
        return None if self.cpus is None else self.cpus[place]

    def take(self, place: int) -> None:
        """Give this process what a daemon has: of the two, that with this place."""
        prepare(self.priority, self.lock_memory, self.cpu(place), wakeful=self.wakeful)

    def give(self, pid: int, place: int) -> None:
        """Give a process that has just begun what a daemon has; its later threads inherit it."""
        if self.priority:
            os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(self.priority))
        cpu = self.cpu(place)
        if cpu is not None:
            os.sched_setaffinity(pid, {cpu})

    def as_json(self) -> dict[str, Any]:
        return {
            "scheduler": f"SCHED_FIFO {self.priority}" if self.priority else "SCHED_OTHER",
            "lock_memory": self.lock_memory,
            "wakeful": self.wakeful,
            "cpus": None if self.cpus is None else list(self.cpus),
        }


def granted(asked: RealtimeSettings) -> Rights:
    """Ask the kernel in a process of its own, which a real-time class does not outlive.

    Raises:
        BenchError: if that process fails.
    """
    ended = subprocess.run(module("rights", asked.model_dump_json()), capture_output=True, text=True, check=False)  # noqa: S603
    if ended.returncode:
        raise BenchError(f"asking the kernel for its grants failed: {ended.stderr.strip()}")
    answer = json.loads(ended.stdout)
    return Rights(
        priority=asked.priority if answer["priority"] else 0,
        lock_memory=answer["memory"],
        wakeful=answer["wakeful"],
        cpus=asked.cpus if answer["cpus"] else None,
    )


def main(text: str) -> int:
    asked = RealtimeSettings.model_validate_json(text)
    pinned = asked.cpus is not None and set(asked.cpus) <= os.sched_getaffinity(0)
    grants = prepare(asked.priority, asked.lock_memory, None, wakeful=asked.wakeful)
    answer = {name: bool(getattr(grants, name)) for name in ("priority", "memory", "wakeful")}
    tell(json.dumps(answer | {"cpus": pinned}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
