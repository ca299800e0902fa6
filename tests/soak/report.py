"""Report of a soak: what was done, what was violated, and what grew."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np

from tests.soak.watch import Samples
from weberlink.system.configuration import SIDES

BOUNDS_PER_HOUR = {"rss_kib": 1024.0, "dirty_kib": 1024.0, "descriptors": 1.0, "threads": 1.0, "pss_kib": inf}
"""Growth of a daemon beyond which a soak has failed, per hour. PSS is told and not judged: it rises when others end."""
WARM_UP_S = 20.0
"""Of each life: caches fill, which is no growth [s]."""
BLOCK_S = 30.0
SURE = 2.0
"""Standard deviations by which a slope must exceed its bound."""
_FEWEST_BLOCKS = 6
_HOUR = 3600.0


@dataclass(frozen=True)
class Growth:
    """A slope per hour and its standard deviation, in the unit of the samples."""

    per_hour: float
    uncertainty: float
    samples: int

    def exceeds(self, bound: float) -> bool:
        """Whether the slope is above the bound beyond doubt."""
        return self.per_hour - SURE * self.uncertainty > bound


def fit(lives: Sequence[Sequence[tuple[float, float]]], *, warm_up: float = WARM_UP_S) -> Growth | None:
    """The common slope of several lives by least squares, each on a level of its own; None for too few samples.

    Memory changes in steps, so samples are averaged over blocks, and the uncertainty is that of the blocks.

    Args:
        lives: (time [s], value) of each, in order of time; the first sample of a life is its beginning.
    """
    centred = []
    for life in lives:
        if not life:
            continue
        samples = np.array(life, dtype=np.float64)
        since = samples[:, 0] - samples[0, 0] - warm_up
        samples, since = samples[since >= 0.0], since[since >= 0.0]
        numbers = since // BLOCK_S
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
    return Growth(slope * _HOUR, sqrt(residual / freedom / float(at @ at)) * _HOUR, len(points))


@dataclass
class Kind:
    """One kind of fault."""

    count: int = 0
    together: int = 0
    """Of them, under another fault."""
    worst_return_s: float = 0.0
    """From the end of the fault to a session of both."""
    stalls: int = 0
    """Times that the machine stood still for longer than the session can bear, so that nothing is held against it."""
    violations: list[str] = field(default_factory=list)
    notes: dict[str, int] = field(default_factory=dict)


@dataclass
class Report:
    """Everything, in the order in which it is read."""

    seed: int
    minutes: float
    kinds: dict[str, Kind] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)
    """That belong to no fault in particular."""
    rounds: int = 0
    lives: dict[str, int] = field(default_factory=dict)
    ticks: int = 0
    overruns: int = 0
    longest_queue_bytes: dict[str, int] = field(default_factory=dict)
    growth: dict[str, dict[str, Growth | None]] = field(default_factory=dict)
    held: dict[str, list[dict[str, list[int]]]] = field(default_factory=dict)
    """Of each life of each process: what it held at first and in the end, in the order of a footprint."""
    summaries: dict[str, Any] = field(default_factory=dict)
    relay: dict[str, Any] = field(default_factory=dict)

    def kind(self, name: str) -> Kind:
        return self.kinds.setdefault(name, Kind())

    def measure(self, samples: Iterable[Samples]) -> None:
        """Fit growth to the lives of each process; say where it is beyond its bound."""
        lives: dict[str, list[Samples]] = {}
        for of in samples:
            lives.setdefault(of.name, []).append(of)
        for name, of_name in sorted(lives.items()):
            taken = [life.taken for life in of_name if life.taken]
            self.held[name] = [{"first": list(life[0][1]), "last": list(life[-1][1])} for life in taken]
            self.growth[name] = {
                quantity: fit([life.series(quantity) for life in of_name]) for quantity in BOUNDS_PER_HOUR
            }
            for quantity, grown in self.growth[name].items():
                bound = BOUNDS_PER_HOUR[quantity]
                if grown is not None and grown.exceeds(bound) and name in SIDES:
                    self.violations.append(
                        f"{name}: {quantity} grew by {grown.per_hour:.0f} +- {grown.uncertainty:.0f} an hour, "
                        f"more than {bound:.0f}"
                    )

    def failures(self) -> list[str]:
        """Everything that was violated."""
        return self.violations + [f"{name}: {text}" for name, kind in self.kinds.items() for text in kind.violations]

    def lines(self) -> list[str]:
        """For a person."""
        shown = [f"{'fault':15} {'count':>5} {'together':>8} {'worst return':>12} {'stalls':>6} {'violations':>10}"]
        for name, kind in self.kinds.items():
            shown.append(
                f"{name:15} {kind.count:5} {kind.together:8} {kind.worst_return_s:10.2f} s {kind.stalls:6} "
                f"{len(kind.violations):10}"
            )
            shown += [f"  {text}: {count}" for text, count in kind.notes.items()]
        for name in SIDES:
            quantities = self.growth.get(name, {})
            fitted = {quantity: grown for quantity, grown in quantities.items() if grown is not None}
            if fitted:
                told = ", ".join(f"{q} {g.per_hour:+.0f} +- {g.uncertainty:.0f}" for q, g in fitted.items())
                shown.append(f"{name} per hour: {told}")
            else:
                shown.append(f"{name}: too short to tell growth")
        shown.append(f"{self.ticks} ticks seen, {self.overruns} not")
        return shown + [f"VIOLATED {text}" for text in self.failures()]

    def to_dict(self) -> dict[str, Any]:
        bounds = {name: bound for name, bound in BOUNDS_PER_HOUR.items() if isfinite(bound)}
        return asdict(self) | {"failures": self.failures(), "bounds_per_hour": bounds}
