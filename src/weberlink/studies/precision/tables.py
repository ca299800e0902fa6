"""The study as text: what accuracy costs, and what is recommended. At most 80 columns wide."""

from collections.abc import Sequence

from rich.table import Table

from weberlink.studies.precision.run import Row
from weberlink.studies.precision.study import ORDER_TOLERANCE, Order, Recommendation, Result

GOAL = 1e-3
"""Relative position error whose price is shown."""
MISSING = "-"


def summary(results: Sequence[Result]) -> Table:
    """Both tables, one above the other."""
    whole = Table.grid()
    whole.add_row(prices(results))
    whole.add_row("")
    whole.add_row(recommendations(results))
    return whole


def prices(results: Sequence[Result]) -> Table:
    """CPU time for an error of 0.1 %, a dash where no step reaches it, and the orders that were seen."""
    names = list(dict.fromkeys(row.integrator for result in results for row in result.rows))
    table = bare(f"CPU ms per simulated s for {100 * GOAL:g} % position error; orders of position, force", gap=2)
    table.add_column("problem", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
        table.add_column("order", justify="right", no_wrap=True)
    for result in results:
        cells = []
        for name in names:
            mine = [row for row in result.rows if row.integrator == name]
            cells += [price(mine), slopes([order for order in result.orders if order.integrator == name])]
        table.add_row(result.problem.name, *cells)
    return table


def recommendations(results: Sequence[Result]) -> Table:
    """The choice of `integrator: auto` for a tick of 1 ms."""
    table = bare("integrator: auto at 1 kHz, against the cheapest that is as good", gap=1)
    for name in ("problem", "auto", "x/tick", "position", "force", "ms/s", "cheapest", "x time"):
        table.add_column(name, justify="left" if name in ("problem", "auto", "cheapest") else "right", no_wrap=True)
    for result in results:
        if result.recommendation is not None:
            table.add_row(result.problem.name, *choice(result.recommendation))
    return table


def price(rows: Sequence[Row]) -> str:
    good = [row.run_time for row in rows if row.position_error <= GOAL]
    return f"{1e3 * min(good):.3g}" if good else MISSING


def slopes(orders: Sequence[Order]) -> str:
    """Fitted orders, position first; a mark where theory is missed."""
    if not orders:
        return ""
    if orders[0].exact:
        return "exact" if all(order.holds for order in orders) else "not exact!"
    by_quantity = sorted(orders, key=lambda order: order.quantity, reverse=True)
    texts = [MISSING if order.fitted is None else f"{order.fitted:.2f}" for order in by_quantity]
    missed = any(order.fitted is not None and abs(order.fitted - order.theory) > ORDER_TOLERANCE for order in orders)
    return " ".join(texts) + ("!" if missed else "")


def choice(recommendation: Recommendation) -> list[str]:
    row, rival = recommendation.row, recommendation.rival
    itself = rival is row or recommendation.on_front
    return [
        row.integrator,
        str(row.step.substeps),
        "diverged" if row.diverged else f"{row.position_error:.0e}",
        f"{row.force_error:.0e}",
        f"{1e3 * row.run_time:.3g}",
        "itself" if itself else f"{rival.integrator} {rival.step.substeps}",
        "1" if itself else f"{recommendation.excess:.2f}",
    ]


def bare(title: str, gap: int) -> Table:
    return Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, gap, 0, 0))
