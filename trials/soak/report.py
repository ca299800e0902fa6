"""Report of a soak: what was done, what was violated, and what grew."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from trials.soak.watch import Life

BOUNDS_PER_HOUR = {"rss_kib": 1024.0, "dirty_kib": 1024.0, "descriptors": 1.0, "threads": 1.0}
"""Growth of a daemon beyond which a soak has failed, per hour."""
WARM_UP_S = 20.0  # of each life: caches fill, which is no growth [s]
BLOCK_S = 30.0
SURE = 2.0  # standard deviations by which a slope must exceed its bound
_FEWEST_BLOCKS = 6
_HOUR = 3600.0


class Growth(NamedTuple):
    per_hour: float
    uncertainty: float  # standard deviation


def fit(lives: Iterable[Sequence[tuple[float, float]]]) -> Growth | None:
    """The common slope of several lives by least squares, each on a level of its own; None for too few samples."""
    # Memory changes in steps, so samples are averaged over blocks, and the uncertainty is that of the blocks.
    centred = []
    for life in filter(len, lives):
        samples = np.array(life, dtype=np.float64)
        since = samples[:, 0] - samples[0, 0] - WARM_UP_S
        samples, numbers = samples[since >= 0.0], since[since >= 0.0] // BLOCK_S
        blocks = np.array([samples[numbers == number].mean(axis=0) for number in np.unique(numbers)])
        if len(blocks) >= 2:
            centred.append(blocks - blocks.mean(axis=0))
    points = np.concatenate([np.empty((0, 2)), *centred])
    freedom = len(points) - len(centred) - 1
    if len(points) < _FEWEST_BLOCKS or freedom < 1:
        return None
    at, values = points.T
    slope = float(at @ values / (at @ at))
    residual = float(np.sum((values - slope * at) ** 2))
    return Growth(slope * _HOUR, sqrt(residual / freedom / float(at @ at)) * _HOUR)


@dataclass
class Kind:
    count: int = 0
    together: int = 0  # of them, under another fault
    worst_return_s: float = 0.0  # from the end of the fault to a session of both
    stalls: int = 0  # times that the machine stood still for longer than the session can bear: not held against it
    violations: list[str] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)


@dataclass
class Report:
    """Everything, in the order in which it is read; `violations` belong to no fault in particular."""

    seed: int
    minutes: float
    kinds: dict[str, Kind] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)
    rounds: int = 0
    ticks: int = 0
    longest_queue_bytes: dict[str, int] = field(default_factory=dict)
    growth: dict[str, Growth | None] = field(default_factory=dict)
    summaries: dict[str, Any] = field(default_factory=dict)

    def measure(self, lives: Sequence[Life]) -> None:
        for side in sorted({each.side for each in lives}):
            taken = [each.taken for each in lives if each.side == side]
            for quantity, bound in BOUNDS_PER_HOUR.items():
                grown = fit([[(at, getattr(held, quantity)) for at, held in each] for each in taken])
                self.growth[f"{side}: {quantity}"] = grown
                if grown is not None and grown.per_hour - SURE * grown.uncertainty > bound:
                    told = f"{grown.per_hour:.0f} +- {grown.uncertainty:.0f} an hour, more than {bound:.0f}"
                    self.violations.append(f"{side}: {quantity} grew by {told}")

    def failures(self) -> list[str]:
        return self.violations + [f"{name}: {text}" for name, kind in self.kinds.items() for text in kind.violations]

    def lines(self) -> list[str]:
        shown = [f"{'fault':15} {'count':>5} {'together':>8} {'worst return':>12} {'stalls':>6} {'violations':>10}"]
        for name, kind in self.kinds.items():
            figures = f"{kind.count:5} {kind.together:8} {kind.worst_return_s:10.2f} s {kind.stalls:6}"
            shown.append(f"{name:15} {figures} {len(kind.violations):10}")
            shown += [f"  {text}: {count}" for text, count in kind.notes.items()]
        for name, grown in self.growth.items():
            shown.append(
                f"{name} per hour: {'too short to tell' if grown is None else '{:+.0f} +- {:.0f}'.format(*grown)}"
            )
        return [*shown, f"{self.ticks} ticks seen", *(f"VIOLATED {text}" for text in self.failures())]

    def to_dict(self) -> dict[str, Any]:
        return asdict(self) | {"failures": self.failures(), "bounds_per_hour": BOUNDS_PER_HOUR}
