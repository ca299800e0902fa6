"""Where the maker's library should run: beside the tick in the daemon's interpreter, or in a process of its own.

    python -m trials.devices.touch_servo [--seconds 3] [--rounds 5] [--work-us 300] [--hold-ms 0] [--priority 0]

The fake library calls at 1 kHz. A tick at 1 kHz computes for some time in Python and collects garbage, both as a daemon
does; once a second it may hold the interpreter for longer, as a call of an extension does. Modes alternate, each in a
process of its own: no device at all, the servo loop in this interpreter, the servo loop in its own process. Times are
after the due time: the end of a frame for the hand, the wake-up and the end of a tick for the session. Each figure is
the median over the rounds, so that one disturbed round does not count.
"""

import argparse
import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from time import monotonic, sleep
from typing import Any

from plugins.devices.tests.touch.fake_hd import CYCLES, library, plugged
from weberlink.realtime.garbage import GarbageSchedule, freeze_garbage
from weberlink_devices.touch.device import TouchDevice
from weberlink_devices.touch.exchange import MEMORY_SIZE, ServoMemory
from weberlink_devices.touch.hdapi import Hdapi
from weberlink_devices.touch.options import TouchOptions
from weberlink_devices.touch.servo import ServoOrder, TouchServo

TICK = 0.001
MODES = ("none", "here", "process")
GARBAGE_TICKS = 100
PASSED = ("seconds", "work-us", "hold-ms", "priority")

Exchange = Callable[[float], object]


@contextmanager
def no_device() -> Iterator[Exchange]:
    yield lambda _: None


@contextmanager
def servo_here() -> Iterator[Exchange]:
    """The servo loop in this interpreter, called by the library's thread; the same slots, without shared memory."""
    memory = ServoMemory(bytearray(MEMORY_SIZE))
    servo = TouchServo(ServoOrder(str(library()), None, True, 0.01, 0.05, 1.0), Hdapi(str(library())), memory)
    servo.start()

    def exchange(now: float) -> object:
        memory.force.write(now, 0.0, 1.0, 0.0, 0)
        return memory.newest_state()

    try:
        yield exchange
    finally:
        servo.stop()


@contextmanager
def servo_in_its_process() -> Iterator[Exchange]:
    wanted = TouchOptions(library=str(library()))
    device = TouchDevice(wanted.model_copy(update={"signs_checked": TouchDevice.fingerprint(wanted)}), TICK)
    device.open(monotonic())

    def exchange(now: float) -> object:
        reading = device.latest(now)
        device.command((1.0, 0.0, 0.0), now)
        return reading

    try:
        yield exchange
    finally:
        device.close()


DEVICES = {"none": no_device, "here": servo_here, "process": servo_in_its_process}


def run(mode: str, seconds: float, work_s: float, hold_s: float, priority: int) -> dict[str, Any]:
    """Tick for a time; gives the times of ticks and frames [us]."""
    if priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    woken, ended = [], []
    hold = ctypes.PyDLL(None).usleep  # a PyDLL keeps the interpreter's lock
    with tempfile.TemporaryDirectory() as folder, plugged(Path(folder)) as (board,), DEVICES[mode]() as exchange:
        freeze_garbage()
        garbage = GarbageSchedule(GARBAGE_TICKS)
        sleep(0.3)
        first, due, until = board.cycles, monotonic(), monotonic() + seconds
        while due < until:
            due = max(due + TICK, monotonic() - 10.0 * TICK)
            if (left := due - monotonic()) > 0.0:
                sleep(left)
            now = monotonic()
            woken.append(now - due)
            exchange(now)
            busy = now + work_s
            while monotonic() < busy:
                pass
            if hold_s and len(woken) % 1000 == 0:
                hold(int(1e6 * hold_s))
            ended.append(monotonic() - due)
            garbage.tick(due + TICK - monotonic())
        last = board.cycles
        assert last - first <= CYCLES
        frames = [1e-3 * board.late[index % CYCLES] for index in range(first, last)]  # after the due time of its cycle
    return {"woken": [1e6 * time for time in woken], "ended": [1e6 * time for time in ended], "frames": frames}


def figures(times: list[float]) -> dict[str, float]:
    """Median, 99 and 99.9 percentiles and maximum [us], and the share later than a period [%]."""
    if not times:
        return {}
    ordered, last = sorted(times), len(times) - 1
    parts = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
    found = {name: ordered[min(last, int(part * len(times)))] for name, part in parts.items()}
    late = sum(time > 1e6 * TICK for time in times)
    return {**found, "max": max(times), "late_percent": 100.0 * late / len(times)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each run")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--work-us", type=float, default=300.0, help="computed in a tick")
    parser.add_argument("--hold-ms", type=float, default=0.0, help="how long the interpreter is held once a second")
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority; 0 for none")
    parser.add_argument("--mode", choices=MODES, help="one run only, its times as JSON")
    chosen = parser.parse_args()
    if chosen.mode:
        found = run(chosen.mode, chosen.seconds, 1e-6 * chosen.work_us, 1e-3 * chosen.hold_ms, chosen.priority)
        sys.stdout.write(json.dumps(found) + "\n")
        return 0
    rounds: dict[str, dict[str, list[dict[str, float]]]] = {mode: {} for mode in MODES}
    passed = [f"--{name}={getattr(chosen, name.replace('-', '_'))}" for name in PASSED]
    for _ in range(chosen.rounds):
        for mode in MODES:
            command = [sys.executable, "-m", "trials.devices.touch_servo", f"--mode={mode}", *passed]
            ended = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
            for name, times in json.loads(ended.stdout.splitlines()[-1]).items():
                rounds[mode].setdefault(name, []).append(figures(times))
    report = {
        mode: {
            name: {figure: median(row[figure] for row in rows) for figure in rows[0]}
            for name, rows in rounds[mode].items()
        }
        for mode in MODES
    }
    for mode in MODES:
        for name, row in report[mode].items():
            shown = "  ".join(f"{key} {value:.4g}" for key, value in row.items())
            sys.stdout.write(f"{mode:8} {name:7} {shown}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
