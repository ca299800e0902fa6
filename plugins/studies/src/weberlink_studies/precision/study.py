"""The `precision` study: error of the integrators against run time. Needs scipy (extra: studies)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan
from pathlib import Path
from time import thread_time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.console import Group, RenderableType

from weberlink.slave.integrators import INTEGRATORS, IntegrationScheme, MassState
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink_studies.frame import FrameResult, Row, Study, data_frame, records
from weberlink_studies.parallel import Progress
from weberlink_studies.precision.measurement import StepSize, measured
from weberlink_studies.precision.problems import PROBLEMS, TICK, Problem
from weberlink_studies.precision.reference import reference
from weberlink_studies.result import Column, frame_table, pareto

if TYPE_CHECKING:
    from pandas import DataFrame, Series

RESOLVED = 1e-12  # relative errors below it are rounding errors and count as equal
EXACT = 1e-9  # largest relative error of an integrator that is exact on linear contact
NOISE_LEAST = 0.05  # run times that differ by less than this share count as equal
ORDER_TOLERANCE = 0.2
NEAR_FRONT = 1.5  # largest error of the recommended integrator, over the smallest error in the same time
GAINED = 1e-9  # share of the energy up to which a gain is rounding
COARSE = 0.03  # relative errors above it are not asymptotic yet
POINTS_LEAST, POINTS_MOST = 3, 4  # of a fitted order
GOAL = 1e-3  # relative error whose run time is shown
TIMED_TICKS = 3000  # ticks of which the 99.9th percentile is taken


@dataclass(frozen=True)
class Effort:
    """How fine and how often."""

    finest: int = 64  # most substeps per tick. Steps are halved from the coarsest of a problem down to this one.
    repeats: int = 5  # most timed runs of each step
    problems: Sequence[Problem] = PROBLEMS  # of the integrators
    schemes: Mapping[str, IntegrationScheme] | None = None  # integrators by name
    # integrator and substeps for every problem; None for those that `integrator: auto` chooses
    recommended: tuple[str, int] | None = None

    def steps(self, problem: Problem, also: int) -> list[StepSize]:
        """The coarsest first; `also` is a number of substeps that must be among them."""
        ticks = [StepSize(ticks=2**n) for n in range(1, problem.coarsest_ticks.bit_length())]
        substeps = {2**n for n in range(self.finest.bit_length())} | {also}
        return sorted((*ticks, *(StepSize(substeps=n) for n in substeps)), key=lambda step: -step.length)


FULL = Effort(finest=512, repeats=15)


class PrecisionCase(NamedTuple):
    """A problem with every integrator and step."""

    problem: Problem
    effort: Effort


def rows_of(case: PrecisionCase) -> list[Row]:
    """The rows of a problem; that of the recommended integrator and step has the times of its ticks too.

    `on_front` says whether a row is on the Pareto front of run time and position error of its problem.
    """
    problem, effort = case
    known = reference(problem)
    schemes = INTEGRATORS if effort.schemes is None else effort.schemes
    mass, stiffness, damping = problem.body
    options = SimulatedOptions(mass_kg=mass, stiffness_n_m=stiffness, damping_n_s_m=damping)
    robot = SimulatedRobot(options, problem.scene(), TICK)  # with `integrator: auto`
    chosen = effort.recommended or (robot.integrator, robot.substeps)
    rows = []
    for name, scheme in schemes.items():
        for step in effort.steps(problem, chosen[1] if name == chosen[0] else 1):
            row = measured(problem, name, scheme, step, known, effort.repeats) | known.as_json()
            row["recommended"] = (name, step) == (chosen[0], StepSize(substeps=chosen[1]))
            if row["recommended"]:
                row["tick_us"] = tick_us(problem, scheme, step, known.start_force)
            rows.append(row)
    frame = data_frame(rows)
    best = pareto(frame.run_time_ms_per_s, compared_errors(frame, resolved(frame)))
    return [row | {"on_front": on} for row, on in zip(rows, best.tolist(), strict=True)]


def tick_us(problem: Problem, scheme: IntegrationScheme, step: StepSize, start_force: Any) -> dict[str, float]:
    """Median and 99.9th percentile of the CPU time in which a tick is integrated [us]."""
    times: list[float] = []
    while len(times) < TIMED_TICKS:
        integrator = scheme.build(problem.body, problem.scene())
        motion = MassState(problem.position, problem.velocity, start_force)
        for tick in range(round(problem.duration / TICK)):
            goal, began = problem.goal(tick * TICK), thread_time()
            for _ in range(step.substeps):
                motion = integrator.advance(motion, goal, step.length)
            times.append(thread_time() - began)
    median, p999 = 1e6 * np.percentile(times, [50.0, 99.9])
    return {"median": float(median), "p999": float(p999)}


def resolved(rows: "DataFrame") -> float:
    """The relative error below which two results of one problem count as equal."""
    return max(RESOLVED, 10.0 * float(rows.reference_agreement.iloc[0]))


def fitted_order(steps: Sequence[float], errors: Sequence[float], floor: float) -> float | None:
    """Least squares over the finest four of the steps whose errors are asymptotic.

    Returns:
        The order; None where fewer than three errors lie between `floor` and 3 %.
    """
    usable = sorted((step, error) for step, error in zip(steps, errors, strict=True) if floor < error < COARSE)
    if len(usable) < POINTS_LEAST:
        return None
    lengths, sizes = np.log(np.transpose(usable[:POINTS_MOST]))
    return float(np.polyfit(lengths, sizes, 1)[0])


def orders(rows: "DataFrame", effort: Effort) -> "DataFrame":
    """The orders of convergence of smooth problems, beside theory: a row for each integrator and quantity."""
    import pandas as pd  # noqa: PLC0415 - heavy, an extra

    problems = {problem.name: problem for problem in effort.problems}
    schemes = INTEGRATORS if effort.schemes is None else effort.schemes
    found = []
    for (name, integrator), mine in rows.groupby(["problem", "integrator"], sort=False):
        problem, scheme = problems[name], schemes[integrator]
        for quantity in sorted(problem.smooth):
            errors = mine[f"{quantity}_error"].astype(float).fillna(inf)
            fitted = fitted_order(mine.step_us, errors, resolved(mine))
            exact = problem.linear and scheme.exact_if_linear
            near = fitted is not None and abs(fitted - scheme.order) <= ORDER_TOLERANCE
            found.append({
                "problem": name, "integrator": integrator, "quantity": quantity, "order": fitted,
                "order_in_theory": scheme.order, "exact_in_theory": exact, "largest_error": errors.max(),
                "holds": bool(errors.max() <= EXACT if exact else near),
            })  # fmt: skip
    return pd.DataFrame(found)


def compared_errors(rows: "DataFrame", floor: float) -> "Series[float]":
    """Position errors as compared: at least `floor`, and infinite for what diverged."""
    return rows.position_error.astype(float).clip(lower=floor).mask(rows.diverged, inf).fillna(inf)


def recommendation(rows: "DataFrame", floor: float | None = None) -> Row | None:
    """The recommended row of one problem, against every integrator and step that fits a tick and takes no more time.

    `rival` has the smallest error, `error_excess` is the error over it (1 on the Pareto front), and
    `energy_gained_in_excess` what is gained beyond the row that gains least.
    """
    if not rows.recommended.any():
        return None
    floor = resolved(rows) if floor is None else floor
    rows = rows.assign(compared=compared_errors(rows, floor))
    chosen = rows[rows.recommended].iloc[0]
    time = chosen.run_time_ms_per_s * (1.0 + max(NOISE_LEAST, 0.5 * chosen.run_time_spread))
    quick = rows[(rows.substeps_per_tick >= 1) & (rows.run_time_ms_per_s <= time)]
    rival = quick.loc[quick.compared.idxmin()]
    if not rival.compared < chosen.compared:
        rival = chosen
    gained = rows.energy_gained.astype(float).fillna(inf)
    excess = float(chosen.compared) / float(rival.compared)
    gain = float(gained[chosen.name]) - float(gained[quick.index].min())
    row: Row = chosen.drop("compared").to_dict()
    return row | {
        "rival": rival.integrator,
        "rival_substeps": rival.substeps_per_tick,
        "error_excess": excess,
        "energy_gained_in_excess": gain,
        "on_front": bool(not chosen.diverged and excess <= NEAR_FRONT and not gain > GAINED),
    }


def recommendations(rows: "DataFrame") -> "DataFrame":
    """`recommendation` of each problem, if it has one."""
    import pandas as pd  # noqa: PLC0415

    found = [recommendation(mine) for _, mine in rows.groupby("problem", sort=False)]
    return pd.DataFrame([one for one in found if one is not None])


def _summary(effort: Effort, rows: "DataFrame") -> dict[str, Any]:
    finite = [records(frame.replace(inf, np.nan)) for frame in (orders(rows, effort), recommendations(rows))]
    return {
        "finest_substeps_per_tick": effort.finest,
        "repeats_most": effort.repeats,
        "orders": finite[0],
        "recommended": finite[1],
    }


def _tables(effort: Effort, rows: "DataFrame", run_time_s: float, caption: str) -> RenderableType:
    fitted = orders(rows, effort)
    good = rows[rows.position_error.astype(float) <= GOAL]
    prices = good.groupby(["problem", "integrator"]).run_time_ms_per_s.min().unstack()
    prices = prices.reindex(index=rows.problem.unique(), columns=rows.integrator.unique())
    columns = {"problem": Column("problem")}
    for name in prices:
        mine = fitted[fitted.integrator == name] if len(fitted) else fitted
        slopes = {problem: _slopes(each) for problem, each in mine.groupby("problem")} if len(mine) else {}
        prices[f"{name} order"] = [slopes.get(problem, "") for problem in prices.index]
        columns |= {name: Column(name, "{:.3g}"), f"{name} order": Column("order", left=True)}
    told = f"CPU ms per simulated s for {100 * GOAL:g} % position error; fitted orders"
    parts = [frame_table(prices.reset_index(names="problem"), columns, title=told)]
    chosen = recommendations(rows)
    if len(chosen):
        itself = chosen.rival.eq(chosen.integrator) & chosen.rival_substeps.eq(chosen.substeps_per_tick)
        best = chosen.rival.str.cat(chosen.rival_substeps.map(" {:g}".format)).mask(itself, "itself")
        chosen = chosen.assign(best=best, budget=chosen.tick_us_p999 / (1e6 * TICK))
        lost = chosen.diverged.to_numpy()
        chosen["position_error"] = chosen.position_error.astype(object).mask(lost, "diverged")
        chosen["force_error"] = chosen.force_error.astype(float).mask(lost)
        notes = [
            "errors: largest, relative to the extent of the motion and to the largest force",
            "gained: energy; us, p99.9: CPU time of a tick's integration, of 1 ms: at p99.9",
            "best in that time: smallest position error; x: error over that",
            f"in {run_time_s:.0f} s",
            caption,
        ]
        title = "integrator: auto at 1 kHz, against all others"
        parts.append(frame_table(chosen, CHOICE, title=title, notes=notes))
    return Group(parts[0], "", *parts[1:])


def _error(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.0e}"


CHOICE = {
    "problem": Column("problem"),
    "integrator": Column("auto", left=True),
    "substeps_per_tick": Column("n", "{:g}"),
    "position_error": Column("position", _error),
    "force_error": Column("force", "{:.0e}"),
    "energy_gained": Column("gained", lambda gained: "0" if gained <= GAINED else f"{gained:.0e}"),
    "tick_us_median": Column("us", "{:.0f}"),
    "tick_us_p999": Column("p99.9", "{:.0f}"),
    "budget": Column("of 1 ms", "{:.0%}"),
    "best": Column("best in that time", left=True),
    "error_excess": Column("x", "{:.3g}"),
}


def _slopes(fitted: "DataFrame") -> str:
    """Fitted orders, position first; a mark where theory is missed."""
    if fitted.exact_in_theory.all():
        return "exact" if fitted.holds.all() else "not exact!"
    by_quantity = fitted.sort_values("quantity", ascending=False)
    missed = (by_quantity.order.notna() & ~by_quantity.holds).any()
    slopes = ["-" if isnan(order) else f"{order:.2f}" for order in by_quantity.order.astype(float)]
    return " ".join(slopes) + ("!" if missed else "")


def _plots(effort: Effort, rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.precision.figures import work_precision  # noqa: PLC0415 - imports matplotlib

    problems = [problem for problem in effort.problems if problem.name in set(rows.problem)]
    work_precision(rows, problems, folder / "work_precision.png", caption)


STUDY = Study(
    "precision",
    lambda effort: [PrecisionCase(problem, effort) for problem in effort.problems],
    rows_of,
    _tables,
    _plots,
    lambda _: 2.0,
    _summary,
)


def run(effort: Effort, *, progress: Progress = lambda *_: None) -> FrameResult:
    """Measure the integrators of the simulated robot on problems with known solutions, those done when Ctrl-C came."""
    return STUDY.result(effort, workers=1, progress=progress)  # others would disturb what is timed
