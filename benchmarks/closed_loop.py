"""Prediction in closed loop: sessions of every scene, delay, control scheme and coding, and `adaptive` over `hybrid`.

A better prediction of a recording need not be one in closed loop, because the hand yields to the force it feels. A cell
is one session: a simulated hand follows the script of the file; its tremor has a seed.

    python -m benchmarks.closed_loop --json OUT.json                        the whole matrix, in virtual time
    python -m benchmarks.closed_loop --scenes loopback --delays 0 --live    live, one session after another

A coding is `FORCE`, or `FORCE+L` with a look-ahead of L ms, or either with `/POSITION` to name the predictor of the
position too. Cells are compared by the mean over the seeds. The exit status is 1 if a session fails.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.sessions import CONFIGS, weberlink
from weberlink.studies.parallel import parallel_map
from weberlink.studies.result import plain_table
from weberlink.system.configuration import SIDES, ConfigurationError, load
from weberlink.system.environment import environment, footer
from weberlink.system.simulate import simulate

SCENES = (
    "loopback", "scene-plane", "scene-sphere", "scene-height-field", "scene-box", "scene-moving", "adaptive",
    "stiff-wall",
)  # fmt: skip
"""Files of `configs/`; in `adaptive` there is friction."""
DELAYS_MS = (0.0, 20.0, 100.0)
SCHEMES = ("none", "bounded")
CODINGS = ("hybrid", "adaptive", "hybrid+10", "adaptive+10")
MOST = 1.05
"""Largest ratio of `adaptive` to `hybrid`, of packets and of what is felt."""
SLACK = {"packets_per_s": 1.0, "error_rms_jnd": 0.05, "jump_max_jnd": 1.0}
"""A figure is worse only if it is above by this much too: packets/s, and JND."""
WIDTH = 110


@dataclass(frozen=True)
class Cell:
    """One session.

    Args:
        scene: file of `configs/`, without the ending.
        delay_ms: one way.
        scheme: of the control.
        coding: as on the command line.
        seed: of tremor and link.
        seconds: duration.
        live: two processes and a socket; otherwise virtual time.
    """

    scene: str
    delay_ms: float
    scheme: str
    coding: str
    seed: int
    seconds: float
    live: bool

    @property
    def overrides(self) -> list[str]:
        """For `--set`. The link is silent only after 2.5 round trips, as older commands are never executed."""
        coding, _, position = self.coding.partition("/")
        force, _, lookahead = coding.partition("+")
        return [
            f"control.scheme={self.scheme}",
            f"link.emulate={{delay_ms: {self.delay_ms:g}, seed: {self.seed}}}",
            f"link.silence_ms={max(200.0, 5.0 * self.delay_ms):g}",
            f"master.device.seed={self.seed}",
            f"codec.force.predictor={force}",
            *([f"codec.force.lookahead_ms={lookahead}"] if lookahead else []),
            *([f"codec.position.predictor={position}"] if position else []),
        ]


@dataclass(frozen=True)
class CellResult:
    """The report of a session, or why it failed."""

    cell: Cell
    report: dict[str, Any]
    failure: str = ""

    @property
    def figures(self) -> dict[str, float]:
        """What is compared; jumps are 0 where no update changed the force."""
        report = self.report
        force, energy, link = report["force"], report["energy"], report["link"]
        ticks = [report["ticks"][side] for side in SIDES]
        return {
            "packets_per_s": force["packets_per_s"],
            "position_packets_per_s": report["position"]["packets_per_s"],
            "datagrams_per_s": link["sent"] / report["duration_s"],
            "error_rms_jnd": force["error_rms_jnd"],
            "noticeable_fraction": force["noticeable_fraction"],
            "jump_p99_jnd": force["jump_p99_jnd"] or 0.0,
            "jump_max_jnd": force["jump_max_jnd"] or 0.0,
            "generated_j": energy["generated_j"],
            "link_generated_j": energy["link_generated_j"],
            "missed_ticks": max(each["missed"] / (each["count"] + each["missed"]) for each in ticks),
        }


def run(cell: Cell) -> CellResult:
    path = CONFIGS / f"{cell.scene}.yaml"
    try:
        if cell.live:
            sets = [part for each in cell.overrides for part in ("--set", each)]
            report = weberlink("loopback", str(path), "--duration", f"{cell.seconds:g}", *sets)
        else:
            report = simulate(load(path, cell.overrides), cell.seconds)[0]
    except (ConfigurationError, OSError, ValueError) as error:
        return CellResult(cell, {}, str(error))
    if report["outcome"] != "completed":
        return CellResult(cell, report, report["outcome"])
    return CellResult(cell, report)


Place = tuple[str, float, str]
"""Scene, delay [ms] and scheme."""
Means = dict[Place, dict[str, dict[str, float]]]
"""Figures by coding at each place: means over the seeds."""


def means(results: Iterable[CellResult]) -> Means:
    """Of the sessions that did not fail."""
    found: dict[Place, dict[str, list[dict[str, float]]]] = {}
    for each in results:
        if not each.failure:
            cell = each.cell
            codings = found.setdefault((cell.scene, cell.delay_ms, cell.scheme), {})
            codings.setdefault(cell.coding, []).append(each.figures)
    return {
        place: {
            coding: {name: fmean(one[name] for one in figures) for name in figures[0]}
            for coding, figures in codings.items()
        }
        for place, codings in found.items()
    }


@dataclass(frozen=True)
class Comparison:
    """`adaptive` with some options over `hybrid` with the same options, at one place."""

    place: Place
    options: str
    ours: dict[str, float]
    theirs: dict[str, float]

    @property
    def packets(self) -> float:
        """Ratio of the packets per second; less than one packet in the session counts as one."""
        least = 0.05
        return max(self.ours["packets_per_s"], least) / max(self.theirs["packets_per_s"], least)

    @property
    def worse(self) -> list[str]:
        """The figures in which `adaptive` is worse."""
        return [
            name
            for name, slack in SLACK.items()
            if self.ours[name] > MOST * self.theirs[name] and self.ours[name] > self.theirs[name] + slack
        ]


def comparisons(found: Means) -> Iterator[Comparison]:
    for place, codings in found.items():
        for coding, ours in codings.items():
            theirs = codings.get(coding.replace("adaptive", "hybrid", 1))
            if coding.startswith("adaptive") and theirs is not None:
                yield Comparison(place, coding.removeprefix("adaptive"), ours, theirs)


COLUMNS: dict[str, tuple[str, Callable[[float], str]]] = {
    "force/s": ("packets_per_s", lambda one: f"{one:.1f}"),
    "pos/s": ("position_packets_per_s", lambda one: f"{one:.1f}"),
    "all/s": ("datagrams_per_s", lambda one: f"{one:.0f}"),
    "felt": ("error_rms_jnd", lambda one: f"{one:.2f}"),
    "notic.": ("noticeable_fraction", lambda one: f"{100 * one:.1f}%"),
    "p99": ("jump_p99_jnd", lambda one: f"{one:.1f}"),
    "jump": ("jump_max_jnd", lambda one: f"{one:.1f}"),
    "mJ": ("generated_j", lambda one: f"{1000 * one:.0f}"),
    "missed": ("missed_ticks", lambda one: f"{100 * one:.1f}%"),
}


def table(found: Means) -> Table:
    printed = plain_table(
        "scene", "ms", "scheme", "coding", *COLUMNS, left=("scheme", "coding"), padding=(0, 1, 0, 0),
        caption="updates and datagrams per second; RMS of the felt error (JND); ticks with an error above one JND; "
        "99th percentile and largest of the jumps (JND); energy created at the operator (mJ); missed ticks",
    )  # fmt: skip
    for (scene, delay, scheme), codings in found.items():
        for coding, figures in codings.items():
            cells = (form(figures[name]) for name, form in COLUMNS.values())
            printed.add_row(scene, f"{delay:g}", scheme, coding, *cells)
    return printed


def verdict(compared: Sequence[Comparison]) -> Table:
    """The cells in which `adaptive` is worse than the hybrid."""
    bad = [each for each in compared if each.worse]
    rule = ", ".join(f"{name} {slack:g}" for name, slack in SLACK.items())
    printed = plain_table(
        "adaptive over hybrid", "ms", "scheme", "options", "packets", "felt", "jump", "worse in", padding=(0, 1, 0, 0),
        left=("scheme", "options", "worse in"),
        title=f"{len(compared) - len(bad)} of {len(compared)} cells are not worse",
        caption=f"worse: above {MOST:g} of the hybrid, and by more than {rule}",
    )  # fmt: skip
    for each in bad:
        pairs = [f"{each.theirs[name]:.2f} > {each.ours[name]:.2f}" for name in SLACK]
        scene, delay, scheme = each.place
        printed.add_row(
            scene, f"{delay:g}", scheme, each.options, *pairs, " ".join(name.split("_")[0] for name in each.worse)
        )
    return printed


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=SCENES, metavar="FILE", help="of configs/, without the ending")
    parser.add_argument("--delays", nargs="+", type=float, default=DELAYS_MS, metavar="MS", help="one way")
    parser.add_argument("--schemes", nargs="+", default=SCHEMES, metavar="SCHEME")
    parser.add_argument("--codings", nargs="+", default=CODINGS, metavar="CODING")
    parser.add_argument("--seeds", nargs="+", type=int, default=(1, 2), metavar="N")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each session")
    parser.add_argument("--workers", type=int, help="processes; one per processor unless given")
    parser.add_argument("--live", action="store_true", help="two processes and a socket, one session after another")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all reports")
    asked = parser.parse_args()
    cells = [
        Cell(scene, delay, scheme, coding, seed, asked.seconds, asked.live)
        for seed, delay, scheme, scene, coding in product(
            asked.seeds, asked.delays, asked.schemes, asked.scenes, asked.codings
        )
    ]

    def progress(done: int, total: int) -> None:
        if sys.stderr.isatty() or done == total:
            sys.stderr.write(f"\r{done} of {total} sessions" + "\n" * (done == total))

    results = list(parallel_map(run, cells, 1 if asked.live else asked.workers, progress=progress).values())
    facts = environment()
    if asked.json is not None:
        rows = [{**asdict(each.cell), "failure": each.failure, "report": each.report} for each in results]
        asked.json.write_text(json.dumps({"environment": facts, "rows": rows}, indent=1, default=str) + "\n")
    if len(results) < len(cells):  # means of a part would not be comparable
        raise KeyboardInterrupt
    found = means(results)
    console = Console(width=WIDTH)
    console.print(table(found))
    compared = list(comparisons(found))
    if compared:
        console.print("", verdict(compared), sep="\n")
    failed = [each for each in results if each.failure]
    for each in failed:
        console.print(f"FAILED {each.cell}: {each.failure}")
    console.print(footer(facts))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
