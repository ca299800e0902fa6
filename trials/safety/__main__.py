"""`python -m trials.safety --out build/safety`: run all cases and held batches; exit 1 if a law is broken."""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from time import monotonic

import pandas as pd

from trials.safety import held
from trials.safety.run import every, run
from weberlink_figures.environment import environment, footer

WORST = {
    "round_trip_ms": "agreed round trip [ms]",
    "robot_ms": "robot stops [ms]",
    "force_ms": "hand free [ms]",
    "robot_age_ms": "robot moved at loop age [ms]",
    "force_age_ms": "force at loop age [ms]",
    "beyond_mm": "beyond the hand [mm]",
    "hand_n": "on the hand [N]",
    "robot_n": "robot [N]",
    "step_n": "step [N]",
}
"""Figures of which each row has the largest."""
TABLES = (["one way", "fault of the link"], ["fault of the link", "scheme"], ["force", "position"])
"""By what runs are grouped."""


def markdown(frame: pd.DataFrame) -> str:
    lines = [frame.columns, ["---"] * len(frame.columns), *frame.itertuples(index=False)]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


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
    facts = environment()
    told = {"runs": [each.to_dict() for each in runs], "held": [asdict(row) for row in rows], "environment": facts}
    frame, of_held = pd.DataFrame(told["runs"]), pd.DataFrame(told["held"])
    frame["one way"] = [
        " and ".join(f"{1e3 * each:g} ms" for each in dict.fromkeys(delay)) for delay in frame["delay_s"]
    ]
    frame["broke a law"] = frame["violations"].map(bool).astype(int)
    frame = frame.rename(columns={"fault": "fault of the link"})
    broken, too_old = [each for each in runs if each.violations], int(of_held["too_old"].sum())
    text = f"# Safety runs\n\n{len(runs)} runs in virtual time; {len(broken)} broke a law. The worst of each group:\n"
    for keys in TABLES:
        groups = frame.groupby(keys, sort=False)
        worst = groups[list(WORST)].max().round(2).rename(columns=WORST).join(groups["broke a law"].sum())
        text += f"\n{markdown(worst.reset_index())}"
    text += (
        f"\nHeld datagrams: {too_old} updates were executed that were older, when they arrived, than the silence limit "
        f"and the agreed round trip together.\n\n{markdown(of_held)}\n{footer(facts, 1)}\n"
    )
    sys.stdout.write(f"{text}{monotonic() - began:.0f} s\n")
    sys.stdout.writelines(f"BROKEN {each.case}: {'; '.join(each.violations)}\n" for each in broken)
    if chosen.out is not None:
        chosen.out.with_suffix(".md").write_text(text, encoding="utf-8")
        chosen.out.with_suffix(".json").write_text(json.dumps(told), encoding="utf-8")
    return 1 if broken or too_old else 0


if __name__ == "__main__":
    sys.exit(main())
