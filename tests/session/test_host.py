"""Missed ticks of a live session: of a processor that was taken away they are the host's, of a stopped daemon not."""

import os
import signal
import subprocess
import sys
from time import sleep
from typing import Any

import pytest

from conftest import may_use_fifo
from tests.program import PATIENT, Program, Telemetry, document
from tests.wait import until

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs a processor for each daemon"),
]
fifo = pytest.mark.skipif(not may_use_fifo(), reason="needs the right to SCHED_FIFO")

PROCESSORS = sorted(os.sched_getaffinity(0))[:2]
TAKEN_S = 0.1
HOG = f"""
import os, time
os.sched_setaffinity(0, {{{PROCESSORS[0]}}})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
end = time.monotonic() + {TAKEN_S}
while time.monotonic() < end: pass
"""
ARGUMENTS = ("--json", "-", *PATIENT, "--set", f"realtime.cpus={PROCESSORS}")


def watched(program: Program) -> Telemetry:
    """The telemetry of the master, once the watcher of the host is at work."""
    master = program.engaged("master")
    program.engaged("slave")
    until(program.watcher, "the watcher of the host")
    sleep(0.5)
    return master


def finished(program: Program) -> tuple[dict[str, Any], dict[str, int], dict[str, int]]:
    """The host's part of the report; missed ticks of each side, and those that are the host's."""
    program.send(signal.SIGTERM)
    status, output, errors = program.finish()
    assert (status, errors) == (0, "")
    summary = document(output)
    return (
        summary["host"],
        {side: ticks["missed"] for side, ticks in summary["ticks"].items()},
        summary["host"]["missed"],
    )


@fifo
def test_ticks_on_a_processor_that_was_taken_away_are_the_hosts() -> None:
    with Program("loopback", *ARGUMENTS) as program:
        master = watched(program)
        before = int(master.last["ticks_missed"])
        subprocess.run([sys.executable, "-S", "-c", HOG], check=True)
        until(lambda: master.last["ticks_missed"] > before + 50, "missed ticks")
        sleep(0.2)
        facts, missed, of_host = finished(program)
    assert facts["unknown"] is None
    assert facts["longest_ms"] >= 900 * TAKEN_S
    assert 900 * TAKEN_S <= of_host["master"] <= missed["master"]
    assert of_host["slave"] <= missed["slave"]
