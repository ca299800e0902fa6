"""The rows of the study: what is kept of each run, flat, as it is written and read again."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from weberlink.studies.adaptive.signals import Half, Key, Kind


@dataclass(frozen=True)
class Rate:
    """How often one signal was sent."""

    part: str
    """Of the study: what was asked."""
    signal: str
    group: str
    half: Half
    kind: Kind
    noise_n: float
    variant: str
    floor_n: float
    packets: int
    packets_per_s: float
    outside: int = 0
    """Ticks beyond their deadband; 0 by the law of the codec."""


@dataclass(frozen=True)
class Match:
    """What is felt of one signal at the packets of the hybrid."""

    signal: str
    group: str
    half: Half
    kind: Kind
    variant: str
    weber: float
    packets: int
    packets_per_s: float
    error_rms_n: float
    error_rms_jnd: float
    largest_step_n: float
    step_jnd: float
    """99.9th percentile."""
    outside: int = 0


@dataclass(frozen=True)
class Cost:
    """Run time of encode plus decode per tick."""

    variant: str
    ticks: int
    median_us: float
    mean_us: float
    p99_us: float
    worst_us: float
    differing: int = 0
    """Ticks after which the states of the two ends were not the same bit for bit; 0 by the law."""


@dataclass(frozen=True)
class Results:
    """All rows."""

    rates: list[Rate] = field(default_factory=list)
    matches: list[Match] = field(default_factory=list)
    costs: list[Cost] = field(default_factory=list)

    def of(self, part: str, **fields: object) -> list[Rate]:
        """Rates of a part of the study that have these values."""
        return chosen((row for row in self.rates if row.part == part), **fields)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def chosen(rows: Iterable[Rate], **fields: object) -> list[Rate]:
    """Those that have these values."""
    return [row for row in rows if all(getattr(row, name) == value for name, value in fields.items())]


def rate(part: str, key: Key, variant: str, floor_n: float, packets: int, duration_s: float, outside: int = 0) -> Rate:
    """A row of a signal."""
    return Rate(
        part,
        key.name,
        key.group,
        key.half,
        key.kind,
        key.noise_n,
        variant,
        floor_n,
        packets,
        packets / duration_s,
        outside,
    )


def by_signal(rows: Iterable[Rate], value: Callable[[Rate], float] = lambda row: row.packets_per_s) -> dict[str, float]:
    """A number of each signal, in the order of the rows."""
    return {row.signal: value(row) for row in rows}
