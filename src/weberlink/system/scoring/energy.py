"""Energy at the two ports of a session, from telemetry; energy from the operator to the robot is positive.

The device of the operator holds its force from tick k to the next while it moves from x_k to x_k+1, so the work of the
operator in that tick is exactly -output_k . (x_k+1 - x_k). At the robot, force and position change together, hence the
trapezoid -(f_k + f_k+1) / 2 . (p_k+1 - p_k) of the measured force over the commanded position. With six degrees of
freedom, torque does work over rotation in the same two ways.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.system.scoring.bound import EnergyBound

Records = NDArray[Any]
"""Structured array of telemetry records."""
Series = NDArray[np.float64]


class PortWork:
    """Cumulative work at one port, tick by tick.

    Every tick counts, also out of session and in ramps. A step over records that the reader lost counts nothing; one
    over a missed tick counts, since the force was held.

    Args:
        force, position: columns of the record.
        held: whether the force is held over the tick; else it changes linearly.
        turns: rotation vectors from each row to the next [rad], for rotation vectors of shape (n, 3); None for a
            session of three degrees of freedom.
        turning: column of the rotation vectors; that of the position with `rotation_` before it if not given.
        bound: what may come out at this port; None where nothing bounds it.
    """

    def __init__(
        self,
        force: str,
        position: str,
        *,
        held: bool,
        turns: Callable[[Any], Series] | None = None,
        turning: str | None = None,
        bound: EnergyBound | None = None,
    ) -> None:
        self._force, self._position, self._held, self._turns = force, position, held, turns
        self._turning = turning or f"rotation_{position}"
        self.bound = bound
        self._last: Records | None = None
        self.total = 0.0
        """Up to the newest record [J]."""
        self.least = 0.0
        """The lowest value of the sum so far, at most 0 [J]."""

    def add(self, records: Records) -> Series:
        """Take the next records; returns the work done up to each of them [J], shape (n,)."""
        if not len(records):
            return np.empty(0)
        first = self._last is None
        joined = records if self._last is None else np.concatenate([self._last, records])
        self._last = records[-1:].copy()
        forces, ways = [joined[self._force]], [np.diff(joined[self._position], axis=0)]
        if self._turns is not None:
            forces.append(joined[f"rotation_{self._force}"])
            ways.append(self._turns(joined[self._turning]))
        missed = np.diff(joined["ticks_missed"].astype(np.int64))
        lost = np.diff(joined["tick"].astype(np.int64)) != 1 + missed
        works = np.array([self._work(force, way) for force, way in zip(forces, ways, strict=True)])
        works[:, lost] = 0.0
        steps = works.sum(axis=0)
        sums: Series = self.total + np.cumsum(np.concatenate([[0.0], steps]) if first else steps)
        self.total = float(sums[-1])
        self.least = min(self.least, float(sums.min()))
        if self.bound is not None:
            self.bound.add(joined, ways, works, lost, sums[1:] if first else sums)
        return sums

    def _work(self, force: Any, ways: Any) -> Series:
        """Work over each step, of a force over a displacement or a torque over a turn [J]."""
        between = force[:-1] if self._held else 0.5 * (force[:-1] + force[1:])
        return np.asarray(-(between * ways).sum(axis=1), dtype=np.float64)


class LinkEnergy:
    """Energy that went in at the port of the operator and did not come out at the robot, while both sides lead.

    That is while both are engaged and neither is in a ramp: before, the robot approaches on its own. A step counts if
    that holds at both of its ends. A negative sum is energy that the link generated, which includes the effect of
    holding the force over a tick.
    """

    def __init__(self) -> None:
        self._last: tuple[float, bool] | None = None
        self._total = 0.0
        self.least = 0.0
        """The lowest value of the sum so far, at most 0 [J]."""

    def add(self, given: Series, taken: Series, counts: NDArray[np.bool_]) -> None:
        """Take the next pairs, in order of time, without gaps.

        Args:
            given: work of the operator up to each [J], shape (n,).
            taken: work that came out at the robot's port [J], shape (n,).
            counts: whether both sides lead, shape (n,).
        """
        if not len(given):
            return
        held = given - taken
        if self._last is not None:
            held = np.concatenate([[self._last[0]], held])
            counts = np.concatenate([[self._last[1]], counts])
        self._last = (float(held[-1]), bool(counts[-1]))
        sums = self._total + np.cumsum(np.diff(held) * (counts[1:] & counts[:-1]))
        if len(sums):
            self._total = float(sums[-1])
            self.least = min(self.least, float(sums.min()))
