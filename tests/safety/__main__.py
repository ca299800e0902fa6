"""`python -m tests.safety --out build/safety`: run all cases and held batches; exit 1 if a law is broken."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import monotonic

from tests.safety import cases, held
from tests.safety.run import run
from tests.safety.tables import by_delay, by_fault, by_predictor, of_held
from weberlink.system.environment import environment, footer


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="cuts alone, with three pairs of predictors")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, metavar="STEM", help="write STEM.md and STEM.json")
    chosen = parser.parse_args(arguments)
    began = monotonic()
    wanted = list(cases.quick() if chosen.quick else cases.every())
    batches = held.every()
    with ProcessPoolExecutor(chosen.workers) as pool:
        long_ones = pool.map(held.hold, *zip(*batches[::-1], strict=True))  # the oldest take longest
        delayed = pool.map(held.delay, *zip(*held.DELAYS_S, strict=True))
        runs = list(pool.map(run, wanted, chunksize=8))
        rows = [*list(long_ones)[::-1], *delayed]
    broken = [each for each in runs if each.violations]
    too_old = sum(row.too_old for row in rows)
    facts = environment()
    text = "\n".join(
        [
            "# Safety runs",
            "",
            f"{len(runs)} runs in virtual time; {len(broken)} broke a law.",
            "",
            *by_delay(runs),
            "",
            *by_fault(runs),
            "",
            *by_predictor(runs),
            "",
            f"Held datagrams: {too_old} updates were executed that were older, when they arrived, than the silence "
            "limit and the agreed round trip together.",
            "",
            *of_held(rows),
            "",
            f"{footer(facts, 1)}",
            "",
        ]
    )
    sys.stdout.write(f"{text}{monotonic() - began:.0f} s\n")
    if chosen.out is not None:
        told = {
            "runs": [each.to_dict() for each in runs],
            "held": [row.to_dict() for row in rows],
            "environment": facts,
        }
        chosen.out.with_suffix(".md").write_text(text, encoding="utf-8")
        chosen.out.with_suffix(".json").write_text(json.dumps(told), encoding="utf-8")
    return 1 if broken or too_old else 0


if __name__ == "__main__":
    sys.exit(main())
