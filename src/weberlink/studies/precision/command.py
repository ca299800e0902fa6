"""The `precision` command: error of the integrators against run time."""

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

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
    study,
)
from weberlink.studies.result import StudyResult, how_much, plain_table
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer

GOAL = 1e-3
"""Relative position error whose run time is shown."""
MISSING = "-"


def run(
    *, full: bool, plots: bool, progress: Progress = lambda *_: None, problems: Sequence[Problem] = PROBLEMS
) -> StudyResult:
    """Measure the integrators of the simulated robot on problems with known solutions, those done when Ctrl-C came.

    Args:
        full: finer steps and more repeats: minutes instead of half a minute.
        plots: whether figures will be drawn.
        progress: called before each problem, and at the end.
        problems: of the integrators.

    Raises:
        ConfigurationError: if a package is missing; nothing was computed then.
    """
    need("scipy", "studies", "the reference solutions")
    if plots:
        need("matplotlib", "studies", "--plots")
    facts = environment()
    caption = footer(facts)
    effort = FULL if full else DEFAULT
    results = study(effort, problems, chooser=automatic, progress=progress)

    def draw(folder: Path) -> None:
        from weberlink.studies.precision.figures import work_precision  # noqa: PLC0415 - slow import

        work_precision(results, folder / "work_precision.png", caption)

    document = {
        "finest_substeps_per_tick": effort.finest,
        "repeats_most": effort.repeats,
        "problems": [result.as_json() for result in results],
        "environment": facts,
    }
    tables = Table.grid()
    tables.add_row(summary(results))
    tables.add_row("")
    tables.add_row(caption)
    interrupted = how_much(len(results), len(problems), "problems")
    return StudyResult(document, tables, draw if results else None, interrupted=interrupted)


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
