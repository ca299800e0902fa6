"""Sessions in virtual time over links that lose: what is felt and what is sent, by the present scheme and the former.

The felt violation is the share of ticks in which the displayed force is not within the deadband of the force that is
measured at the same time, as every report says it. The former scheme, of protocol 3, repeated an update at most six
times a second before there was evidence of its loss, whatever the bursts, and sent no heartbeats densely; it exists
here only, for the comparison in one run.

    python -m benchmarks.bad_links                             the table
    python -m benchmarks.bad_links --json FILE                 also every figure
    python -m benchmarks.bad_links --losses 0 0.1 --seeds 5    some rows, with more seeds
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from itertools import product
from math import inf
from pathlib import Path
from statistics import mean
from typing import Any

from weberlink.compiled import is_compiled
from weberlink.protocol import sending
from weberlink.protocol.heartbeat import (
    ASK_PACE,
    CHANCE_FADES_PER_S,
    CHANCE_STOPS_PER_S,
    FALSE_ALARMS_PER_S,
    LATE_TICKS,
    LEAST_QUESTIONS,
    LEAST_SHARE,
    LONGEST_REACH,
    ROUND_TRIP_SHARE,
    HeartbeatSchedule,
    questions_needed,
)
from weberlink.protocol.liveness import UNITS
from weberlink.protocol.retransmission import Allowance, copies_needed
from weberlink.system.configuration import load
from weberlink.system.environment import environment, footer
from weberlink.system.scoring.session import score_of
from weberlink.system.simulate import build_simulation

CONFIGS = Path(__file__).parents[1] / "configs"
SESSIONS = {"loopback": ("loopback.yaml", ("control.scheme=none",)), "replay": ("replay.yaml", ())}
"""`loopback` was used to choose the constants of the scheme, `replay` was not."""
LOSSES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)
BURSTS = (1.0, 3.0)
DELAYS_MS = (20.0, 80.0)
FORMER, PRESENT = "former", "present"
FORMER_COPIES = 3


@dataclass(frozen=True)
class Cell:
    """One link and scheme; `silence_ms` is the limit, `burst` the mean length of a run of losses."""

    session: str
    delay_ms: float
    silence_ms: float
    loss: float
    burst: float
    scheme: str
    seed: int
    seconds: float


class FormerAllowance(Allowance):
    """Six early repeats a second, whatever the loss."""

    def adapt(self, lost: int, sent: int, late: float, now: float) -> None:
        pass


def former_copies(loss: float, burst: float = 0.0) -> int:  # noqa: ARG001
    """Copies of an update where losses count as independent."""
    return min(FORMER_COPIES, copies_needed(loss))


class FormerSchedule(HeartbeatSchedule):
    """Heartbeats that leave room for questions only, and never go out more often than ten in a silence limit."""

    def adapt(self, outgoing: float, incoming: float, rtt: float, jitter: float) -> None:
        path = (0.0 if rtt == inf else rtt) + jitter
        late = LATE_TICKS * self._tick_period
        overhead = path + late + self._silence / UNITS
        unanswered = 1.0 - (1.0 - outgoing) * (1.0 - incoming)
        shortest = LEAST_SHARE * self._silence
        reach = max(2.0 * shortest, min(LONGEST_REACH, self._fade - overhead))
        for limit, rate, least in (
            (self._fade, CHANCE_FADES_PER_S, 0),
            (self._silence, FALSE_ALARMS_PER_S, LEAST_QUESTIONS),
        ):
            questions = max(least, questions_needed(unanswered, rate * shortest))
            asking = questions * (ASK_PACE + self._tick_period) + (path if questions else 0.0)
            reach = min(reach, limit - overhead - asking)
        self.reach = max(2.0 * shortest, reach)
        self.interval = 0.5 * self.reach
        stops = min(1.0, CHANCE_STOPS_PER_S * self.interval)
        datagrams = 1 + questions_needed(outgoing, stops)
        self.gap = max(shortest, min(self.reach, (self._horizon - jitter - late) / datagrams))
        self._ask_after = self.reach + overhead
        self._answered_in = rtt + jitter + 2.0 * self._tick_period
        self._due_engaged = None


@contextmanager
def scheme(name: str) -> Iterator[None]:
    """Sessions that are made within repeat by the scheme of that name."""
    parts = {"Allowance": FormerAllowance, "copies_needed": former_copies, "HeartbeatSchedule": FormerSchedule}
    present = {part: getattr(sending, part) for part in parts}
    try:
        for part, former in parts.items() if name == FORMER else ():
            setattr(sending, part, former)
        yield
    finally:
        for part, own in present.items():
            setattr(sending, part, own)


def run(cell: Cell) -> dict[str, Any]:
    """Figures of one session: the felt violation, and by second what both ends sent together."""
    file, overrides = SESSIONS[cell.session]
    link = f"delay_ms: {cell.delay_ms}, loss: {cell.loss}, burst: {cell.burst}, seed: {cell.seed}"
    overrides = (*overrides, f"link.emulate={{{link}}}", f"link.silence_ms={cell.silence_ms}")
    configuration = load(CONFIGS / file, overrides)
    with scheme(cell.scheme):
        simulation = build_simulation(configuration)
        score = score_of(configuration.system)
        try:
            simulation.run(cell.seconds, [score])
        finally:
            simulation.close()
    summary = score.summary()
    ends = [side.endpoint.statistics for side in (simulation.master, simulation.slave)]
    duration = summary["duration_s"]
    return asdict(cell) | {
        "violation": summary["force"]["violation_fraction"],
        "updates_per_s": sum(sum(end.updates_sent) for end in ends) / duration,
        "repeats_per_s": sum(end.repeats for end in ends) / duration,
        "heartbeats_per_s": sum(end.heartbeats for end in ends) / duration,
        "datagrams_per_s": sum(end.sent for end in ends) / duration,
        "bytes_per_s": sum(end.bytes_sent for end in ends) / duration,
        "interruptions": summary["connection"]["master"]["interruptions"],
        "measured_burst": max(end.incoming_burst for end in ends),
    }


FIGURES = ("violation", "updates_per_s", "repeats_per_s", "datagrams_per_s", "bytes_per_s", "interruptions")


def means(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Means over the seeds, and `ratio`: the felt violation as a multiple of the lossless one of the same scheme."""
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("session", "delay_ms", "silence_ms", "loss", "burst", "scheme"))
        groups.setdefault(key, []).append(row)
    made = [group[0] | {name: mean(row[name] for row in group) for name in FIGURES} for group in groups.values()]
    lossless = {
        (row["session"], row["delay_ms"], row["silence_ms"], row["scheme"]): row["violation"]
        for row in made
        if row["loss"] == 0.0
    }
    for row in made:
        row["ratio"] = row["violation"] / lossless[row["session"], row["delay_ms"], row["silence_ms"], row["scheme"]]
    return made


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown; each figure of the former scheme, then of the present one."""
    lines = [
        "| session | one way | limit | loss | burst | felt violation | of the lossless | updates/s | repeats/s "
        "| datagrams/s | kB/s | interruptions |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    by_link: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = {}
    for row in rows:
        link = tuple(row[name] for name in ("session", "delay_ms", "silence_ms", "loss", "burst"))
        by_link.setdefault(link, {})[row["scheme"]] = row
    for (session, delay, silence, loss, burst), both in by_link.items():
        cells = [session, f"{delay:g} ms", f"{silence:g} ms", f"{100 * loss:g} %", f"{burst:g}" if loss else ""]
        for name, form, factor in (
            ("violation", "{:.1f} %", 100.0),
            ("ratio", "{:.2f}", 1.0),
            ("updates_per_s", "{:.0f}", 1.0),
            ("repeats_per_s", "{:.0f}", 1.0),
            ("datagrams_per_s", "{:.0f}", 1.0),
            ("bytes_per_s", "{:.1f}", 1e-3),
            ("interruptions", "{:.1f}", 1.0),
        ):
            cells.append(", ".join(form.format(factor * both[each][name]) for each in (FORMER, PRESENT)))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def cells(asked: argparse.Namespace) -> list[Cell]:
    made = []
    for session, delay, loss, burst, name in product(
        asked.sessions, asked.delays, sorted({0.0, *asked.losses}), BURSTS, (FORMER, PRESENT)
    ):
        if loss == 0.0 and burst != BURSTS[0]:
            continue
        silence = asked.silence or max(150.0, 2.0 * delay / ROUND_TRIP_SHARE)
        made += [
            Cell(session, delay, silence, loss, burst, name, seed, asked.seconds)
            for seed in range(1, 1 + (asked.seeds if loss else 1))
        ]
    return made


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sessions", nargs="+", choices=SESSIONS, default=["loopback"])
    parser.add_argument("--losses", nargs="+", type=float, default=LOSSES, help="0..1; 0 is always among them")
    parser.add_argument("--delays", nargs="+", type=float, default=DELAYS_MS, metavar="MS", help="each way")
    parser.add_argument("--silence", type=float, metavar="MS", help="limit; otherwise that of anywhere.yaml, or longer")
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    if is_compiled():
        parser.error("the compiled build keeps to its own scheme; run with WEBERLINK_PURE=1")
    with ProcessPoolExecutor(2) as pool:
        rows = list(pool.map(run, cells(asked)))
    shown = environment()
    sys.stdout.write(f"{table(means(rows))}\n\n{footer(shown)}\n")
    if asked.json is not None:
        asked.json.write_text(json.dumps({"environment": shown, "rows": rows}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
