"""Laws that must hold whatever is done to a session; each looks at telemetry and returns a line for each violation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.soak.processes import Footprint
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE

COUNTERS = (
    "ticks_missed",
    "datagrams_sent",
    "datagrams_received",
    "datagrams_dropped",
    "bytes_sent",
    "updates_sent",
    "updates_received",
    "repeats",
    "heartbeats",
)
GRID_S = 1e-5
"""By how much a deadline may be off its grid, of float rounding [s]."""
SPARE_DESCRIPTORS = 2
TICKS_S = 0.02
"""By which a side's newest record may be behind another's, though both tick [s]."""
STILL = 1e-9
"""[N] or [m]."""
ENGAGED = State.ENGAGED.value


def engaged(records: Records) -> Any:
    """Which ticks were in a session."""
    return records["state"] == ENGAGED


def force_rests(records: Records) -> list[str]:
    """The master gives no force in a tick without a session."""
    outside = records[~engaged(records)]
    forces = np.linalg.norm(outside["output"], axis=1)
    wrong = forces > 0.0
    if not wrong.any():
        return []
    first = outside[wrong][0]
    return [
        f"the force was {forces.max():.3g} N without a session, in {wrong.sum()} ticks from tick {first['tick']} on, "
        f"state {State(int(first['state'])).name}"
    ]


def counters_grow(records: Records) -> list[str]:
    """No counter of a daemon ever falls."""
    return [
        f"{name} fell from {values[:-1][fell][0]} to {values[1:][fell][0]}"
        for name in COUNTERS
        for values in [records[name]]
        for fell in [values[1:] < values[:-1]]
        if fell.any()
    ]


def deadlines_hold(records: Records, period: float) -> list[str]:
    """Ticks only go on, and their deadlines stay on one grid of the monotonic clock, whatever the wall clock does."""
    if len(records) < 2:
        return []
    if not (records["tick"][1:] > records["tick"][:-1]).all():
        return ["the number of the tick fell"]
    passed = (records["tick"] - records["tick"][0]).astype(np.float64) * period
    error = float(np.abs(records["at"] - records["at"][0] - passed).max())
    return [f"a deadline is {error * 1e3:.3f} ms off the grid"] if error > GRID_S else []


def stays(sides: dict[str, Records]) -> list[str]:
    """No side leaves the session."""
    found = []
    for side, records in sides.items():
        outside = records[~engaged(records)]
        if len(outside):
            states = sorted({State(int(state)).name for state in outside["state"]})
            found.append(f"the {side} left the session for {len(outside)} ticks ({', '.join(states)})")
    return found


def rests(sides: dict[str, Records], since: float) -> list[str]:
    """From then on no side is in the session, the hand's force is zero, the robot holds, and both ends name a fault.

    Args:
        sides: records of the sides that are judged.
        since: [s].
    """
    found = []
    for side, records in sides.items():
        late = records[records["at"] > since]
        if not len(late):
            found.append(f"the {side} wrote nothing once the limit was over")
            continue
        if engaged(late).any():
            found.append(f"the {side} was still in the session {late['at'][engaged(late)][-1] - since:.2f} s after it")
        if not late["fault"].any():
            found.append(f"the {side} named no fault")
        if side == MASTER:
            most = float(np.linalg.norm(late["output"], axis=1).max())
            found += [f"{most:.3g} N were on the hand after the limit"] * (most > 0.0)
        else:
            moved = float(np.abs(late["output"] - late["output"][0]).max())
            found += [f"the robot went on by {moved * 1e3:.3g} mm after the limit"] * (moved > 0.0)
    return found


def engaged_alone(sides: dict[str, Records], limit: float) -> list[str]:
    """No side is in a session for longer than the limit [s] while the other is not, or does not tick."""
    found = []
    for side, other in ((MASTER, SLAVE), (SLAVE, MASTER)):
        mine, theirs = sides[side], sides[other]
        with_them = theirs[engaged(theirs)]["at"]
        since, longest = None, 0.0
        newest = np.concatenate([[-np.inf], with_them])[np.searchsorted(with_them, mine["at"], side="right")]
        for at, alone in zip(mine["at"], engaged(mine) & (mine["at"] - newest > TICKS_S), strict=True):
            since = (at if since is None else since) if alone else None
            longest = max(longest, 0.0 if since is None else at - since)
        if longest > limit:
            found.append(f"the {side} was in a session for {longest:.2f} s while the {other} was not")
    return found


def wakes_gently(records: Records, side: str, *, most: float) -> list[str]:
    """After it stood still for longer than the limit, a side names it, and begins from where it is.

    Args:
        records: of the side that stood still, from before until after.
        side: which it is.
        most: what the force may be 0.1 s after it goes on, in N; or the robot may have moved, in m.
    """
    if len(records) < 3:
        return [f"the {side} wrote nothing"]
    done = records["at"] + records["lateness_us"].astype(np.float64) * 1e-6
    first = int(np.argmax(np.diff(done))) + 1
    since = done[first:] - done[first]
    soon, since = records[first:][since < 0.1], since[since < 0.1]
    found = [] if soon["fault"].any() else [f"the {side} stood still, and named no fault"]
    start = np.zeros(3) if side == MASTER else records["output"][first - 1]
    off = np.linalg.norm(soon["output"] - start, axis=1)
    wrong = off > most * since / 0.1 + STILL
    if wrong.any():
        what = f"{off[wrong][0]:.3g} N" if side == MASTER else f"{off[wrong][0] * 1e3:.3g} mm"
        largest = f"{off.max():.3g} N" if side == MASTER else f"{off.max() * 1e3:.3g} mm"
        found.append(f"the {side} went on with {what} after {since[wrong][0] * 1e3:.0f} ms, {largest} within 100 ms")
    return found


def nothing_stale(records: Records, released: int, still: Sequence[str] = ("position", "output")) -> list[str]:
    """What arrives older than the silence limit moves nothing: not the session, not the robot, not the hand.

    Args:
        records: of the receiving side, from before the first stale datagram arrived until after the last one.
        released: how many there were, handshakes apart.
        still: what of the records must not change.
    """
    if not released or len(records) < 2:
        return ["nothing stale could be delivered, so nothing was shown"]
    found = []
    if engaged(records).any():
        found.append("stale datagrams brought the session back")
    applied = int(records["updates_received"][-1] - records["updates_received"][0])
    if applied or records["received"][1:].any():
        found.append(f"{applied} stale updates were applied")
    for name in still:
        moved = float(np.abs(records[name] - records[name][0]).max())
        if moved > 0.0:
            found.append(f"{name} moved by {moved * 1e3:.3g} mm while all that arrived was stale")
    dropped = int(records["datagrams_dropped"][-1] - records["datagrams_dropped"][0])
    if dropped < released:
        found.append(f"{released} stale datagrams were delivered, and only {dropped} counted as dropped")
    return found


def returned(seconds: float | None, limit: float) -> list[str]:
    """Both are back in a session within the stated time after the fault."""
    if seconds is None:
        return [f"no session within {limit:g} s after the fault"]
    return []


def away_for(sides: dict[str, Records], ended: float, period: float) -> float:
    """From the end of a fault to the first tick of a session of both that lasts until now [s]."""
    lasts = [records["at"][~engaged(records)] for records in sides.values()]
    return max([float(outside[-1]) + period - ended for outside in lasts if len(outside)] + [0.0])


def same_session(calls: int, answers: int) -> list[str]:
    """No handshake was needed."""
    if calls or answers:
        return [f"the session was not kept: {calls} HELLOs and {answers} WELCOMEs"]
    return []


def answers_little(shots: Mapping[str, Any], *, is_proven: bool) -> list[str]:
    """A flood gets at most one answer to a question, no longer than that, and none without proof of the key.

    Args:
        shots: figures of `tests.soak.volley`.
        is_proven: whether the datagrams hold a proof of the key.
    """
    if not shots["answers"]:  # none, or nobody could hear them
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


def queue_drains(waiting: Sequence[int]) -> list[str]:
    """A socket's queue is empty at some look of several in a quiet moment."""
    if waiting and min(waiting) > 0:
        return [f"{min(waiting)} bytes or more wait in the socket all the time"]
    return []


def longest_gap(records: Records, period: float) -> float:
    """Longest time without a tick [s]: a machine that stalls is no fault of the link."""
    if len(records) < 2:
        return 0.0
    # Both that a tick was left out and that one came late.
    done = records["at"] + records["lateness_us"].astype(np.float64) * 1e-6
    return max(0.0, float(np.diff(done).max()) - period)


def nothing() -> Records:
    """No records."""
    return np.empty(0, DTYPE)
