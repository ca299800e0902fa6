"""What a fault can reach, and what may last while it happens: a faulty link, a busy core, a recording."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from os import kill
from pathlib import Path
from random import Random

from tests.soak.rig import Rig
from tests.soak.watch import Watch
from weberlink.protocol.emulation import Emulation
from weberlink.system.configuration import SIDES
from weberlink.system.recorder import Recorder, facts

NOISE = Emulation(delay_s=0.004, jitter_s=0.006, loss=0.05, reorder=0.05, duplicate=0.05, corrupt=0.05)
DELAY = Emulation(delay_s=0.045, jitter_s=0.015)
LONGEST_BURN_S = 40.0
SMALL_DISK_KIB = 192
FULL_S = 30.0
"""By when a disk of that size must be full: a session writes some hundred KiB a second."""
_BURN = """
import os, sys, time
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:])
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    sum(range(10_000))
"""


@dataclass
class Field:
    """Where a fault takes place.

    Attributes:
        short: whether each fault is to last no longer than it must.
        notes: counts that a fault reports beside violations.
        ended_at: when the way back began, if not when the fault returned [s].
    """

    rig: Rig
    watch: Watch
    random: Random
    short: bool
    notes: dict[str, int] = field(default_factory=dict)
    ended_at: float | None = None

    def lasting(self, short: float, least: float, most: float) -> float:
        """How long a fault lasts [s]."""
        return short if self.short else self.random.uniform(least, most)


@contextmanager
def burner(seconds: float) -> Iterator[None]:
    """Another program takes a whole core at normal priority, for so long at most."""
    process = subprocess.Popen([sys.executable, "-c", _BURN, str(seconds)], start_new_session=True)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextmanager
def recording(at: Field, folder: Path | None = None) -> Iterator[Recorder]:
    """Record the session meanwhile; the file is removed at the end."""
    rig, watch = at.rig, at.watch
    out = (folder or rig.folder) / "soak.mcap"
    recorder = Recorder(facts(rig.configuration), {side: rig.ring(side) for side in SIDES}, out)
    watch.extra["recorder"] = recorder.pid
    try:
        yield recorder
    finally:
        del watch.extra["recorder"]
        if recorder.running:
            kill(recorder.pid, signal.SIGCONT)
            kill(recorder.pid, signal.SIGTERM)
            watch.until(lambda: not recorder.running, 10.0)
        recorder.finish()
        out.unlink(missing_ok=True)


class MountError(RuntimeError):
    """No small disk can be mounted."""


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A disk of `SMALL_DISK_KIB` in memory, below a folder.

    Raises:
        MountError: it is not permitted.
    """
    small = folder / "small"
    small.mkdir(exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={SMALL_DISK_KIB}k", "none", str(small)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        if ended.returncode != 0:
            raise MountError(ended.stderr.strip() or "no tmpfs can be mounted")
        yield small
        subprocess.run(["umount", str(small)], check=True)
    finally:
        small.rmdir()


@contextmanager
def _link(at: Field, emulation: Emulation) -> Iterator[None]:
    at.rig.wire.emulate(emulation)
    yield


Condition = Callable[[Field], AbstractContextManager[object]]
CONDITIONS: dict[str, Condition] = {
    "noise": lambda at: _link(at, NOISE),
    "delay": lambda at: _link(at, DELAY),
    "busy_core": lambda at: burner(LONGEST_BURN_S),
    "recording": recording,
}
"""What faults happen under, when several come together."""
_LINK = {"noise", "delay", "bursts", "blackout", "cut_to_slave", "cut_to_master", "flap", "stolen_path", "many_calls"}
_RESTARTS = {"killed_master", "killed_slave", "take_over", "many_calls"}
EXCLUDED = {
    "noise": _LINK,
    "delay": _LINK,
    "busy_core": {"busy_core"},
    "recording": {"stalled_disk", "full_disk"} | _RESTARTS,
}
"""Faults that cannot happen under a condition: they would replace it, or wait for it."""
