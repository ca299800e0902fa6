"""Missed ticks: of a processor that was taken away they are the host's, of a stopped daemon not."""

import os
import signal
import subprocess
import sys
from time import sleep

import numpy as np
import pytest
from hypothesis import given, strategies as st

from conftest import may_use_fifo
from tests.examples import examples
from tests.program import PATIENT, Program, child, document
from tests.wait import until
from weberlink.telemetry.reader import DTYPE
from weberlink_figures.host import WakeUp
from weberlink_figures.host_watch import Gap, HostShare, missed_by_host

PERIOD = 1e-3
INTERVAL = 2e-3
Pauses = list[tuple[float, float]]


def ticks(pauses: Pauses, until: float) -> np.ndarray:
    """Records of a daemon that could not run in these pauses (begin, end): a late one serves the newest deadline."""
    rows, index, missed, now = [], 0, 0, 0.0
    while now < until:
        now = max(now, index * PERIOD)
        now = max([now, *(end for begin, end in pauses if begin <= now < end)])
        newest = int(np.floor(now / PERIOD + 1e-9))
        missed += newest - index
        rows.append((newest * PERIOD, missed, 1e6 * (now - newest * PERIOD)))
        index = newest + 1
    records = np.zeros(len(rows), DTYPE)
    records["at"], records["ticks_missed"], records["lateness_us"] = np.transpose(rows)
    return records


def stalls(pauses: Pauses, until: float, phase: float = 0.0005) -> list[WakeUp]:
    """What a watcher sees of the pauses of its processor."""
    found, ran, due = [], 0.0, phase
    while due < until:
        woken = max([due, *(end for begin, end in pauses if begin <= due < end)])
        if woken - due >= 0.5 * PERIOD:
            found.append(WakeUp(ran, due, woken))
        ran = woken
        due += INTERVAL * max(1.0, (woken - due) // INTERVAL + 1.0)
    return found


def attributed(records: np.ndarray, seen: list[WakeUp], pieces: int = 1) -> int:
    share = HostShare({"master": {0}}, PERIOD)
    for piece in np.array_split(records, pieces):
        share.add_records("master", piece)
    for stall in seen:
        share.add_stall(0, stall)
    share.settle(np.inf)
    return share.missed["master"]


PAUSES = st.lists(st.tuples(st.floats(0.05, 0.2), st.floats(0.0, 0.05)), max_size=4).map(
    lambda steps: [
        (0.25 * number + begin, 0.25 * number + begin + length) for number, (begin, length) in enumerate(steps)
    ]
)


@examples(40)
@given(PAUSES, st.integers(1, 5), st.floats(0.0, INTERVAL))
def test_long_stalls_of_the_host_explain_every_missed_tick(pauses: Pauses, pieces: int, phase: float) -> None:
    long = [(begin, end) for begin, end in pauses if end - begin >= INTERVAL + 0.5 * PERIOD]
    records = ticks(long, 1.5)
    assert attributed(records, stalls(long, 1.5, phase), pieces) == records["ticks_missed"][-1]


@examples(40)
@given(PAUSES, PAUSES)
def test_pauses_of_the_daemon_are_not_the_hosts(own: Pauses, of_host: Pauses) -> None:
    """At most an interval of the watcher is wrong for each stall; nothing where none touches a pause of the daemon."""
    records = ticks(own, 1.5)
    seen = stalls(of_host, 1.5)
    touching = [
        stall for stall in seen if any(stall.ran - PERIOD < end and begin < stall.woken + PERIOD for begin, end in own)
    ]
    assert attributed(records, seen) <= sum((stall.woken - stall.ran) / PERIOD + 1 for stall in touching)
    assert attributed(records, []) == 0
    if not touching:
        assert attributed(records, seen) == 0


def test_a_stall_while_the_daemon_ticked_explains_nothing() -> None:
    """The daemon runs again when the stall begins: ticks missed just before are its own."""
    gap = Gap(0.0995, 3, 0.1030)
    assert missed_by_host(gap, [WakeUp(0.1000, 0.1031, 0.1060)], PERIOD) == 0
    assert missed_by_host(gap, [WakeUp(0.0900, 0.0920, 0.0990)], PERIOD) == 0


def test_a_gap_waits_for_the_stalls_of_its_own_processor() -> None:
    share = HostShare({"master": {0}, "slave": {0, 1}}, PERIOD)
    for side in ("master", "slave"):
        share.add_records(side, ticks([(0.1, 0.15)], 0.3))
    share.settle(0.12)
    for stall in stalls([(0.1, 0.15)], 0.3):
        share.add_stall(1, stall)
    share.settle(100.0)
    assert share.missed["master"] == 0
    assert share.missed["slave"] >= 49


two_processors = pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs a processor for each daemon")
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


@pytest.mark.realtime
@two_processors
@fifo
def test_ticks_on_a_processor_that_was_taken_away_are_the_hosts() -> None:
    with Program("loopback", *ARGUMENTS) as program:
        master = program.engaged("master")
        program.engaged("slave")
        until(lambda: child(program.pid, "weberlink_figures.host"), "the watcher of the host")
        sleep(0.5)
        before = int(master.last["ticks_missed"])
        subprocess.run([sys.executable, "-S", "-c", HOG], check=True)
        until(lambda: master.last["ticks_missed"] > before + 50, "missed ticks")
        sleep(0.2)
        program.send(signal.SIGTERM)
        status, output, errors = program.finish()
    assert (status, errors) == (0, "")
    summary = document(output)
    facts, of_host = summary["host"], summary["host"]["missed"]
    missed = {side: ticks["missed"] for side, ticks in summary["ticks"].items()}
    assert facts["unknown"] is None
    assert facts["longest_ms"] >= 900 * TAKEN_S
    assert 900 * TAKEN_S <= of_host["master"] <= missed["master"]
    assert of_host["slave"] <= missed["slave"]
