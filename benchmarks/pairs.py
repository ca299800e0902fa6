"""Two trees or builds of the program beside each other, measured in turn so that other load affects both alike.

    python -m benchmarks.pairs A B [--pairs 5] [--duration 6] [--json OUT]

A and B are folders that hold the package `weberlink`, such as `src` of a clone or a compiled build. Each measurement is
a process of this module with that folder first on its path; it uses only what both programs have. The interpreter and
the benchmarks are the present ones, and each tree brings its own `loopback.yaml`. The live session is that of the file;
the latency is with a key, as in `python -m benchmarks`.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.arrangement import MAIN_RATE_HZ, ROOT, Arrangement, BenchError, granted
from benchmarks.codec_speed import measure as codec_speed
from benchmarks.host import during, host, in_words, share_between, steal
from benchmarks.latency import WAYS, one_way
from benchmarks.loopback import Session
from benchmarks.percentiles import summary
from weberlink.cli.sessions import one_host
from weberlink.protocol.keys import generate
from weberlink_doctor.report import Needs
from weberlink_figures.environment import environment, footer
from weberlink_studies.result import plain_table

A, B = "A", "B"
ECHO_S = {True: 2.0, False: 10.0}
"""Of updates of every sample, and of those that the deadbands leave [s]."""
PATIENCE_S = 240.0
MEASURE = "--measure"

Figures = dict[str, float]  # what one measurement of a program found, by name with unit


def measure(duration_s: float) -> Figures:
    """Measure the program on the path of this process: start and live session, latency, codec.

    Args:
        duration_s: of the live session that counts [s].

    Raises:
        BenchError: if a part fails.
    """
    file = Path(str(files("weberlink.configs") / "loopback.yaml"))
    with Session(file, one_host(file, ())) as session:
        figures: Figures = {"start [s]": session.start_s()}
        sides = session.observe(duration_s)
        session.end()
    for name, side in sides.items():
        work, late = summary(side.records["work_us"]), summary(side.lateness_us)
        figures |= {
            f"{name} CPU [%]": 100.0 * side.cpu_s / side.elapsed_s,
            f"{name} work p50 [us]": work["p50"] or 0.0,
            f"{name} work p99 [us]": work["p99"] or 0.0,
            f"{name} lateness p99 [us]": late["p99"] or 0.0,
            f"{name} missed [%]": 100.0 * side.missed_share,
        }
    with TemporaryDirectory(prefix="weberlink-pairs-") as folder:
        key = Path(folder) / "key"
        generate(key)
        arrangement = Arrangement(file, key, (), lambda overrides: one_host(file, overrides))
        overrides = arrangement.overrides(MAIN_RATE_HZ)
        rights = granted(arrangement.configuration(overrides).system.realtime)
        order = {"file": str(file), "overrides": overrides}
        for every, duration in ECHO_S.items():
            found = one_way(order, duration, rights, every=every)
            for way in WAYS:
                updates, bare = summary(found.coded[way]), summary(found.sealed[way])
                name = f"{way}, every" if every else way
                figures |= {f"{name} {share} [us]": updates[share] or 0.0 for share in ("p50", "p99")}
                figures |= {f"{name} {share}, bare [us]": bare[share] or 0.0 for share in ("p50", "p99")}
    figures["codec [samples/s]"] = codec_speed(quick=True).live_samples_per_s
    return figures


def measured(tree: Path, duration_s: float) -> Figures:
    """The same of the program in a folder, in a process of its own.

    Raises:
        BenchError: if the folder holds no such program, or a part fails.
    """
    path = os.pathsep.join((str(tree), ROOT))
    line = [sys.executable, "-m", "benchmarks.pairs", MEASURE, str(tree), f"{duration_s:g}"]
    try:
        ended = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, check=False, timeout=duration_s + PATIENCE_S,
            env=os.environ | {"PYTHONPATH": path},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise BenchError(f"{tree}: its measurement did not end in time") from None
    if ended.returncode:
        raise BenchError(f"{tree}: {' '.join(ended.stderr.strip().splitlines()[-1:])}")
    figures: Figures = json.loads(ended.stdout)
    return figures


def compare(pairs: Sequence[Mapping[str, Figures]]) -> list[dict[str, Any]]:
    """Median of each figure of both programs, and the ratio B/A: its median, smallest and largest over the pairs."""
    rows = []
    for name in pairs[0][A]:
        ratios = [pair[B][name] / pair[A][name] for pair in pairs if pair[A][name]]
        rows.append(
            {
                "name": name,
                "a": median(pair[A][name] for pair in pairs),
                "b": median(pair[B][name] for pair in pairs),
                "ratio": median(ratios) if ratios else None,
                "least": min(ratios, default=None),
                "most": max(ratios, default=None),
            }
        )
    return rows


def table(rows: Sequence[Mapping[str, Any]]) -> Table:
    printed = plain_table("median over the pairs", A, B, "B / A", "least", "most")
    for row in rows:
        printed.add_row(Text(row["name"]), *(_number(row[key]) for key in ("a", "b", "ratio", "least", "most")))
    return printed


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if abs(value) < 1e3 else f"{value:.0f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("trees", nargs=2, type=Path, metavar="FOLDER", help="that holds the package weberlink")
    parser.add_argument("--pairs", type=int, default=5, metavar="N", help="how often each program is measured")
    parser.add_argument("--duration", type=float, default=6.0, metavar="S", help="of a live session [s]")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write every measurement")
    asked = parser.parse_args()
    if asked.pairs < 1 or not asked.duration >= 1.0:
        parser.error("--pairs must be at least 1, --duration at least 1 s")
    trees = dict(zip((A, B), (tree.resolve() for tree in asked.trees), strict=True))
    facts, taken = host(Needs()), steal()
    pairs: list[Mapping[str, Figures]] = []
    try:
        for number in range(asked.pairs):
            order = (A, B) if number % 2 == 0 else (B, A)
            pairs.append({name: measured(trees[name], asked.duration) for name in order})
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{number + 1} of {asked.pairs} pairs" + "\n" * (number + 1 == asked.pairs))
    except BenchError as error:
        sys.stderr.write(f"pairs: {error}\n")
        return 1
    rows, share = compare(pairs), share_between(taken, steal())
    console = Console()
    console.print(table(rows))
    console.print(*(f"{name}: {tree}" for name, tree in trees.items()), sep="\n", soft_wrap=True, highlight=False)
    console.print(f"{in_words(facts)}; {during(share)}\n{footer(environment())}", style="dim", highlight=False)
    if asked.json is not None:
        document = {
            "kind": "weberlink pairs",
            "trees": {name: str(tree) for name, tree in trees.items()},
            "duration_s": asked.duration,
            "compared": rows,
            "pairs": pairs,
            "host": facts,
            "steal_share": share,
            "environment": environment(),
        }
        asked.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 0


def _measure(tree: Path, duration_s: float) -> int:
    """The process that measures the program in a folder."""
    import weberlink  # noqa: PLC0415

    if not Path(weberlink.__file__).is_relative_to(tree):
        sys.stderr.write(f"holds no package weberlink; found {weberlink.__file__} instead\n")
        return 1
    try:
        sys.stdout.write(json.dumps(measure(duration_s)))
    except BenchError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(_measure(Path(sys.argv[2]), float(sys.argv[3])) if sys.argv[1:2] == [MEASURE] else main())
