"""A program that pushes with a device, for tests that stop, kill or stall it and look at the force."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import Any

from tests.hardware.scripted import wait_for
from tests.master.devices import pushing_host
from tests.program import ROOT
from weberlink.geometry.vector import Vector, norm
from weberlink.master.devices.threaded_device import RAMP_S

Log = list[tuple[float, float]]
TICK = pushing_host.TICK


class Pushing:
    """The program, while it pushes.

    Args:
        process: of the program.
        most: the force that it commands [N].
        log: the sizes of the forces that the device took, each with its time: [s, N].
    """

    def __init__(self, process: "subprocess.Popen[str]", most: float, log: Callable[[], Log]) -> None:
        self.process = process
        self.log = log
        self._most = most

    @property
    def child(self) -> int:
        """Process id of its guardian, or of the servo process."""
        children = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        (pid,) = [int(pid) for each in children for pid in each.read_text().split()]
        return pid

    @property
    def force(self) -> float:
        """On the hand [N]."""
        log = self.log()
        return log[-1][1] if log else 0.0

    def pushes(self) -> bool:
        return self.force > 0.95 * self._most

    def zero_after(self, deed: Callable[[], Any]) -> float:
        """How long after a deed, in the middle of a push, there is no force [s]."""
        wait_for(self.pushes)
        at = monotonic()
        deed()
        ends: list[float] = []

        def ended() -> bool:
            ends[:] = [when - at for when, force in self.log() if when >= at and force == 0.0][:1]
            return bool(ends)

        wait_for(ended)
        return ends[0]

    def rises(self, seen: int, pause_s: float) -> bool:
        """Whether the force comes back from zero in steps that its ramp has in `pause_s` [s], after `seen` entries."""
        wait_for(self.pushes)
        forces = [0.0, *(force for _, force in self.log()[seen:])]
        return max(b - a for a, b in pairwise(forces)) <= self._most * pause_s / RAMP_S * 1.01

    def stall(self, seconds: float = 0.3) -> None:
        """Make the loop of the program stand still, while the thread of the device goes on."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{seconds}\n")
        self.process.stdin.flush()

    def says(self) -> str:
        """The next line."""
        assert self.process.stdout is not None
        return self.process.stdout.readline()


@contextmanager
def pushing(
    driver: str,
    options: Mapping[str, Any],
    force: Vector,
    log: Callable[[], Log],
    environment: Mapping[str, str] | None = None,
) -> Iterator[Pushing]:
    """Start the program with a driver, its options and a force [N]; it is dead at the end of the `with`."""
    process = subprocess.Popen(
        [sys.executable, "-m", pushing_host.__name__, driver, json.dumps(options), json.dumps(force)],
        cwd=ROOT,
        env=os.environ | dict(environment or {}),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield Pushing(process, norm(force), log)
    finally:
        process.kill()
        process.communicate()
