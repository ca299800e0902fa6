"""The `stability` command: maps stiff and extreme cases, as sampled walls and as whole systems in virtual time."""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, get_args

from rich.table import Table

from weberlink.protocol.heartbeat import ROUND_TRIP_SHARE
from weberlink.studies.parallel import Progress, parallel_map
from weberlink.studies.result import StudyResult, plain_table
from weberlink.studies.stability.cells import HEIGHT, CellTiming, SystemCell, cells, timing
from weberlink.studies.stability.survey import WallRow, survey, walls
from weberlink.studies.stability.verdict import CellObserver, CellVerdict
from weberlink.studies.stability.wall import SampledWall
from weberlink.system.composition.channels import channels
from weberlink.system.configuration import Configuration, load
from weberlink.system.configuration.model import ControlSettings
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import build_simulation

SEED = 0

Task = SampledWall | SystemCell
Result = WallRow | CellVerdict


def run(*, full: bool, plots: bool, workers: int | None, progress: Progress) -> StudyResult:
    """Compute the map. It does not depend on the number of workers.

    Args:
        full: a fine map in minutes instead of a coarse one in less than one.
        plots: whether figures will be drawn.
        workers: processes; None for one per processor, 1 for this process alone.
        progress: receives the number of finished pieces and of all pieces.

    Raises:
        ConfigurationError: if matplotlib is missing; nothing was computed then.
    """
    if plots:
        need("matplotlib", "plots", "--plots")
    began = perf_counter()
    rows, verdicts = compute(walls(full=full), cells(arrangements(), SEED, full=full), workers, progress)
    return assemble(rows, verdicts, full=full, run_time=perf_counter() - began)


def assemble(
    rows: list[WallRow], verdicts: list[tuple[SystemCell, CellVerdict]], *, full: bool, run_time: float
) -> StudyResult:
    """The map of what was computed, in a run time [s]."""
    facts = environment()
    caption = footer(facts, SEED)
    document = {
        "full": full,
        "walls": [row.as_json() for row in rows],
        "cells": [cell.as_json() | cell.limits() | verdict.as_json() for cell, verdict in verdicts],
        "seed": SEED,
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.stability.figures import stability_map, stability_wall  # noqa: PLC0415 - slow import

        stability_wall(rows, folder / "stability_wall.png", caption)
        stability_map(verdicts, folder / "stability_map.png", caption)

    return StudyResult(document, _table(rows, verdicts, run_time, caption), draw)


def arrangements() -> list[tuple[str, str]]:
    """Pairs of control scheme and force predictor: every scheme with the default predictor, and plain hold."""
    schemes = get_args(ControlSettings.model_fields["scheme"].annotation)
    return [("none", "zoh"), *((scheme, "hybrid") for scheme in schemes)]


def compute(
    surveyed: Sequence[SampledWall], mapped: Sequence[SystemCell], workers: int | None, progress: Progress
) -> tuple[list[WallRow], list[tuple[SystemCell, CellVerdict]]]:
    """Compute everything in `workers` processes; results in the given order."""
    tasks: list[Task] = [*surveyed, *mapped]
    ordered = parallel_map(_work, tasks, workers, _length, progress)
    rows = [result for result in ordered if isinstance(result, WallRow)]
    verdicts = [result for result in ordered if isinstance(result, CellVerdict)]
    return rows, list(zip(mapped, verdicts, strict=True))


def judge(cell: SystemCell) -> CellVerdict:
    """Run a cell in virtual time; an error becomes the verdict "failed"."""
    try:
        return _simulate(cell, timing(cell))
    except Exception as error:  # one broken cell must not end the map
        return CellVerdict("failed", failure=f"{type(error).__name__}: {error}")


def configuration(cell: SystemCell, when: CellTiming) -> Configuration:
    """The shipped default with the parameters of the cell and a scene of one plane.

    Raises:
        ConfigurationError: if there can be no such system.
    """
    one_way_ms = 500.0 * cell.round_trip_s
    home = [0.0, 0.0, HEIGHT]
    hand = {"mass_kg": cell.mass_kg, "damping_n_s_m": cell.damping_n_s_m, "stiffness_n_m": cell.hand_stiffness_n_m}
    values: dict[str, Any] = {
        "rate_hz": cell.rate_hz,
        "link.emulate": {
            "delay_ms": one_way_ms,
            "jitter_ms": 1e3 * cell.jitter_s,
            "loss": cell.loss,
            "seed": cell.seed,
        },
        "link.silence_ms": 200.0 + 2.0 * (one_way_ms + 1e3 * cell.jitter_s) / ROUND_TRIP_SHARE,
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
        "slave.robot.home_m": home,
        "slave.scene": [{"shape": "plane", "stiffness_n_m": cell.stiffness_n_m}],
    }
    overrides = [f"{path}={json.dumps(value)}" for path, value in values.items()]
    return load(Path(str(files("weberlink.configs") / "loopback.yaml")), overrides)


def _simulate(cell: SystemCell, when: CellTiming) -> CellVerdict:
    composed = configuration(cell, when)
    simulation = build_simulation(composed)
    observer = CellObserver()
    score = SessionScore(cell.rate_hz, channels(composed.system)[1].bank)
    simulation.run(when.end + 1.0, [observer, score])
    failures = [side.failure for side in (simulation.master, simulation.slave) if side.failure is not None]
    return observer.verdict(cell, when, score.summary()["energy"], "; ".join(failures) or None)


def _work(task: Task) -> Result:
    return survey(task) if isinstance(task, SampledWall) else judge(task)


def _length(task: Task) -> float:
    """Approximate run time, in ticks."""
    return timing(task).end * task.rate_hz if isinstance(task, SystemCell) else 5e3


def _table(rows: list[WallRow], verdicts: list[tuple[SystemCell, CellVerdict]], run_time: float, caption: str) -> Table:
    text = f"{_about(rows)}\n{len(verdicts)} systems and {len(rows)} walls in {run_time:.0f} s\n{caption}"
    columns = ("slice", "control", "bounded", "most J", "calm J", "peak N", "felt", "fewer")
    table = plain_table(*columns, left=("control",), caption=text)
    groups: dict[tuple[str, str], list[CellVerdict]] = {}
    for cell, verdict in verdicts:
        groups.setdefault((cell.slice, f"{cell.scheme} {cell.predictor}"), []).append(verdict)
    for (name, control), group in groups.items():
        calm = [verdict for verdict in group if verdict.bounded]
        table.add_row(
            name,
            control,
            f"{len(calm)}/{len(group)}",
            _largest([verdict.energy_generated_j for verdict in group], ".2g"),
            _largest([verdict.energy_generated_j for verdict in calm], ".2g"),
            _largest([verdict.peak_force_n for verdict in group], ".1f"),
            _median([verdict.felt_share for verdict in calm], ".0f"),
            _median([verdict.force_reduction for verdict in calm], ".1f"),
        )
    return table


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


def _largest(values: list[float | None], form: str) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):{form}}" if known else "-"


def _median(values: list[float | None], form: str) -> str:
    known = [value for value in values if value is not None]
    return f"{100 * median(known):{form}} %" if known else "-"
