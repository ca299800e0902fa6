"""What lasts while other faults happen: a faulty link, a busy core, a recording; and what cannot come together."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from tests.soak import disk
from tests.soak.field import Field
from weberlink.protocol.emulation import Emulation

NOISE = Emulation(delay_s=0.004, jitter_s=0.006, loss=0.05, reorder=0.05, duplicate=0.05, corrupt=0.05)
DELAY = Emulation(delay_s=0.045, jitter_s=0.015)
LONGEST_BURN_S = 40.0
_BURN = """
import os, sys, time
cpus = sorted(os.sched_getaffinity(0))
os.sched_setaffinity(0, cpus[-1:])
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    sum(range(10_000))
"""


@contextmanager
def burner(seconds: float) -> Iterator[None]:
    """Another program takes a whole core, at normal priority; it ends by itself after so long."""
    process = subprocess.Popen([sys.executable, "-c", _BURN, str(seconds)], start_new_session=True)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextmanager
def _link(at: Field, emulation: Emulation) -> Iterator[None]:
    at.rig.wire.emulate(emulation)
    yield


@contextmanager
def _burning(at: Field, seconds: float) -> Iterator[None]:
    with burner(seconds):
        yield


@contextmanager
def _recorded(at: Field) -> Iterator[None]:
    with disk.recording(at.rig, at.watch):
        yield


Under = Callable[[Field], AbstractContextManager[None]]
UNDERLAYS: dict[str, Under] = {
    "noise": lambda at: _link(at, NOISE),
    "delay": lambda at: _link(at, DELAY),
    "busy_core": lambda at: _burning(at, LONGEST_BURN_S),
    "recording": _recorded,
}
"""What others happen under, when several come together."""
_CUTS = {"bursts", "blackout", "cut_to_slave", "cut_to_master", "flap"}
_LINK = {"noise", "delay", "stolen_path", "recorded_calls", "many_calls"} | _CUTS
"""What puts faults of its own on the link."""
ALONE = {
    "noise": _LINK,
    "delay": _LINK,
    "busy_core": {"busy_core"},
    "recording": {
        "stalled_disk",
        "full_disk",
        "killed_master",
        "killed_slave",
        "take_over",
        "second_slave",
        "recorded_calls",
        "many_calls",
        "foreign_files",
    },
}
"""What cannot come together: it would replace what lies under it, or wait for it."""
