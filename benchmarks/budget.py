"""What each part of a tick costs, with cold and with warm caches, beside its floor and beside the live daemons.

`staged_tick` measures the parts on each side, `bare_tick` their floors. The CPU time that a process spends outside of
its ticks is divided by the bare loops: waking up is what a bare epoll loop costs, the lead what it adds to a ticker,
and the event loop is the rest. `side loop` is what a whole tick takes beyond its parts: safety and the order of things.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, Rights, answers, child
from benchmarks.bare_tick import EPOLL, LEADING, TICKER, UVLOOP
from benchmarks.kernel_counts import KernelCounts, count
from benchmarks.latency import SIZE
from benchmarks.live_run import live_run
from benchmarks.live_side import LiveSide
from benchmarks.percentiles import summary
from benchmarks.staged_tick import DECRYPT, SEAL, TELEMETRY, chunk_median, cold_sides
from benchmarks.staged_tick import PARTS as STAGED_PARTS
from weberlink.studies.result import plain_table
from weberlink.system.configuration import SIDES, SLAVE
from weberlink.system.launcher import Daemon

WAKE, LEAD, LOOP, SIDE_LOOP = "wake-up", "lead", "event loop", "side loop"
PARTS = (WAKE, LEAD, LOOP, *STAGED_PARTS, SIDE_LOOP)
WORK = tuple(part for part in PARTS if part not in {WAKE, LEAD, LOOP, TELEMETRY})
"""The parts that a daemon counts as the work of a tick."""
LIVE_SHARE = 0.25
"""Share of the duration for the live run, and for the staged ticks."""
COUNT_S = 2.0
PATIENCE_S = 90.0
COLUMNS = (
    ("n/tick", "times"),
    ("cold", "cold_us"),
    ("warm", "warm_us"),
    ("each: cold", "cold_each_us"),
    ("warm", "warm_each_us"),
    ("floor: cold", "floor_cold_us"),
    ("warm", "floor_warm_us"),
)
"""Heading of each column, and its figure."""

Figures = dict[str, float | None]


@dataclass(frozen=True)
class Budget:
    """The cost of a tick of each side.

    Args:
        cold: what `staged_tick` found after sleeps, by side.
        warm: the same without a pause.
        bare: what `bare_tick` found.
        live: the daemons in the same run.
        counts: of their system calls.
        sealed: whether the session was encrypted; otherwise the ciphers have no floor.
    """

    cold: Mapping[str, Mapping[str, Any]]
    warm: Mapping[str, Mapping[str, Any]]
    bare: Mapping[str, Any]
    live: Mapping[str, LiveSide]
    counts: KernelCounts
    sealed: bool = True

    def parts(self, side: str) -> dict[str, Figures]:
        """Each part of a tick: how often, microseconds of a tick, of each time, and of its floor each time."""
        found: dict[str, Figures] = {}
        wakes, outside = self.bare["wakes_us"], self.cold[side]["outside_us"]
        lead = wakes[LEADING] - wakes[TICKER]
        found[WAKE] = _once(wakes[EPOLL], floor=self.bare["cyclictest_us"])
        found[LEAD] = _once(lead)
        found[LOOP] = _once(outside - wakes[EPOLL] - lead, floor=wakes[UVLOOP] - wakes[EPOLL])
        cold, warm = self.cold[side]["parts"], self.warm[side]["parts"]
        for part in STAGED_PARTS:
            floor = self.sealed or part not in {DECRYPT, SEAL}
            found[part] = {
                "times": cold[part]["times"],
                "cold_us": cold[part]["us"],
                "warm_us": warm[part]["us"],
                "cold_each_us": cold[part]["each_us"],
                "warm_each_us": warm[part]["each_us"],
                "floor_cold_us": self.bare["cold_us"].get(part) if floor else None,
                "floor_warm_us": self.bare["warm_us"].get(part) if floor else None,
            }
        rest = [
            state[side]["whole_us"] - sum(state[side]["parts"][part]["us"] for part in STAGED_PARTS if part in WORK)
            for state in (self.cold, self.warm)
        ]
        found[SIDE_LOOP] = _once(rest[0], warm=rest[1])
        return found

    def sum_us(self, side: str, state: str = "cold_us", parts: tuple[str, ...] = PARTS) -> float:
        """Sum of some parts, with caches as `state` says: all of them, for the CPU time of a tick [us]."""
        of_side = self.parts(side)
        return sum(of_side[part][state] or 0.0 for part in parts)

    def of_daemon(self, side: str) -> dict[str, Any]:
        """The live daemon beside the sums."""
        live = self.live[side]
        work = live.records["work_us"].astype(float)
        mean, cpu_us = chunk_median(work.tolist()), live.cpu_s / live.ticks * 1e6
        return {
            "work_p50_us": summary(work)["p50"],
            "work_us": mean,
            "work_gap_us": mean - self.sum_us(side, parts=WORK),
            "cpu_us_per_tick": cpu_us,
            "cpu_gap_us": cpu_us - self.sum_us(side),
            "system_calls": self.counts.calls(side),
            "calls": self.counts.named(side),
            "cache_misses": self.counts.misses(side),
        }

    def as_json(self) -> dict[str, Any]:
        return {
            "rate_hz": MAIN_RATE_HZ,
            "sides": {
                side: {
                    "parts": self.parts(side),
                    "sum_us": {"cold": self.sum_us(side), "warm": self.sum_us(side, "warm_us")},
                    "work_us": {
                        "cold": self.sum_us(side, parts=WORK),
                        "warm": self.sum_us(side, "warm_us", WORK),
                    },
                    "live": self.of_daemon(side),
                    "ticks": self.cold[side]["ticks"],
                    "datagram_bytes": self.cold[side]["datagram_bytes"],
                }
                for side in SIDES
            },
            "wakes_us": {**self.bare["wakes_us"], "cyclictest": self.bare["cyclictest_us"]},
            "not_counted": self.counts.complaint,
        }


def _once(cold: float, *, warm: float | None = None, floor: float | None = None) -> Figures:
    """A part that runs once in a tick."""
    return {
        "times": 1.0,
        "cold_us": cold,
        "warm_us": warm,
        "cold_each_us": cold,
        "warm_each_us": warm,
        "floor_cold_us": floor,
        "floor_warm_us": None,
    }


def measure(arrangement: Arrangement, rights: Rights) -> Budget:
    """Measure the parts, their floors, and the live daemons.

    Raises:
        BenchError: if a process fails.
        ConfigurationError: if the file or an override is wrong.
    """
    duration_s = LIVE_SHARE * arrangement.duration_s
    ticks = max(400, round(MAIN_RATE_HZ * duration_s))

    def order() -> dict[str, Any]:
        overrides = arrangement.overrides(MAIN_RATE_HZ)
        arrangement.configuration(overrides)
        return {"file": str(arrangement.file), "overrides": overrides, "ticks": ticks}

    limit_s = 4.0 * duration_s + PATIENCE_S
    common = order()
    cold = cold_sides(common, rights)
    counted: list[KernelCounts] = []

    def counts(daemons: Mapping[str, Daemon]) -> None:
        pids = {side: daemon.pid for side, daemon in daemons.items()}
        counted.append(count(pids, min(COUNT_S, duration_s), MAIN_RATE_HZ))

    live = live_run(arrangement, MAIN_RATE_HZ, duration_s, counts)
    with child("staged_tick", order(), rights) as process:
        warm = answers([process], limit_s, "the staged ticks without a pause")[0]
    lengths = [found["datagram_bytes"] for found in cold.values() if found["datagram_bytes"]]
    bare_order = {
        "rate_hz": MAIN_RATE_HZ,
        "ticks": ticks // 4,
        "size": round(max(lengths, default=SIZE)),
        "record": cold[SLAVE]["record"],
    }
    with child("bare_tick", bare_order, rights) as process:
        bare = answers([process], limit_s, "the bare tick")[0]
    sealed = arrangement.configuration(common["overrides"]).system.link.security != "none"
    return Budget(cold, warm, bare, live, counted[0], sealed)


def tables(document: Mapping[str, Any]) -> Group:
    """The tables of `Budget.as_json`, in 80 columns."""
    found = [part for side, of_side in document["sides"].items() for part in (_table(side, of_side), "")]
    return Group(*found, Text("\n".join(_lines(document))))


def _table(side: str, found: Mapping[str, Any]) -> Table:
    table = plain_table(f"{side}, us", *(heading for heading, _ in COLUMNS))
    for part, figures in found["parts"].items():
        table.add_row(part, *(_number(figures[key], places=2 if key == "times" else 1) for _, key in COLUMNS))
    table.add_section()
    for words, key in (("sum, CPU", "sum_us"), ("sum, work", "work_us")):
        table.add_row(words, "", _number(found[key]["cold"]), _number(found[key]["warm"]))
    live = found["live"]
    for words, key in (
        ("live CPU", "cpu_us_per_tick"),
        ("  beyond sum", "cpu_gap_us"),
        ("live work", "work_us"),
        ("  beyond sum", "work_gap_us"),
        ("live work p50", "work_p50_us"),
    ):
        table.add_row(words, "", _number(live[key]))
    return table


def _lines(document: Mapping[str, Any]) -> Iterator[str]:
    if document["not_counted"]:
        yield f"system calls and cache misses: {document['not_counted']}"
    else:
        for side, found in document["sides"].items():
            live = found["live"]
            named = ", ".join(f"{name} {value:.2f}" for name, value in live["calls"].items() if value >= 0.005)
            yield f"system calls of a live tick, {side}: {_number(live['system_calls'])} ({named})"
            misses = live["cache_misses"]
            yield f"cache misses of a live tick, {side}: " + (
                "not counted by this machine" if misses is None else f"{misses:.0f}"
            )
    wakes = ", ".join(f"{name} {_number(value)}" for name, value in document["wakes_us"].items())
    yield f"CPU time of a bare wake-up, us: {wakes}"


def _number(value: float | None, *, places: int = 1) -> str:
    return "-" if value is None else f"{value:.{places}f}" if abs(value) < 1000.0 else f"{value:.0f}"
