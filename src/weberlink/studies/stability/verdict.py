"""Verdict on a cell from the telemetry of both sides: bounded or not, energy, force and settling time."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from weberlink.protocol.states import State
from weberlink.studies.stability.cells import CellTiming, SystemCell
from weberlink.system.scoring.session import Records
from weberlink.telemetry.fault import Fault

Floats = NDArray[np.float64]
Phase = Literal["settled", "decaying", "oscillating", "growing", "failed"]

SHARE = 0.05
"""Swing of a steady force, as a share of it, beside that of the deadband."""

DECAYING, GROWING = 0.9, 1.5
"""Ratios of the later to the earlier variance below which an oscillation decays and above which it grows."""


@dataclass(frozen=True)
class CellVerdict:
    """The figures of a cell.

    `state` judges the force on the operator during the hold, without its first 0.3 s and one round trip; the rest is
    halved. The swing (largest minus smallest) of a steady force is at most two deadbands and 5 %. In the second half:

        settled      the swing is not larger
        decaying     it is larger, but smaller than in the first half, with 10 % less variance and no limited force
        growing      it is larger, and its variance is above 1.5 times that of the first half
        oscillating  none of these: a limit cycle, to which the force limiter turns every growing oscillation
        failed       a fault, no session during the hold, or the cell could not run

    A cell is bounded if it is settled or decaying. A cell at its limit may be judged either way. A heavy hand that
    still bounces off the force limiter in the second half counts as oscillating.
    """

    state: Phase
    energy_generated_j: float | None = None
    """Largest energy that the operator got out of the port beyond what he put in."""
    link_generated_j: float | None = None
    """The same between the two ports: device, link and control, without the wall."""
    peak_force_n: float | None = None
    """Largest force on the operator."""
    swing_n: float | None = None
    """Largest minus smallest force on the operator in the second half of the hold."""
    steady_force_n: float | None = None
    """Mean force on the operator in the second half of the hold."""
    wall_force_n: float | None = None
    """Mean force on the robot in the second half of the hold."""
    settle_s: float | None = None
    """Time from the press until the force stays within a band around its mean in the second half of the hold: the
    larger of the deadband and 5 %. None if it does so for less than the last tenth of the hold."""
    force_reduction: float | None = None
    """Reduction of force updates relative to one per tick."""
    failure: str | None = None

    @property
    def bounded(self) -> bool:
        return self.state in ("settled", "decaying")

    @property
    def felt_share(self) -> float | None:
        """Mean force on the operator over that on the robot in the second half of the hold."""
        if self.steady_force_n is None or not self.wall_force_n:
            return None
        return self.steady_force_n / self.wall_force_n

    def as_json(self) -> dict[str, Any]:
        return asdict(self) | {"bounded": self.bounded, "felt_share": self.felt_share}


class CellObserver:
    """Collects the records of both sides for a verdict."""

    def __init__(self) -> None:
        self._masters: list[Records] = []
        self._slaves: list[Records] = []

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides."""
        self._masters.append(master)
        self._slaves.append(slave)

    def verdict(
        self, cell: SystemCell, when: CellTiming, energy: dict[str, float | None], failure: str | None
    ) -> CellVerdict:
        """Judge a finished run.

        Args:
            cell: its parameters.
            when: the times of its script.
            energy: of the session score.
            failure: reason of an early end.
        """
        master, slave = np.concatenate(self._masters), np.concatenate(self._slaves)
        at, felt, wall = master["at"], master["output"][:, 2], slave["raw"][:, 2]
        begin = when.hold + 0.3 + cell.round_trip_s
        middle = 0.5 * (begin + when.release)
        early, late = (at >= begin) & (at < middle), (at >= middle) & (at < when.release)
        failure = failure or _interruption(master[(at >= when.press) & (at < when.release)])
        steady = float(felt[late].mean()) if late.any() else 0.0
        deadband = max(cell.weber * abs(steady), cell.floor_n)
        state: Phase = "failed"
        if failure is None:
            clipped = bool(master["clipped"][late].any())
            state = _state(felt[early], felt[late], 2.0 * deadband + SHARE * abs(steady), clipped=clipped)
        return CellVerdict(
            state=state,
            energy_generated_j=energy["generated_j"],
            link_generated_j=energy["link_generated_j"],
            peak_force_n=float(np.linalg.norm(master["output"], axis=1).max()),
            swing_n=float(np.ptp(felt[late])) if late.any() else None,
            steady_force_n=steady,
            wall_force_n=float(wall[late].mean()) if late.any() else None,
            settle_s=None if failure else settling_time(at, felt, when, steady, max(deadband, SHARE * abs(steady))),
            force_reduction=_reduction(slave),
            failure=failure,
        )


def settling_time(at: Floats, force: Floats, when: CellTiming, steady: float, band: float) -> float | None:
    """From the press [s] until the force stays within the band for the rest of the hold; None if it hardly does."""
    span = (at >= when.press) & (at < when.release)
    outside = np.flatnonzero(np.abs(force[span] - steady) > band)
    times = at[span]
    last = float(times[outside[-1]]) if len(outside) else when.press
    return last - when.press if last < when.release - 0.1 * (when.release - when.hold) else None


def _state(early: Floats, late: Floats, steady_swing: float, *, clipped: bool) -> Phase:
    if float(np.ptp(late)) <= steady_swing:
        return "settled"
    before, after = float(early.var()), float(late.var())
    if after < DECAYING * before and np.ptp(late) < np.ptp(early) and not clipped:
        return "decaying"
    return "growing" if after > GROWING * before else "oscillating"


def _interruption(pressing: Records) -> str | None:
    """Reason why press and hold did not test the loop; None if they did."""
    if not len(pressing):
        return "ended before the hold"
    away = int((pressing["state"] != State.ENGAGED.value).sum())
    if away:
        return f"not engaged for {away} ticks of the press"
    faults = sorted({Fault(int(fault)).name.lower() for fault in np.unique(pressing["fault"]) if fault})
    return f"faults during the press: {', '.join(faults)}" if faults else None


def _reduction(slave: Records) -> float | None:
    ticks = int((slave["state"] == State.ENGAGED.value).sum())
    return 1.0 - int(slave["updates_sent"][-1]) / ticks if ticks else None
