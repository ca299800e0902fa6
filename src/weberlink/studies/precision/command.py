"""The `precision` command: work-precision studies of the integrators and of the codec."""

from collections.abc import Sequence
from importlib.resources import files
from itertools import count
from pathlib import Path
from typing import Any

from rich.table import Table

from weberlink.master.trace import Trace, read_trace
from weberlink.studies.evaluate.traces import SHIPPED
from weberlink.studies.precision import coding, study
from weberlink.studies.precision.coding import RECOMMENDED, CodingStudy
from weberlink.studies.precision.measurement import IntegratorRow
from weberlink.studies.precision.problems import PROBLEMS, Problem
from weberlink.studies.precision.study import (
    DEFAULT,
    FULL,
    GAINED,
    ORDER_TOLERANCE,
    ConvergenceOrder,
    ProblemResult,
    Progress,
    Recommendation,
    automatic,
)
from weberlink.studies.result import StudyResult, plain_table
from weberlink.system.configuration import load
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer
from weberlink.system.interruption import Interruption, pieces_of
from weberlink.system.simulate import simulate

SCENES = ("loopback", "scene-plane", "scene-sphere", "scene-cavity", "scene-height-field")
"""Shipped configurations whose simulated signals are coded."""
SIGNAL_S, FULL_SIGNAL_S = 6.0, 60.0
"""Length of each signal [s]."""
GOAL = 1e-3
"""Relative position error whose run time is shown."""
MISSING = "-"


Sections = dict[str, StudyResult]
"""The studies by name."""


def combined(sections: Sections, facts: dict[str, Any], interrupted: str = "") -> StudyResult:
    """All studies as one result, with the environment `facts`; and how much is done, if Ctrl-C ended them."""
    whole = Table.grid()
    for section in sections.values():
        whole.add_row(section.table)
        whole.add_row("")
    whole.add_row(footer(facts))

    def draw(folder: Path) -> None:
        for section in sections.values():
            section.draw(folder)

    document = {name: section.document for name, section in sections.items()} | {"environment": facts}
    return StudyResult(document, whole, draw, interrupted=interrupted)


def run(
    *,
    full: bool,
    plots: bool,
    progress: Progress = lambda *_: None,
    problems: Sequence[Problem] = PROBLEMS,
    scenes: Sequence[str] = SCENES,
    recorded_ticks: int | None = None,
) -> StudyResult:
    """Measure everything.

    Args:
        full: finer steps and more repeats: minutes instead of half a minute.
        plots: whether figures will be drawn.
        progress: called before each problem, each simulation of a signal, and each signal that is coded.
        problems: of the integrators.
        scenes: names of shipped configurations whose signals are coded.
        recorded_ticks: of the shipped recording; None for all.

    Raises:
        ConfigurationError: if a package is missing; nothing was computed then.
    """
    need("scipy", "precision", "the reference solutions")
    if plots:
        need("matplotlib", "plots", "--plots")
    facts = environment()
    caption = footer(facts)
    signal = FULL_SIGNAL_S if full else SIGNAL_S
    interruption = Interruption()
    first, whole = len(problems), len(problems) + codec_pieces(scenes)
    solved = integrators(full, caption, lambda done, _, what: progress(done, whole, what), interruption, problems)

    def code() -> StudyResult:
        def tell(done: int, _: int, what: str) -> None:
            progress(first + done, whole, what)

        return codec(scenes, signal, caption, tell, recorded_ticks)

    coded = list(interruption.pieces(pieces_of(code)))
    sections = {"integrators": solved} | ({"codec": coded[0]} if coded else {})
    done = len(solved.document["problems"])
    return combined(sections, facts, "" if coded else f"{done} of {len(problems)} problems, and nothing of the codec,")


def integrators(
    full: bool, caption: str, progress: Progress, interruption: Interruption, problems: Sequence[Problem] = PROBLEMS
) -> StudyResult:
    """The integrators of the simulated robot on problems with known solutions, those done when Ctrl-C came."""
    effort = FULL if full else DEFAULT
    results = study.study(effort, problems, chooser=automatic, progress=progress, interruption=interruption)

    def draw(folder: Path) -> None:
        from weberlink.studies.precision.figures import work_precision  # noqa: PLC0415 - slow import

        work_precision(results, folder / "work_precision.png", caption)

    document = {
        "finest_substeps_per_tick": effort.finest,
        "repeats_most": effort.repeats,
        "problems": [result.as_json() for result in results],
    }
    return StudyResult(document, summary(results), draw if results else None)


def codec(
    scenes: Sequence[str], duration: float, caption: str, progress: Progress, recorded_ticks: int | None = None
) -> StudyResult:
    """The predictors of the force channel on the shipped recording and on simulated signals, over Weber factors.

    Args:
        scenes: names of shipped configurations.
        duration: of each of their signals [s].
        caption: of the figure.
        progress: called before each simulation, before each signal that is coded, and at the end.
        recorded_ticks: of the shipped recording; None for all.
    """
    whole = read_trace(SHIPPED)
    part = slice(recorded_ticks)
    traces = {"operator": Trace(whole.time_s[part], whole.position_m[part], whole.force_n[part], whole.gaps_s)}
    pieces = count()

    def tell(what: str) -> None:
        progress(next(pieces), codec_pieces(scenes), what)

    for name in scenes:
        tell(f"signal of {name}")
        traces[name] = _signal(name, duration)
    coded = coding.study(traces, begin=lambda name: tell(f"coding {name}"))
    tell("done")

    def draw(folder: Path) -> None:
        from weberlink.studies.precision.figures import coding_figure  # noqa: PLC0415 - slow import

        coding_figure(coded, folder / "coding.png", caption)

    document = coded.as_json() | {"signal_s": {name: _length(t) for name, t in traces.items()}}
    return StudyResult(document, _coding_table(coded), draw)


def codec_pieces(scenes: Sequence[str]) -> int:
    """How many pieces the codec's part has: a simulation of each scene, and the coding of each and of the recording."""
    return 2 * len(scenes) + 1


def _signal(name: str, duration: float) -> Trace:
    """Commands and forces of the robot in a shipped configuration, in virtual time."""
    _, recorder = simulate(load(Path(str(files("weberlink.configs") / f"{name}.yaml"))), duration)
    return recorder.trace


def _length(trace: Trace) -> float:
    return float(trace.time_s[-1] - trace.time_s[0])


def _coding_table(coded: CodingStudy) -> Table:
    """All signals together at the recommended Weber factor."""
    verdicts = coded.verdicts()
    beaten = [verdict.trace for verdict in verdicts if not verdict.on_front]
    place = "on the Pareto front of every signal" if not beaten else f"off the Pareto front of {', '.join(beaten)}"
    table = plain_table(
        "predictor", "packets/s", "RMS N", "max N", "outside", "us/tick", "on the front",
        title=f"codec at k = {RECOMMENDED[1]:g}, {len(verdicts) - 1} signals together, felt a tick late",
        caption=f"{RECOMMENDED[0]} is {place}",
    )  # fmt: skip
    for row in coded.pooled:
        if row.weber == RECOMMENDED[1]:
            table.add_row(
                row.predictor, f"{row.packets_per_s:.1f}", f"{row.error_rms_n:.3f}", f"{row.error_max_n:.2f}",
                f"{100 * row.violation_fraction:.1f} %", f"{row.tick_us:.1f}", "yes" if row.pareto_at_weber else "no",
            )  # fmt: skip
    return table


def summary(results: Sequence[ProblemResult]) -> Table:
    """Both tables, one above the other."""
    whole = Table.grid()
    whole.add_row(_prices(results))
    whole.add_row("")
    whole.add_row(_recommendations(results))
    return whole


def _prices(results: Sequence[ProblemResult]) -> Table:
    """CPU time for an error of 0.1 % (a dash if no step reaches it), and the measured orders."""
    names = list(dict.fromkeys(row.integrator for result in results for row in result.rows))
    title = f"CPU ms per simulated s for {100 * GOAL:g} % position error; orders of position, force"
    table = plain_table("problem", *(heading for name in names for heading in (name, "order")), title=title)
    for result in results:
        cells = []
        for name in names:
            mine = [row for row in result.rows if row.integrator == name]
            cells += [_price(mine), _slopes([order for order in result.orders if order.integrator == name])]
        table.add_row(result.problem.name, *cells)
    return table


def _recommendations(results: Sequence[ProblemResult]) -> Table:
    """The choice of `integrator: auto` for a tick of 1 ms."""
    table = plain_table(
        "problem", "auto", "x/tick", "position", "gained", "ms/s", "best in that time", "x error",
        left=("auto", "best in that time"), title="integrator: auto at 1 kHz, against all others", padding=(0, 1, 0, 0),
    )  # fmt: skip
    for result in results:
        if result.recommendation is not None:
            table.add_row(result.problem.name, *_choice(result.recommendation))
    return table


def _price(rows: Sequence[IntegratorRow]) -> str:
    good = [row.run_time for row in rows if row.position_error <= GOAL]
    return f"{1e3 * min(good):.3g}" if good else MISSING


def _slopes(orders: Sequence[ConvergenceOrder]) -> str:
    """Fitted orders, position first; a mark where theory is missed."""
    if not orders:
        return ""
    if orders[0].exact:
        return "exact" if all(order.holds for order in orders) else "not exact!"
    by_quantity = sorted(orders, key=lambda order: order.quantity, reverse=True)
    texts = [MISSING if order.fitted is None else f"{order.fitted:.2f}" for order in by_quantity]
    missed = any(order.fitted is not None and abs(order.fitted - order.theory) > ORDER_TOLERANCE for order in orders)
    return " ".join(texts) + ("!" if missed else "")


def _choice(recommendation: Recommendation) -> list[str]:
    row, rival = recommendation.row, recommendation.rival
    itself = rival is row
    return [
        row.integrator,
        str(row.step.substeps),
        "diverged" if row.diverged else f"{row.position_error:.0e}",
        "0" if row.energy_gained <= GAINED else f"{row.energy_gained:.0e}",
        f"{1e3 * row.run_time:.3g}",
        "itself" if itself else f"{rival.integrator} {rival.step.substeps}",
        "1" if itself else f"{recommendation.excess:.2f}",
    ]
