"""What the program means to reach beside its limits, and whether it did. A target that is missed is a finding."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from benchmarks.arrangement import MAIN_RATE_HZ
from benchmarks.latency import Latency
from benchmarks.lateness import Lateness

FASTEST_HZ = 4000.0


@dataclass(frozen=True)
class Target:
    """A figure and its bound.

    Args:
        name: stable, with the unit or kind of the value.
        value: None where it could not be measured.
        target: the bound.
        at_least: whether the value is to reach the bound, rather than to stay within it.
        words: for people.
    """

    name: str
    value: float | None
    target: float
    words: str
    at_least: bool = False

    @property
    def met(self) -> bool | None:
        """None where there is no value."""
        if self.value is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target

    def as_json(self) -> dict[str, Any]:
        return {name: value for name, value in asdict(self).items() if name != "words"} | {"met": self.met}


def targets(lateness: Mapping[float, Lateness], latency: Latency) -> list[Target]:
    """All of them, of the rates that were run; of two daemons the worse one counts."""
    main, fastest = lateness.get(MAIN_RATE_HZ), lateness.get(FASTEST_HZ)
    cpu = None if main is None else max(side.cpu_s / side.elapsed_s for side in main.sides.values())
    of = _of
    return [
        Target(
            "lateness_p99_ratio_1khz", of(main, lambda at: at.worst_ratio), 2.0, "p99 lateness at 1 kHz, x the limit's"
        ),
        Target("missed_share_1khz", of(main, lambda at: at.missed_share), 0.001, "missed ticks at 1 kHz, share"),
        Target("missed_share_4khz", of(fastest, lambda at: at.missed_share), 0.01, "missed ticks at 4 kHz, share"),
        Target("cpu_share_1khz", cpu, 0.12, "CPU of a daemon at 1 kHz, share of a core"),
        Target("one_way_p50_ratio", latency.worst_ratio, 3.0, "one way of an update, x a plain socket's"),
    ]


def _of(rate: Lateness | None, value: Callable[[Lateness], float | None]) -> float | None:
    return None if rate is None else value(rate)
