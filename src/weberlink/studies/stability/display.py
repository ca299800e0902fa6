"""What is felt of a scene: whole systems of many scenes, delays, links and hands in virtual time.

Beside the figures of what is asked for stand those of the four schemes that this project had before, from a file of
data with their origin. The reference of a cell is the force that the same hand feels of the same scene under `none`
without delay; the hand moves on its own script, so it differs from that of the cell in more than the display.
"""

import json
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from itertools import product, starmap
from pathlib import Path
from statistics import fmean
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from weberlink.control.table import SCHEMES
from weberlink.studies.baselines import BASELINES, build_with
from weberlink.studies.parallel import Progress, parallel_map
from weberlink.studies.result import StudyResult, how_much, plain_table
from weberlink.studies.stability.verdict import bound_share
from weberlink.system.composition.link import account
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer
from weberlink.system.scoring.energy import Records

Floats = NDArray[np.float64]

PLANE = "slave.scene=[{{shape: plane, stiffness_n_m: {:g}{}}}]"
LIGHT = "slave.robot.driver=simulated"
"""10 g on a spring of 2500 N/m."""
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "plane": ("scene-plane", (PLANE.format(500, ""),)),
    "damping 1": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 1.0"),)),
    "damping 3": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 3.0"),)),
    "friction": ("scene-plane", (PLANE.format(500, ", friction: {static: 0.3, dynamic: 0.3}"),)),
    "dome": ("loopback", ()),
    "height field": ("scene-height-field", ()),
    "1e4 N/m": ("scene-plane", (PLANE.format(1e4, ""),)),
    "1e5 N/m, light": ("scene-plane", (PLANE.format(1e5, ""), LIGHT)),
    "moving": ("scene-moving", ()),
    "box": ("scene-box", ()),
    "both": ("scene-plane", ()),
    "damped, surface": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 1.0"), "codec.force.predictor=surface")),
    "both, adaptive": ("scene-plane", ("codec.force.predictor=adaptive",)),
    "dome, zoh": ("loopback", ("codec.force.predictor=zoh",)),
}
"""By name: file of the shipped configurations, and overrides. The last four are tried with few links and hands."""
MAIN = tuple(SCENES)[:10]
HANDS: dict[str, tuple[str, ...]] = {
    "default": (),
    "light": ("master.device.hand={mass_kg: 0.1, damping_n_s_m: 3, stiffness_n_m: 100}",),
    "stiff": ("master.device.hand={mass_kg: 0.5, damping_n_s_m: 15, stiffness_n_m: 800}",),
    "pinch": ("master.device.hand={grasp: pinch}",),
}

GHOST_S = 0.05
"""A force that lasts without a contact for this much longer than the round trip is a ghost [s]."""
MOST_CONTACTS = 24
"""The scripts make no more begins and ends of contacts than this; more is chatter."""
WORSE, WORSE_N = 1.1, 0.05
"""A cell is worse if its error is above that of the best scheme before by this ratio and by this force [N] too."""


class DisplayCell(NamedTuple):
    """One run: scene and hand by name, delay each way [ms]; a lossy link has jitter and loses 5 % in bursts."""

    scene: str
    delay_ms: int
    link: str = "clean"
    hand: str = "default"


class Display(NamedTuple):
    """The figures of a run; "felt" is the force on the hand, "pressed" that on the robot at the same time."""

    ideal_error_n: float
    """RMS of felt minus reference."""
    error_n: float
    """RMS of felt minus pressed: contains the delay."""
    contacts: int
    """Begins and ends of the robot's contact."""
    ghost_s: float
    """Longest time with more than 1 N felt and nothing pressed."""
    energy_out_j: float
    """Largest energy that the hand got out beyond what it gave."""
    tracking_m: float | None
    """RMS of the robot's command, that of the delay later, minus the hand, from the first second on."""
    shifted_error_n: float = 0.0
    """The least RMS of felt minus pressed over a shift in time."""
    impulse_ratio: float = 0.0
    """Integral of felt over that of pressed."""
    peak_n: float = 0.0
    """Largest force pressed."""
    ripple_n: float = 0.0
    """RMS of felt without its mean over 21 ticks."""
    bound_share: float = 0.0
    """Largest share of the bound of the account that was got out."""
    failure: str = ""


Figures = dict[DisplayCell, dict[str, Display]]
"""By cell and scheme."""


def cells() -> list[DisplayCell]:
    """The 156 cells: clean and lossy links, other hands, and the last scenes."""
    touched = ("plane", "friction", "dome", "1e4 N/m")
    return [
        *starmap(DisplayCell, product(MAIN, (0, 5, 10, 20, 50, 100, 250))),
        *starmap(DisplayCell, product(MAIN, (5, 20, 100), ["lossy"])),
        *starmap(DisplayCell, product(touched, (0, 20, 100), ["clean"], tuple(HANDS)[1:])),
        *starmap(DisplayCell, product(tuple(SCENES)[10:], (0, 20, 50, 100, 250))),
    ]


def former() -> tuple[Figures, dict[str, str]]:
    """The figures of the four schemes before, and where they come from."""
    stored = json.loads((files(__package__) / "former.json").read_text(encoding="utf-8"))
    schemes = stored["schemes"]
    figures = {
        DisplayCell(*row[:4]): {name: Display(*each) for name, each in zip(schemes, row[4:], strict=True)}
        for row in stored["cells"]
    }
    return figures, stored["origin"]


def run(schemes: Sequence[str], *, plots: bool, workers: int | None, progress: Progress) -> StudyResult:
    """Run all cells, or as many as are done when Ctrl-C stops them, with each scheme.

    Args:
        schemes: by name; those of `weberlink.studies.baselines` too.
        plots: whether figures will be drawn.
        workers: processes; None for one per processor, 1 for this process alone.
        progress: receives the number of finished runs and of all.

    Raises:
        ConfigurationError: matplotlib is missing, or no scheme has that name.
    """
    if plots:
        need("matplotlib", "plots", "--plots")
    for name in schemes:
        if name not in BASELINES and name not in SCHEMES:
            raise ConfigurationError(f"--scheme: {name!r} is none of {', '.join((*SCHEMES, *BASELINES))}")
    began = perf_counter()
    tasks = [(cell, scheme) for scheme in dict.fromkeys(schemes) for cell in cells()]
    found = parallel_map(measured, tasks, workers, lambda task: 1.0 + 1e-3 * task[0].delay_ms, progress)
    figures: Figures = {}
    for index, display in found.items():
        cell, scheme = tasks[index]
        figures.setdefault(cell, {})[scheme] = display
    return assemble(figures, of=len(tasks), run_time=perf_counter() - began)


def assemble(figures: Figures, *, of: int, run_time: float) -> StudyResult:
    """The study of what was computed, of so many runs in all, in a run time [s]."""
    facts, (before, origin) = environment(), former()
    done = sum(map(len, figures.values()))
    interrupted = how_much(done, of, "runs")
    caption = "\n".join(filter(None, (interrupted and f"partial: {interrupted}", footer(facts, 0))))
    document = {
        "cells": [
            cell._asdict()
            | {
                "schemes": {name: each._asdict() for name, each in displays.items()},
                "former_error_n": best(before, cell),
            }
            for cell, displays in figures.items()
        ],
        "summary": {name: summary(figures, before, name) for name in _schemes(figures)},
        "former_origin": origin,
        "run_time_s": run_time,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.stability.display_figure import display_map  # noqa: PLC0415 - slow import

        if figures:
            display_map(figures, before, folder / "stability_display.png", caption)

    return StudyResult(document, _table(figures, before, caption), draw, interrupted=interrupted)


def best(figures: Figures, cell: DisplayCell) -> float | None:
    """The least error over the reference [N] of the schemes of a cell; None if it has none."""
    return min((each.ideal_error_n for each in figures.get(cell, {}).values()), default=None)


def summary(figures: Figures, before: Figures, scheme: str) -> dict[str, Any]:
    """What is judged of a scheme over all of its cells."""
    mine = {cell: each[scheme] for cell, each in figures.items() if scheme in each and not each[scheme].failure}
    tracking = [each.tracking_m for cell, each in mine.items() if cell.delay_ms <= 100 and each.tracking_m is not None]

    def is_worse(cell: DisplayCell) -> bool:
        least = best(before, cell)
        error = mine[cell].ideal_error_n
        return least is not None and error > WORSE * least and error > least + WORSE_N

    return {
        "cells": len(mine),
        "failed": sum(bool(each[scheme].failure) for each in figures.values() if scheme in each),
        "worse": sum(map(is_worse, mine)),
        "ghosts": sum(is_ghost(cell, each) for cell, each in mine.items()),
        "bound_kept": sum(each.bound_share <= 1.0 for each in mine.values()),
        "few_contacts": sum(each.contacts <= MOST_CONTACTS for each in mine.values()),
        "tracking_m": max(tracking, default=None),
    }


def measured(task: tuple[DisplayCell, str]) -> Display:
    """Run a cell with a scheme; an error becomes the `failure` of a display without figures."""
    cell, scheme = task
    try:
        return _measure(cell, scheme)
    except Exception as error:  # one broken cell must not end the study
        return Display(0.0, 0.0, 0, 0.0, 0.0, None, failure=f"{type(error).__name__}: {error}")


def _measure(cell: DisplayCell, scheme: str) -> Display:
    master, slave, account_share, failure = _simulated(cell, scheme)
    felt, pressed = np.asarray(master["output"], np.float64), np.asarray(slave["raw"], np.float64)
    hand, command, delay = master["position"], slave["output"], cell.delay_ms
    sizes, loads = _lengths(felt), _lengths(pressed)
    ideal = _reference(cell.scene, cell.hand)
    both = min(len(felt), len(ideal))
    given = np.concatenate([[0.0], np.cumsum((felt[:-1] * np.diff(hand, axis=0)).sum(axis=1))])
    away = _lengths(command[delay:] - hand[: len(hand) - delay])[1000:]
    away = away[np.isfinite(away)]
    ripple = (sizes - np.convolve(sizes, np.ones(21) / 21.0, "same"))[20:-20]
    return Display(
        ideal_error_n=_rms(felt[:both] - ideal[:both]),
        error_n=_rms(felt - pressed),
        contacts=int(np.count_nonzero(np.diff(loads > 0.05))),
        ghost_s=1e-3 * _longest((sizes > 1.0) & (loads < 0.05)),
        energy_out_j=float(given.max()),
        tracking_m=float(np.sqrt(np.mean(away**2))) if len(away) else None,
        shifted_error_n=_shifted(felt, pressed, 2 * delay + 60),
        impulse_ratio=float(sizes.sum() / max(float(loads.sum()), 1e-9)),
        peak_n=float(loads.max()),
        ripple_n=float(np.sqrt(np.mean(ripple**2))),
        bound_share=account_share,
        failure=failure,
    )


def _simulated(cell: DisplayCell, scheme: str) -> tuple[Records, Records, float, str]:
    """Records of both sides, the share of the account's bound, and why a side ended early."""
    (file, more), delay = SCENES[cell.scene], cell.delay_ms
    lossy = cell.link == "lossy"
    faults = f", jitter_ms: {min(5, delay)}, loss: 0.05, burst: 3, seed: 1" if lossy else ", seed: 0"
    silence = max(100, int(5.5 * (delay + (5 if lossy else 0)) + 60))
    overrides = [f"link.emulate={{delay_ms: {delay}{faults}}}", f"link.silence_ms={silence}", *more, *HANDS[cell.hand]]
    configuration = load(Path(str(files("weberlink.configs") / f"{file}.yaml")), overrides)
    simulation = build_with(configuration, scheme)
    masters, slaves = [], []

    class Keep:
        def add(self, master: Records, slave: Records) -> None:
            masters.append(master.copy())
            slaves.append(slave.copy())

    try:
        simulation.run(10.6 + 4e-3 * delay, [Keep()])
    finally:
        simulation.close()
    failures = [side.failure for side in (simulation.master, simulation.slave) if side.failure is not None]
    master, slave = np.concatenate(masters), np.concatenate(slaves)
    return master, slave, bound_share(master, account(configuration.system)), "; ".join(failures)


@lru_cache(maxsize=len(SCENES) * len(HANDS))
def _reference(scene: str, hand: str) -> Floats:
    """The force felt under `none` without delay, shape (n, 3) [N]."""
    return np.asarray(_simulated(DisplayCell(scene, 0, hand=hand), "none")[0]["output"], np.float64)


def _shifted(felt: Floats, pressed: Floats, span: int) -> float:
    """The least RMS difference over a shift of at most `span` ticks, in about 80 steps."""
    count = len(felt)
    pairs = (
        (felt[max(0, lag) : count + min(0, lag)], pressed[max(0, -lag) : count - max(0, lag)])
        for lag in range(-span, span + 1, max(1, span // 40))
    )
    return min(_rms(ours - theirs) for ours, theirs in pairs)


def _rms(vectors: Floats) -> float:
    return float(np.sqrt(np.mean((vectors * vectors).sum(axis=-1))))


def _lengths(vectors: Any) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))


def _longest(holds: NDArray[np.bool_]) -> int:
    """The longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def is_ghost(cell: DisplayCell, display: Display) -> bool:
    return _ghost(cell, display) > GHOST_S


def _ghost(cell: DisplayCell, display: Display) -> float:
    """How much longer than the round trip a force without a contact lasts [s]."""
    return max(0.0, display.ghost_s - 2e-3 * cell.delay_ms)


def _schemes(figures: Figures) -> list[str]:
    return list(dict.fromkeys(name for displays in figures.values() for name in displays))


def _table(figures: Figures, before: Figures, caption: str) -> Table:
    lines = [_sentence(name, summary(figures, before, name)) for name in _schemes(figures)]
    text = "\n".join(
        (
            "former, felt: error over no delay, RMS in N, mean over links and hands; former is the",
            "  best of none, tdpa, mmt, auto in each cell; the largest of: ghost (beyond the round",
            "  trip, ms), contacts (begins and ends), out (mJ), bound (share got out, %), apart (mm)",
            *lines,
            caption,
        )
    )
    names = ("ms", "scene", "scheme", "former", "felt", "ghost", "contacts", "out", "bound", "apart")
    table = plain_table(*names, left=("scene", "scheme"), caption=text, padding=(0, 1, 0, 0))
    groups: dict[tuple[int, str, str], list[tuple[DisplayCell, Display]]] = {}
    for cell, displays in sorted(figures.items(), key=lambda item: item[0].delay_ms):
        for name, display in displays.items():
            groups.setdefault((cell.delay_ms, cell.scene, name), []).append((cell, display))
    for (delay, scene, name), group in groups.items():
        least = [error for cell, _ in group if (error := best(before, cell)) is not None]
        each = [display for _, display in group]
        table.add_row(
            str(delay),
            scene,
            name,
            f"{fmean(least):.2f}" if least else "-",
            "failed" if any(one.failure for one in each) else f"{fmean(one.ideal_error_n for one in each):.2f}",
            f"{1e3 * max(_ghost(cell, display) for cell, display in group):.0f}",
            str(max(one.contacts for one in each)),
            f"{1e3 * max(one.energy_out_j for one in each):.1f}",
            f"{100.0 * max(one.bound_share for one in each):.0f}",
            f"{1e3 * max(one.tracking_m or 0.0 for one in each):.1f}",
        )
    return table


def _sentence(name: str, judged: dict[str, Any]) -> str:
    count = judged["cells"]
    return (
        f"{name}: {judged['worse']} of {count} cells worse than the best of the four by 10 % and {WORSE_N:g} N;\n"
        f"  {judged['ghosts']} ghosts; bound kept in {judged['bound_kept']}; at most {MOST_CONTACTS} contacts in "
        f"{judged['few_contacts']}; {judged['failed']} failed;\n"
        f"  at most {1e3 * (judged['tracking_m'] or 0.0):.1f} mm apart up to 100 ms"
    )
