"""The limit of lateness where cyclictest is not installed: a Python process that waits for a timer, and no more.

A process of its own: it takes an order as JSON, with the rights of a daemon, and prints what it saw.
"""

import gc
import json
import os
import subprocess
import sys
from dataclasses import asdict
from signal import SIGHUP
from time import monotonic_ns

import numpy as np

from benchmarks.arrangement import BenchError, module, tell
from benchmarks.percentiles import Series
from benchmarks.rights import Rights
from weberlink.realtime import timerfd
from weberlink.realtime.process import die_with_parent

NAME = "timerfd in Python"
PATIENCE_S = 30.0


def measure(rate_hz: float, duration_s: float, rights: Rights, processes: int) -> Series:
    """How late each of the processes was woken, all together [us].

    Raises:
        BenchError: if one of them fails.
    """
    order = {"rate_hz": rate_hz, "duration_s": duration_s, "rights": asdict(rights), "parent": os.getpid()}
    running = [
        subprocess.Popen(  # noqa: S603
            module("bare_timer", json.dumps(order | {"place": place})), stdout=subprocess.PIPE, text=True
        )
        for place in range(processes)
    ]
    try:
        answers = [process.communicate(timeout=2.0 * duration_s + PATIENCE_S)[0] for process in running]
    except subprocess.TimeoutExpired:
        raise BenchError("the bare timer did not come to an end") from None
    finally:
        for process in running:
            process.kill()
            process.communicate()
    if any(process.returncode for process in running):
        raise BenchError("the bare timer failed")
    return np.concatenate([np.array(json.loads(answer), dtype=np.float64) for answer in answers])


def waits(rate_hz: float, count: int) -> list[float]:
    """Wait for `count` deadlines; how late each wake-up was, from the oldest deadline that had passed [us]."""
    period = round(1e9 / rate_hz)
    fd = timerfd.create()
    try:
        os.set_blocking(fd, True)
        start = monotonic_ns() + period
        timerfd.arm(fd, start, period)
        lateness, passed = [], 0
        while passed < count:
            expired = timerfd.expirations(fd)
            lateness.append((monotonic_ns() - (start + passed * period)) * 1e-3)
            passed += expired
    finally:
        os.close(fd)
    return lateness


def main(text: str) -> int:
    order = json.loads(text)
    die_with_parent(SIGHUP, order["parent"])
    rights = Rights(**order["rights"])
    rights.take(order["place"])
    gc.disable()
    seen = waits(order["rate_hz"], max(1, round(order["rate_hz"] * order["duration_s"])))
    tell(json.dumps(seen))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
