"""The `stability` command: maps stiff and extreme cases, as sampled walls and as whole systems in virtual time."""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Any

from rich.table import Table

from weberlink.studies.parallel import Progress, parallel_map
from weberlink.studies.result import StudyResult, how_much, plain_table
from weberlink.studies.stability.cells import SystemCell
from weberlink.studies.stability.script import HEIGHT, CellTiming, scene, timing
from weberlink.studies.stability.slices import cells
from weberlink.studies.stability.survey import WallRow, survey, walls
from weberlink.studies.stability.verdict import CellObserver, CellVerdict
from weberlink.studies.stability.wall import SampledWall
from weberlink.system.composition.account import account
from weberlink.system.configuration import Configuration, ConfigurationError, load
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer
from weberlink.system.simulate import build_simulation

SEED = 0

Task = SampledWall | SystemCell
Result = WallRow | CellVerdict
Judged = tuple[SystemCell, CellVerdict]


def run(*, full: bool, plots: bool, workers: int | None, progress: Progress) -> StudyResult:
    """Compute the map, or as much of it as is done when Ctrl-C stops it. It does not depend on the number of workers.

    Args:
        full: every slice in fine steps, in an hour or so, instead of the most telling cells in a minute.
        plots: whether figures will be drawn.
        workers: processes; None for one per processor, 1 for this process alone.
        progress: receives the number of finished pieces and of all pieces.

    Raises:
        ConfigurationError: if matplotlib is missing; nothing was computed then.
    """
    if plots:
        need("matplotlib", "studies", "--plots")
    began = perf_counter()
    surveyed, mapped = walls(full=full), cells(SEED, full=full)
    computed = compute(surveyed, mapped, workers, progress)
    return assemble(*computed, full=full, of=len(surveyed) + len(mapped), run_time=perf_counter() - began)


def assemble(rows: list[WallRow], verdicts: list[Judged], *, full: bool, of: int, run_time: float) -> StudyResult:
    """The map of what was computed, of so many pieces in all, in a run time [s]."""
    facts = environment()
    done = len(rows) + len(verdicts)
    interrupted = how_much(done, of, "pieces")
    caption = "\n".join(filter(None, (interrupted and f"partial: {interrupted}", footer(facts, SEED))))
    document = {
        "full": full,
        "walls": [row.as_json() for row in rows],
        "cells": [
            cell.as_json() | (cell.limits() if cell.scheme == "none" else {}) | verdict.as_json()
            for cell, verdict in verdicts
        ],
        "seed": SEED,
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.stability.figures import stability_map, stability_wall  # noqa: PLC0415 - slow import

        if rows:
            stability_wall(rows, folder / "stability_wall.png", caption)
        if verdicts:
            stability_map(verdicts, folder / "stability_map.png", caption)

    return StudyResult(document, _table(rows, verdicts, run_time, caption), draw, interrupted=interrupted)


def compute(
    surveyed: Sequence[SampledWall], mapped: Sequence[SystemCell], workers: int | None, progress: Progress
) -> tuple[list[WallRow], list[Judged]]:
    """Compute everything in `workers` processes, or what is done before Ctrl-C; results in the given order."""
    tasks: list[Task] = [*surveyed, *mapped]
    results = parallel_map(_work, tasks, workers, _length, progress)
    done = [(task, results[index]) for index, task in enumerate(tasks) if index in results]
    rows = [result for _, result in done if isinstance(result, WallRow)]
    judged = [
        (task, result) for task, result in done if isinstance(task, SystemCell) and isinstance(result, CellVerdict)
    ]
    return rows, judged


def judge(cell: SystemCell) -> CellVerdict:
    """Run a cell in virtual time; an error becomes the verdict "failed", and a range that is left "refused"."""
    try:
        return _simulate(cell, timing(cell))
    except ConfigurationError as error:
        return CellVerdict("refused", failure=str(error))
    except Exception as error:  # one broken cell must not end the map
        return CellVerdict("failed", failure=f"{type(error).__name__}: {error}")


def configuration(cell: SystemCell, when: CellTiming) -> Configuration:
    """The shipped default with the parameters of the cell and a scene of one object.

    Raises:
        ConfigurationError: if there can be no such system.
    """
    return load(Path(str(files("weberlink.configs") / "loopback.yaml")), overrides(cell, when))


def overrides(cell: SystemCell, when: CellTiming) -> list[str]:
    """What differs from the shipped default, as the command line takes it: "path.to.key=value" each."""
    one_way_ms = 500.0 * cell.round_trip_s
    home = [0.0, 0.0, HEIGHT]
    hand = cell.wall.hand.model_dump(mode="json")
    robot = {"driver": "point"} if cell.robot == "point" else {
        "driver": "simulated", "mass_kg": cell.robot_mass_kg, "damping_n_s_m": cell.robot_damping_n_s_m,
    }  # fmt: skip
    values: dict[str, Any] = {
        "rate_hz": cell.rate_hz,
        "link.emulate": {
            "delay_ms": one_way_ms,
            "jitter_ms": 1e3 * cell.jitter_s,
            "loss": cell.loss,
            "seed": cell.seed,
        },
        "link.silence_ms": 200.0,
        "link.longest_round_trip_ms": 400.0 + 2.0 * (one_way_ms + 1e3 * cell.jitter_s),
        "codec.force.predictor": cell.predictor,
        "codec.force.weber": cell.weber,
        "codec.force.floor_n": cell.floor_n,
        "codec.position.predictor": cell.position_predictor,
        "codec.position.weber": cell.weber,
        "codec.position.bound_m": cell.bound_m,
        "control.scheme": cell.scheme,
        # No tremor: every oscillation during the hold then comes from the loop.
        "master.device": {"driver": "operator", "hand": hand, "tremor_m": 0.0, "home_m": home, "repeat": False}
        | {"script": list(when.steps)},
        "master.limits.device_ms": max(20.0, 3e3 / cell.rate_hz),
        "slave.limits.robot_ms": max(20.0, 3e3 / cell.rate_hz),
        "slave.robot": robot | {"home_m": home},
        "slave.scene": scene(cell),
    }
    return [f"{path}={json.dumps(value)}" for path, value in values.items()]


def _simulate(cell: SystemCell, when: CellTiming) -> CellVerdict:
    composed = configuration(cell, when)
    simulation = build_simulation(composed)
    observer = CellObserver()
    simulation.run(when.end + 1.0, [observer])
    failures = [side.failure for side in (simulation.master, simulation.slave) if side.failure is not None]
    return observer.verdict(
        cell, when, account(composed.system.control, composed.system.master.mapping), "; ".join(failures) or None
    )


def _work(task: Task) -> Result:
    return survey(task) if isinstance(task, SampledWall) else judge(task)


def _length(task: Task) -> float:
    """Approximate run time, in ticks."""
    return timing(task).end * task.rate_hz if isinstance(task, SystemCell) else 5e3


def _table(rows: list[WallRow], verdicts: list[Judged], run_time: float, caption: str) -> Table:
    text = "\n".join(
        (
            "calm: settled, decaying or driven; felt, robot: share of the force on the ideal wall, %",
            "impulse: felt over pressed; out: J got out since the press; bound: largest",
            "  share of the account's bound got out since the session began, %",
            "marks: s force limited at operator, sensor or contact; l contact lost",
            *filter(None, (_about_bound(verdicts), _about(rows))),
            f"{len(verdicts)} systems and {len(rows)} walls in {run_time:.0f} s",
            caption,
        )
    )
    columns = ("slice", "scheme", "with", "calm", "felt", "robot", "impulse", "out", "bound", "marks")
    table = plain_table(*columns, left=("scheme", "with"), caption=text, padding=(0, 1, 0, 0))
    groups: dict[tuple[str, str, str], list[CellVerdict]] = {}
    for cell, verdict in verdicts:
        groups.setdefault((cell.slice, cell.scheme, cell.variant), []).append(verdict)
    for (name, scheme, variant), group in groups.items():
        table.add_row(
            name,
            scheme,
            variant,
            _calm(group),
            _range([verdict.felt_share for verdict in group], 100.0, ".0f"),
            _range([verdict.pressed_share for verdict in group], 100.0, ".0f"),
            _range([verdict.impulse_ratio for verdict in group], 1.0, ".2f"),
            _largest([verdict.energy_out_j for verdict in group], ".2g"),
            "-" if scheme == "none" else _largest([_percent(verdict.bound_share) for verdict in group], ".0f"),
            _marks(group),
        )
    return table


def _calm(group: list[CellVerdict]) -> str:
    if {verdict.state for verdict in group} == {"refused"}:
        return "refused"
    return f"{sum(verdict.bounded for verdict in group)}/{len(group)}"


def _marks(group: list[CellVerdict]) -> str:
    found = {"s": sum(bool(verdict.saturated) for verdict in group), "l": sum(v.state == "lost" for v in group)}
    return " ".join(f"{count}{mark}" for mark, count in found.items() if count)


def _about_bound(verdicts: list[Judged]) -> str:
    """In how many systems with an account its bound is kept."""
    kept = [verdict.bound_kept for cell, verdict in verdicts if cell.scheme != "none"]
    known = [each for each in kept if each is not None]
    return f"the account's bound is kept in {sum(known)} of {len(known)}" if known else ""


def _about(rows: list[WallRow]) -> str:
    """Summary of the walls."""
    if not rows:
        return "no walls surveyed"
    worst = max(abs(row.deviation) for row in rows)
    low, high = min(row.stable_to_n_m for row in rows), max(row.stable_to_n_m for row in rows)
    active = sum(row.passive_but_active for row in rows)
    passive = sum(stiffness <= row.passive_to_n_m for row in rows for stiffness, _ in row.activities)
    return (
        f"walls: limit measured within {100 * worst:.1g} % of the eigenvalues', {low:.2g} to {high:.2g} N/m\n"
        f"active on the passive side of Colgate's bound: {active} of {passive}"
    )


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _largest(values: list[float | None], form: str) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):{form}}" if known else "-"


def _range(values: list[float | None], scale: float, form: str) -> str:
    """From the least to the largest, or the one that both are."""
    known = [scale * value for value in values if value is not None]
    if not known:
        return "-"
    low, high = f"{min(known):{form}}", f"{max(known):{form}}"
    return low if low == high else f"{low}..{high}" if low.startswith("-") else f"{low}-{high}"
