"""The records of both sides of a recorded session on one clock, from one file or from two.

Two hosts record on two clocks. The records of the slave contain the time of the master at every tick.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER, SIDES, SLAVE
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE, Records
from weberlink.telemetry.record import COUNTERS, FINITE
from weberlink_figures.session import MARGIN_S, Layout, SessionScore
from weberlink_figures.tree import Figures
from weberlink_recording.configuration import BEGUN, CONFIGURATION, TORQUE_BANK, parse_foreign
from weberlink_recording.reader import Recording, RecordingError

ANOTHER_CLOCK_S = 0.1  # a larger jump of the clock of the peer means another peer, or a restart of it
LATEST_S = 1e10  # upper limit of plausible times and durations [s]: three centuries
LEAST_OVERLAP_S = 0.1  # two files with less time in common are not two sides of one session
PIECE = 1000  # records of a side that are scored at a time; fewer than the score keeps waiting
RATES_HZ = (1.0, 1e5)  # plausible ones


class SessionMark(NamedTuple):
    """A mark, on the clock of the session [s], and its text."""

    at: float
    text: str


class SessionPicture(NamedTuple):
    """A picture, on the clock of the session [s], its camera, and the JPEG."""

    at: float
    camera: str
    jpeg: bytes


@dataclass(frozen=True)
class RecordedSession:
    """Both sides of a session; a side that was not recorded is empty.

    `at` of the records is on the clock of the master, or on that of the slave if the master was not recorded.
    """

    master: Records
    slave: Records
    layout: Layout  # what the records mean
    marks: tuple[SessionMark, ...] = ()  # in order of time, as the pictures
    pictures: tuple[SessionPicture, ...] = ()

    @property
    def sides(self) -> dict[str, Records]:
        """The sides that were recorded."""
        return {side: records for side in SIDES if len(records := getattr(self, side))}

    def figures(self) -> Figures:
        """The figures of the session, as those of a live one, with faults and drops by side."""
        score = SessionScore(self.layout)
        sides = [getattr(self, side) for side in SIDES]
        while any(map(len, sides)):
            # Up to the moment until which the side with more records has a piece of them.
            until = min((float(records["at"][PIECE]) for records in sides if len(records) > PIECE), default=np.inf)
            taken = [min(PIECE, int(np.searchsorted(each["at"], until, "right"))) for each in sides]
            score.add(*(records[:count] for records, count in zip(sides, taken, strict=True)))
            sides = [records[count:] for records, count in zip(sides, taken, strict=True)]
        dropped = {side: int(records["datagrams_dropped"][-1]) for side, records in self.sides.items()}
        return replace(score.figures(), drops={side: {"any": any_} if any_ else {} for side, any_ in dropped.items()})


def put_together(recordings: Sequence[Recording]) -> RecordedSession:
    """Join one or two recordings; raises RecordingError if the files contain the same side twice, different codecs or
    rates, no records, or no common time.
    """
    found: dict[str, tuple[Recording, Records]] = {}
    for recording in recordings:
        for side, records in recording.records.items():
            if not len(records):
                continue
            _check(recording, side, records)
            if side in found:
                raise RecordingError(f"{recording.path}: holds the {side}'s side, and so does {found[side][0].path}")
            found[side] = (recording, _from_its_beginning(records) if BEGUN in recording.facts else records)
    if not found:
        raise RecordingError(f"{recordings[0].path}: holds no records; expected at least one tick")
    banks = ([each.facts.get(name, "") for name in ("bank", TORQUE_BANK)] for each, _ in found.values())
    names = {f"{force} (torque: {torque})" if torque else force for force, torque in banks}
    rates = {recording.origins[side].rate_hz for side, (recording, _) in found.items()}
    if len(names) > 1 or len(rates) > 1:
        raise RecordingError(
            f"{', '.join(str(recording.path) for recording in recordings)}: not of one session: predictors "
            f"{' and '.join(sorted(names))}, rates {' and '.join(f'{rate:g}' for rate in sorted(rates))} Hz"
        )
    rate = rates.pop()
    reference, _ = found.get(MASTER) or found[SLAVE]
    original = {side: records for side, (_, records) in found.items()}
    if len(found) == 2 and found[MASTER][0] is not found[SLAVE][0]:
        slave = _on_the_masters_clock(found[SLAVE], found[MASTER], rate)
        own, theirs = slave["at"], found[MASTER][1]["at"]
        if min(own[-1], theirs[-1]) - max(own[0], theirs[0]) < LEAST_OVERLAP_S:
            paths = " and ".join(str(recording.path) for recording, _ in found.values())
            raise RecordingError(f"{paths}: have no time in common, so they are not two sides of one session")
        # The slave may have been alone for days.
        begin, end = np.searchsorted(own, (theirs[0] - MARGIN_S, theirs[-1] + MARGIN_S))
        found[SLAVE] = (found[SLAVE][0], slave[begin:end])
    empty, clocks = np.empty(0, DTYPE), [(each, _clock(each, found, original)) for each in recordings]
    return RecordedSession(
        master=found[MASTER][1] if MASTER in found else empty,
        slave=found[SLAVE][1] if SLAVE in found else empty,
        layout=_layout(reference, rate),
        marks=tuple(sorted(SessionMark(at(mark.wall_ns), mark.text) for each, at in clocks for mark in each.marks)),
        pictures=tuple(
            sorted(
                SessionPicture(at(one.wall_ns), one.camera, one.jpeg) for each, at in clocks for one in each.pictures
            )
        ),
    )


def _clock(
    recording: Recording, found: dict[str, tuple[Recording, Records]], original: dict[str, Records]
) -> Callable[[int], float]:
    """What maps the wall clock of a file [ns] to the clock of the session [s]: of a slave's own file it moves with its
    records."""
    side = next(iter(recording.origins))
    origin = recording.origins[side]
    offset = 0.0
    if found.get(side, (None,))[0] is recording and len(found[side][1]):
        moved = found[side][1]
        same = int(np.searchsorted(original[side]["tick"], moved["tick"][0]))
        offset = float(moved["at"][0] - original[side]["at"][same])
    wall_ns = round(origin.wall_s * 1e9)
    return lambda at: (at - wall_ns) * 1e-9 + origin.monotonic_s + offset


def _layout(recording: Recording, rate_hz: float) -> Layout:
    """What its records mean: without a configuration, the distance measures, and there is no arm and no account."""
    torque = recording.facts.get(TORQUE_BANK)
    bank, torque_bank = recording.facts.get("bank", "").split(), None if torque is None else tuple(torque.split())
    if CONFIGURATION not in recording.facts:
        return Layout.hand(rate_hz, bank, torque_bank)
    try:
        return Layout.of(parse_foreign(recording.facts[CONFIGURATION]), rate_hz, bank, torque_bank)
    except ValueError as error:
        raise RecordingError(f"{recording.path}: its configuration has no settings known here: {error}") from None


def _check(recording: Recording, side: str, records: Records) -> None:
    """Check that the records are complete and plausible."""
    lacks = sorted(set(DTYPE.names or ()) - set(records.dtype.names or ()))
    if lacks:
        raise RecordingError(
            f"{recording.path}: the {side}'s records lack {', '.join(lacks)}; made by another release, use that one"
        )
    bank = recording.facts.get("bank", "").split()
    torque_bank = recording.facts.get(TORQUE_BANK, "zoh").split()
    origin = recording.origins[side]
    at = records["at"]
    vectors = all(np.isfinite(records[name]).all() for name in FINITE)
    wrong = {
        "rate": not RATES_HZ[0] <= origin.rate_hz <= RATES_HZ[1],
        "clock": not (abs(origin.wall_s) < LATEST_S and abs(origin.monotonic_s) < LATEST_S),
        "time": not (np.isfinite(at).all() and (np.diff(at) >= 0.0).all() and at[-1] - at[0] < LATEST_S),
        "number of a predictor": bool(
            (records["selected"] >= len(bank)).any() or (records["second_selected"] >= len(torque_bank)).any()
        ),
        "number of a fault": bool((records["fault"] > max(Fault)).any()),
        "position or force": not vectors,
        "Weber factor": not ((records["weber"] >= 0.0) & (records["weber"] <= 1.0)).all(),
    }
    for what, is_wrong in wrong.items():
        if is_wrong:
            raise RecordingError(f"{recording.path}: the {side}'s records have no plausible {what}; not one of ours")


def _on_the_masters_clock(slave: tuple[Recording, Records], master: tuple[Recording, Records], rate: float) -> Records:
    """The records of the slave in its session with this master, with `at` in the time of the master.

    `peer_at` counts from tick 0 of the master, which the records of the master date. A slave may have served several
    masters one after the other, each with another offset between the clocks; the wall clocks tell which is this one.
    """
    recording, records = slave
    heard = np.flatnonzero(np.isfinite(records["peer_at"]))
    if not len(heard):
        raise RecordingError(f"{recording.path}: the slave never heard the master, so their clocks cannot be related")
    known = records["peer_at"][heard] - records["at"][heard]
    cuts = np.flatnonzero(np.abs(np.diff(known)) > ANOTHER_CLOCK_S) + 1
    sessions = np.split(heard, cuts)
    chosen = sessions[0] if len(sessions) == 1 else _session_of(sessions, slave, master)
    # Records before the first session belong to it, and records after a session to the session before them.
    first = 0 if chosen[0] == heard[0] else chosen[0]
    after = heard[heard > chosen[-1]]
    own = records[first : int(after[0]) if len(after) else len(records)]
    tick_0 = float(np.median(master[1]["at"] - master[1]["tick"] / rate))
    is_known = np.isfinite(own["peer_at"])
    # Without an estimate of the offset, the nearest one is used.
    offset = np.interp(own["at"], own["at"][is_known], own["peer_at"][is_known] - own["at"][is_known])
    moved = _counted_from(own, records[first - 1] if first else None)
    # The estimate may step back by microseconds, but times must not decrease.
    moved["at"] = np.maximum.accumulate(own["at"] + offset + tick_0)
    return moved


def _session_of(
    sessions: Sequence[NDArray[np.intp]], slave: tuple[Recording, Records], master: tuple[Recording, Records]
) -> NDArray[np.intp]:
    """Indices of the records of the slave in the session with most wall-clock time in common with the master."""
    recording, records = slave
    ours = recording.origins[SLAVE].log_times_ns(records["at"]) * 1e-9
    theirs = master[0].origins[MASTER].log_times_ns(master[1]["at"]) * 1e-9
    shared = [min(ours[each[-1]], theirs[-1]) - max(ours[each[0]], theirs[0]) for each in sessions]
    best = int(np.argmax(shared))
    if shared[best] < LEAST_OVERLAP_S:
        raise RecordingError(
            f"{recording.path}: holds {len(sessions)} sessions, none of them at the time of {master[0].path} by the "
            "clocks of the two hosts; set these, or give the recording of one session"
        )
    return sessions[best]


def _counted_from(records: Records, before: Any) -> Records:
    """A copy whose counters start at the record `before`, if there is one."""
    counted = records.copy()
    if before is not None:
        for name in COUNTERS:
            counted[name] -= before[name]
    return counted


def _from_its_beginning(records: Records) -> Records:
    """A copy whose counters start with the first record, which counts what it sent and received itself."""
    before = records[:1].copy()
    for own in ("sent", "second_sent"):
        before[own.replace("sent", "updates_sent")] -= before[own]
    before["updates_received"] -= before["received"]
    return _counted_from(records, before[0])


def time_axis(session: RecordedSession) -> dict[str, NDArray[np.float64]]:
    """Seconds since the first record of the session, for each side that was recorded."""
    first = min(float(records["at"][0]) for records in session.sides.values())
    return {side: records["at"] - first for side, records in session.sides.items()}
