"""Laws that must hold whatever is done to a session; each looks at telemetry and returns a line for each violation."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tests.program import ENGAGED, Records
from weberlink.config import MASTER, SIDES
from weberlink.protocol.states import State
from weberlink.telemetry.record import FORCE

COUNTERS = (
    *("ticks_missed", "datagrams_sent", "datagrams_received", "datagrams_dropped", "bytes_sent"),
    *("updates_sent", "updates_received", "repeats", "heartbeats"),
)
GRID_S = 1e-5  # by how much a deadline may be off its grid, of float rounding [s]
SPARE_DESCRIPTORS = 2
TICKS_S = 0.02  # by which a side's newest record may be behind another's, though both tick [s]
STILL = 1e-9  # [N] or [m]
Both = Mapping[str, Records]


class Footprint(NamedTuple):
    """What a process holds at one moment; memory in KiB, of which `dirty_kib` is all its own."""

    rss_kib: int
    dirty_kib: int
    descriptors: int
    threads: int


def outside(records: Records) -> Records:
    return records[records["state"] != ENGAGED]


def done_at(records: Records) -> Any:
    """When ticks were done, at whatever time they were due [s]."""
    return records["at"] + records["lateness_us"].astype(np.float64) * 1e-6


def always(records: Records, first: Records, period: float, side: str) -> list[str]:
    """No counter falls, deadlines stay on one grid whatever the wall clock does, no force without a session."""
    found = [f"{name} fell" for name in COUNTERS if (np.diff(records[name].astype(np.int64)) < 0).any()]
    if (np.diff(records["tick"].astype(np.int64)) <= 0).any():
        return [*found, "the number of the tick fell"]
    passed = (records["tick"] - first["tick"]).astype(np.float64) * period
    if (error := float(np.abs(records["at"] - first["at"] - passed).max())) > GRID_S:
        found.append(f"a deadline is {1e3 * error:.3f} ms off the grid")
    apart = outside(records)
    apart = apart[apart["state"] != State.CLOSED.value]  # who leaves for good fades out before
    wrong = apart[np.linalg.norm(apart["output"], axis=1) > 0.0]
    if side == MASTER and len(wrong):
        state = State(int(wrong["state"][0])).name
        found.append(f"{len(wrong)} ticks with force from tick {wrong['tick'][0]} on, without a session ({state})")
    return found


def stays(sides: Both) -> list[str]:
    return [
        f"the {side} left the session for {len(apart)} ticks ({', '.join(State(int(s)).name for s in states)})"
        for side, records in sides.items()
        if len(apart := outside(records))
        for states in [sorted(set(apart["state"].tolist()))]
    ]


def rests(sides: Both, since: float) -> list[str]:
    """From then on [s] no side is in the session, the hand's force is zero, the robot holds, and a fault is named."""
    found = []
    for side, records in sides.items():
        late = records[records["at"] > since]
        if not len(late):
            found.append(f"the {side} wrote nothing once the limit was over")
            continue
        if len(inside := late["at"][late["state"] == ENGAGED]):
            found.append(f"the {side} was still in the session {inside[-1] - since:.2f} s after it")
        if not late["fault"].any():
            found.append(f"the {side} named no fault")
        rest = 0.0 if side == MASTER else late["output"][0]
        if (moved := float(np.abs(late["output"] - rest).max())) > 0.0:
            found.append(f"the output of the {side} went on by {moved:.3g} after the limit")
    return found


def engaged_alone(sides: Both, limit: float) -> list[str]:
    """No side is in a session for longer than the limit [s] while the other is not, or does not tick."""
    found = []
    for side, other in (SIDES, SIDES[::-1]):
        mine, theirs = sides[side], sides[other]
        with_them = np.concatenate([[-np.inf], theirs["at"][theirs["state"] == ENGAGED]])
        newest = with_them[np.searchsorted(with_them, mine["at"], side="right") - 1]
        alone = (mine["state"] == ENGAGED) & (mine["at"] - newest > TICKS_S)
        begins = alone & ~np.concatenate([[False], alone[:-1]])[: len(alone)]
        since = np.maximum.accumulate(np.where(begins, mine["at"], -np.inf))
        longest = float((mine["at"] - since)[alone].max(initial=0.0))
        if longest > limit:
            found.append(f"the {side} was in a session for {longest:.2f} s while the {other} was not")
    return found


def wakes_gently(records: Records, side: str, *, most: float) -> list[str]:
    """After it stood still for longer than the limit, a side names it, and begins from where it is.

    Within 0.1 s it has gone on by at most `most`: the force in N, or the robot in m.
    """
    if len(records) < 3:
        return [f"the {side} wrote nothing"]
    done = done_at(records)
    first = int(np.argmax(np.diff(done))) + 1
    since = done[first:] - done[first]
    soon, since = records[first:][since < 0.1], since[since < 0.1]
    found = [] if soon["fault"].any() else [f"the {side} stood still, and named no fault"]
    rest = 0.0 if side == MASTER else records["output"][first - 1, FORCE]
    off = np.linalg.norm(soon["output"][:, FORCE] - rest, axis=1)
    wrong = off > most * since / 0.1 + STILL
    if wrong.any():
        found.append(f"the {side} went on with {off[wrong][0]:.3g} after {1e3 * since[wrong][0]:.0f} ms")
    return found


def away_for(sides: Both, ended: float, period: float) -> float:
    """From the end of a fault to the first tick of a session of both that lasts until now [s]."""
    lasts = [float(apart["at"][-1]) + period - ended for each in sides.values() if len(apart := outside(each))]
    return max([*lasts, 0.0])


def answers_little(shots: Mapping[str, Any], *, is_proven: bool) -> list[str]:
    """A flood gets at most one answer to a question, no longer than that, and none without proof of the key."""
    if not shots["answers"]:
        return []
    found = [] if is_proven else [f"{shots['answers']} answers to who has not proved the key"]
    if shots["answers"] > shots["sent"] or shots["answered_bytes"] > shots["sent_bytes"]:
        asked = f"{shots['sent']} questions of {shots['sent_bytes']} B"
        found.append(f"{asked} had {shots['answers']} answers of {shots['answered_bytes']} B")
    if shots["longest_answer"] > shots["shortest_question"]:
        found.append(f"an answer of {shots['longest_answer']} B, a question of {shots['shortest_question']} B")
    return found


def holds_no_more(first: Footprint, now: Footprint) -> list[str]:
    """Descriptors and threads of a process stay as many as in its first quiet moment."""
    found = []
    if now.descriptors > first.descriptors + SPARE_DESCRIPTORS:
        found.append(f"descriptors rose from {first.descriptors} to {now.descriptors}")
    if now.threads > first.threads:
        found.append(f"threads rose from {first.threads} to {now.threads}")
    return found


def longest_gap(records: Records, period: float) -> float:
    """Longest time without a tick, left out or late [s]: a machine that stalls is no fault of the link."""
    return max(0.0, float(np.diff(done_at(records)).max()) - period) if len(records) > 1 else 0.0
