"""A recorded session put together again: the records of both sides on one clock, from one file or from two.

Owns the join and the figures that follow from it. Two hosts have two clocks and each records its own; what relates them
is in the records of the slave, which say at every tick what the master's clock showed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.session import Records, SessionScore
from telemetry.fault import Fault
from telemetry.reader import DTYPE
from telemetry.recording.reader import Recording, RecordingError

MASTER, SLAVE = "master", "slave"
SIDES = (MASTER, SLAVE)
LEAST_OVERLAP_S = 0.1
"""Two files that share less of time are not two sides of one session."""
PIECE_S = 1.0
"""How much of a session is looked at in one go [s]; the join keeps ten seconds."""


@dataclass(frozen=True)
class RecordedSession:
    """Both sides of a session; a side that was not recorded is empty.

    Args:
        master: records of the operator's side, `at` on its own clock.
        slave: records of the teleoperator's side, `at` on the clock of the master where there is one.
        rate_hz: of the ticks.
        bank: names of the force channel's predictors.
        began_s: wall clock at `at` = 0 [s since 1970].
    """

    master: Records
    slave: Records
    rate_hz: float
    bank: tuple[str, ...]
    began_s: float

    @property
    def sides(self) -> dict[str, Records]:
        """The sides that were recorded."""
        return {side: records for side in SIDES if len(records := getattr(self, side))}

    def summary(self) -> dict[str, Any]:
        """The figures of the session, as those of a live one, and the faults by side."""
        score = SessionScore(self.rate_hz, self.bank)
        first = min(records["at"][0] for records in self.sides.values())
        last = max(records["at"][-1] for records in self.sides.values())
        for until in np.arange(first, last + PIECE_S, PIECE_S):
            score.add(*(_between(getattr(self, side), until, until + PIECE_S) for side in SIDES))
        return score.summary() | {
            "faults": {side: _faults(records) for side, records in self.sides.items()},
            "drops": {side: _drops(records) for side, records in self.sides.items()},
        }


def put_together(recordings: Sequence[Recording]) -> RecordedSession:
    """Join one or two recordings.

    Raises:
        RecordingError: the files hold the same side twice, another codec or rate, no records, or no time in common.
    """
    found: dict[str, tuple[Recording, Records]] = {}
    for recording in recordings:
        _check_fields(recording)
        for side, records in recording.records.items():
            if not len(records):
                continue
            if side in found:
                raise RecordingError(f"{recording.path}: holds the {side}'s side, and so does {found[side][0].path}")
            found[side] = (recording, records)
    if not found:
        raise RecordingError(f"{recordings[0].path}: holds no records; expected at least one tick")
    names = {recording.facts.get("bank", "") for recording, _ in found.values()}
    rates = {recording.origins[side].rate_hz for side, (recording, _) in found.items()}
    if len(names) > 1 or len(rates) > 1:
        raise RecordingError(
            f"{', '.join(str(recording.path) for recording in recordings)}: not of one session: predictors "
            f"{' and '.join(sorted(names))}, rates {' and '.join(f'{rate:g}' for rate in sorted(rates))} Hz"
        )
    rate = rates.pop()
    (reference, _), side = found.get(MASTER) or found[SLAVE], MASTER if MASTER in found else SLAVE
    origin = reference.origins[side]
    if len(found) == 2 and found[MASTER][0] is not found[SLAVE][0]:
        slave = _on_the_masters_clock(found[SLAVE], found[MASTER][1], rate)
        _check_overlap(found[MASTER][1], slave, found)
        found[SLAVE] = (found[SLAVE][0], slave)
    empty = np.empty(0, DTYPE)
    return RecordedSession(
        master=found[MASTER][1] if MASTER in found else empty,
        slave=found[SLAVE][1] if SLAVE in found else empty,
        rate_hz=rate,
        bank=tuple(names.pop().split()),
        began_s=origin.wall_s - origin.monotonic_s,
    )


def _check_fields(recording: Recording) -> None:
    for side, records in recording.records.items():
        lacks = sorted(set(DTYPE.names or ()) - set(records.dtype.names or ()))
        if lacks:
            raise RecordingError(
                f"{recording.path}: the {side}'s records lack {', '.join(lacks)}; made by another release, use that one"
            )


def _on_the_masters_clock(slave: tuple[Recording, Records], master: Records, rate: float) -> Records:
    """The slave's records with `at` in the master's time.

    `peer_at` counts from the master's tick 0, which its own records date. Where the slave did not know it, before the
    session say, its own clock runs on from the nearest tick where it did.
    """
    recording, records = slave
    known = np.isfinite(records["peer_at"])
    if not known.any():
        raise RecordingError(f"{recording.path}: the slave never heard the master, so their clocks cannot be related")
    tick_0 = float(np.median(master["at"] - master["tick"] / rate))
    moved = records.copy()
    offset = np.interp(records["at"], records["at"][known], records["peer_at"][known] - records["at"][known])
    # The estimate of a clock may step back by microseconds; time may not.
    moved["at"] = np.maximum.accumulate(records["at"] + offset + tick_0)
    return moved


def _check_overlap(master: Records, slave: Records, found: dict[str, tuple[Recording, Records]]) -> None:
    common = min(master["at"][-1], slave["at"][-1]) - max(master["at"][0], slave["at"][0])
    if common < LEAST_OVERLAP_S:
        paths = " and ".join(str(recording.path) for recording, _ in found.values())
        raise RecordingError(f"{paths}: have no time in common, so they are not two sides of one session")


def _between(records: Records, first: float, last: float) -> Records:
    begin, end = np.searchsorted(records["at"], (first, last))
    return records[begin:end]


def _faults(records: Records) -> dict[str, int]:
    """How often each fault began."""
    fault = records["fault"]
    began = fault[np.flatnonzero(np.diff(fault, prepend=0))]
    return {Fault(number).name.lower(): int((began == number).sum()) for number in np.unique(began[began > 0])}


def _drops(records: Records) -> dict[str, int]:
    dropped = int(records["datagrams_dropped"][-1])
    return {"any": dropped} if dropped else {}


def time_axis(session: RecordedSession) -> dict[str, NDArray[np.float64]]:
    """Seconds since the first record of the session, for each side that was recorded."""
    first = min(float(records["at"][0]) for records in session.sides.values())
    return {side: records["at"] - first for side, records in session.sides.items()}
