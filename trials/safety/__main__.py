"""`python -m trials.safety --out build/safety`: run all cases and held batches; exit 1 if a law is broken."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from time import monotonic

from trials.safety import held
from trials.safety.held import Held
from trials.safety.run import Run, every, run
from weberlink.figures.environment import environment, footer

COLUMNS = {
    "agreed round trip": ("round_trip_ms", "{:.0f} ms"),
    "robot stops": ("robot_ms", "{:.0f} ms"),
    "hand free": ("force_ms", "{:.0f} ms"),
    "robot moved at loop age": ("robot_age_ms", "{:.0f} ms"),
    "force at loop age": ("force_age_ms", "{:.0f} ms"),
    "beyond the hand": ("beyond_mm", "{:.1f} mm"),
    "on the hand": ("hand_n", "{:.1f} N"),
    "robot": ("robot_n", "{:.1f} N"),
    "step": ("step_n", "{:.2f} N"),
}
"""The worst of each row: heading, figure, format."""
Key = Callable[[Run], tuple[str, str]]
TABLES: dict[str, tuple[Callable[[Run], bool], Key]] = {
    "one way | fault of the link": (
        lambda run: not run.case.flap_hz,
        lambda run: (" and ".join(f"{1e3 * each:g} ms" for each in dict.fromkeys(run.case.delay_s)), run.case.fault),
    ),
    "fault of the link | control": (lambda _: True, lambda run: (run.case.fault, run.case.scheme)),
    "force | position": (lambda _: True, lambda run: (run.case.force, run.case.position)),
}
"""Which runs, and by what they are grouped."""


def table(heads: str, runs: Iterable[Run], key: Key) -> list[str]:
    groups: dict[tuple[str, str], list[Run]] = {}
    for each in runs:
        groups.setdefault(key(each), []).append(each)
    lines = [f"| {heads} | {' | '.join(COLUMNS)} | faults of master, slave | broke a law |"]
    lines.append("|---|---|" + "---:|" * len(COLUMNS) + "---|---:|")
    for (first, second), group in groups.items():
        figures = [each.figures for each in group if each.figures is not None]
        values = [
            [value for each in figures if (value := getattr(each, name)) is not None] for name, _ in COLUMNS.values()
        ]
        cells = [form.format(max(v)) if v else "-" for v, (_, form) in zip(values, COLUMNS.values(), strict=True)]
        named = ({name.lower() for each in figures for name in each.faults[side] or ("none",)} for side in (0, 1))
        faults = ", ".join("/".join(sorted(names)) for names in named)
        broken = sum(bool(each.violations) for each in group)
        lines.append(f"| {first} | {second} | {' | '.join(cells)} | {faults} | {broken} of {len(group)} |")
    return lines


def of_held(rows: Sequence[Held]) -> list[str]:
    """Executed updates that were too old, by age and direction; the last rows are of links that are always slow."""
    modes = sorted({(row.direction, row.mode) for row in rows if row.mode != held.ALWAYS})
    found = {(row.direction, row.mode, row.age_s): f"{row.too_old} of {row.held}" for row in rows}
    lines = [f"| age | {' | '.join(f'{way}, {mode}' for way, mode in modes)} |", "|---:|" + "---:|" * len(modes)]
    lines += [
        f"| {age:.3f} s | {' | '.join(found.get((*where, age), '-') for where in modes)} |"
        for age in sorted({row.age_s for row in rows if row.mode != held.ALWAYS})
    ]
    return lines + [
        f"| always {1e3 * row.age_s:.0f} ms {row.direction} | {row.too_old} of {row.executed} |"
        + " |" * (len(modes) - 1)
        for row in rows
        if row.mode == held.ALWAYS
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--every", type=int, default=1, metavar="N", help="one case in so many")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, metavar="STEM", help="write STEM.md and STEM.json")
    chosen = parser.parse_args()
    began = monotonic()
    with ProcessPoolExecutor(chosen.workers) as pool:
        batches = held.EVERY[:: -chosen.every]  # the oldest take longest
        long_ones = pool.map(held.hold, *zip(*batches, strict=True))
        delayed = pool.map(held.delay, *zip(*held.DELAYS_S, strict=True))
        runs = list(pool.map(run, list(every())[:: chosen.every], chunksize=8))
        rows = [*list(long_ones)[::-1], *delayed]
    broken, too_old = [each for each in runs if each.violations], sum(row.too_old for row in rows)
    facts = environment()
    lines = ["# Safety runs", "", f"{len(runs)} runs in virtual time; {len(broken)} broke a law.", ""]
    for heads, (is_shown, key) in TABLES.items():
        lines += [*table(heads, filter(is_shown, runs), key), ""]
    lines += [
        f"Held datagrams: {too_old} updates were executed that were older, when they arrived, than the silence limit "
        "and the agreed round trip together.",
        *("", *of_held(rows), "", footer(facts, 1), ""),
    ]
    text = "\n".join(lines)
    sys.stdout.write(f"{text}{monotonic() - began:.0f} s\n")
    sys.stdout.writelines(f"BROKEN {each.case}: {'; '.join(each.violations)}\n" for each in broken)
    if chosen.out is not None:
        told = {"runs": [each.to_dict() for each in runs], "held": [asdict(row) for row in rows], "environment": facts}
        chosen.out.with_suffix(".md").write_text(text, encoding="utf-8")
        chosen.out.with_suffix(".json").write_text(json.dumps(told), encoding="utf-8")
    return 1 if broken or too_old else 0


if __name__ == "__main__":
    sys.exit(main())
