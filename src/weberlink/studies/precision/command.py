"""The `precision` command: error against run time, as a document, tables and figures. One section per study."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rich.table import Table

from weberlink.master.trace import Trace, read_trace
from weberlink.studies.precision.coding_precision import RECOMMENDED, CodingStudy, study
from weberlink.system.configuration import load
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need
from weberlink.system.simulate import simulate

SCENES = ("loopback", "scene-plane", "scene-sphere", "scene-cavity", "scene-height-field")
"""Shipped configurations whose simulated signals are coded."""
SIGNAL_S = 6.0
FULL_SIGNAL_S = 60.0
"""How much of each [s]."""

Progress = Callable[[str, int, int], None]
"""Told what comes next, how much is done, and of how much."""


@dataclass(frozen=True)
class Section:
    """One study: its part of the document, its table, and how its figures are drawn into a folder."""

    name: str
    document: Any
    table: Table
    draw: Callable[[Path], None]


@dataclass(frozen=True)
class Precision:
    """The sections, and how they are shown."""

    sections: list[Section]
    facts: dict[str, Any]

    @property
    def document(self) -> dict[str, Any]:
        return {**{section.name: section.document for section in self.sections}, "environment": self.facts}

    @property
    def table(self) -> Table:
        whole = Table.grid()
        for section in self.sections:
            whole.add_row(section.table)
            whole.add_row("")
        whole.add_row(footer(self.facts))
        return whole

    def draw(self, folder: Path) -> None:
        """Write the figures.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        folder.mkdir(parents=True, exist_ok=True)
        for section in self.sections:
            section.draw(folder)


def run(*, full: bool, plots: bool, progress: Progress = lambda *_: None) -> Precision:
    """Measure everything.

    Args:
        full: finer steps and more repeats: minutes instead of half a minute.
        plots: whether figures will be wanted.
        progress: called before each problem.

    Raises:
        ConfigurationError: where a package is missing; nothing was computed then.
    """
    need("scipy", "precision", "the reference solutions")
    if plots:
        need("matplotlib", "plots", "--plots")
    facts = environment()
    caption = footer(facts)
    signal = FULL_SIGNAL_S if full else SIGNAL_S
    return Precision([integrators(full, caption, progress), codec(SCENES, signal, caption, progress)], facts)


def integrators(full: bool, caption: str, progress: Progress) -> Section:
    """The integrators of the simulated robot on problems with known solutions."""
    from weberlink.studies.precision.choice import automatic  # noqa: PLC0415 - scipy
    from weberlink.studies.precision.study import DEFAULT, FULL  # noqa: PLC0415
    from weberlink.studies.precision.study import study as work_precision_study  # noqa: PLC0415
    from weberlink.studies.precision.tables import summary  # noqa: PLC0415

    effort = FULL if full else DEFAULT
    results = work_precision_study(effort, chooser=automatic, progress=progress)

    def draw(folder: Path) -> None:
        from weberlink.studies.precision.figures import work_precision  # noqa: PLC0415 - heavy, and only wanted with --plots

        work_precision(results, folder / "work_precision.png", caption)

    document = {
        "finest_substeps_per_tick": effort.finest,
        "repeats_most": effort.repeats,
        "problems": [result.as_json() for result in results],
    }
    return Section("integrators", document, summary(results), draw)


def codec(scenes: Sequence[str], duration: float, caption: str, progress: Progress) -> Section:
    """The predictors of the force channel on the shipped recording and on simulated signals, over Weber factors.

    Args:
        scenes: names of shipped configurations.
        duration: of each of their signals [s].
        caption: of the figure.
        progress: called before each signal.
    """
    traces = {"operator": read_trace(Path(str(files("weberlink.configs") / "traces" / "operator.csv")))}
    for done, name in enumerate(scenes):
        progress(f"signal of {name}", done, len(scenes))
        traces[name] = _signal(name, duration)
    progress("coding", len(scenes), len(scenes))
    coded = study(traces)

    def draw(folder: Path) -> None:
        coded.draw(folder / "coding.png", caption)

    return Section(
        "codec",
        coded.as_json() | {"signal_s": {name: _length(t) for name, t in traces.items()}},
        _coding_table(coded),
        draw,
    )


def _signal(name: str, duration: float) -> Trace:
    """What a robot is commanded and feels in a shipped configuration, in virtual time."""
    _, recorder = simulate(load(Path(str(files("weberlink.configs") / f"{name}.yaml"))), duration)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.csv"
        recorder.save(path)
        return read_trace(path)


def _length(trace: Trace) -> float:
    return float(trace.time_s[-1] - trace.time_s[0])


def _coding_table(coded: CodingStudy) -> Table:
    """All signals together, at the recommended Weber factor, and where the recommended predictor stands."""
    verdicts = coded.verdicts()
    beaten = [verdict.trace for verdict in verdicts if not verdict.on_front]
    place = "on the Pareto front of every signal" if not beaten else f"off the Pareto front of {', '.join(beaten)}"
    table = Table(
        box=None, pad_edge=False, padding=(0, 2, 0, 0), title_justify="left", caption_justify="left",
        title=f"codec at k = {RECOMMENDED[1]:g}, {len(verdicts) - 1} signals together, felt a tick late",
        caption=f"{RECOMMENDED[0]} is {place}",
    )  # fmt: skip
    for name in ("predictor", "packets/s", "RMS N", "max N", "outside", "us/tick", "on the front"):
        table.add_column(name, justify="left" if name == "predictor" else "right", no_wrap=True)
    for row in coded.pooled:
        if row.weber == RECOMMENDED[1]:
            table.add_row(
                row.predictor, f"{row.packets_per_s:.1f}", f"{row.error_rms_n:.3f}", f"{row.error_max_n:.2f}",
                f"{100 * row.violation_fraction:.1f} %", f"{row.tick_us:.1f}", "yes" if row.pareto_at_weber else "no",
            )  # fmt: skip
    return table
