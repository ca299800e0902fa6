"""The `paper` command: every claim of the paper beside what is measured on recordings and on simulated scenes.

Owns the scenes, how they become runs, and the files that come out. What a claim is, and how it is measured, is in
`weberlink.studies.paper`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

from rich.table import Table

from weberlink.master.trace import Trace
from weberlink.studies.curves import Observation
from weberlink.studies.evaluate.command import read_recordings
from weberlink.studies.evaluate.row import Row
from weberlink.studies.evaluate.sweep import Recording, Study, rows_of
from weberlink.studies.paper.claims import CLAIMS, WEBER, WEBERS
from weberlink.studies.paper.document import PREDICTORS, Condition, document
from weberlink.studies.parallel import spread
from weberlink.system.composition.channels import channels
from weberlink.system.composition.slave import build_scene
from weberlink.system.configuration import Configuration, load
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need
from weberlink.system.scoring.felt import FeltError
from weberlink.system.scoring.perception import Threshold
from weberlink.system.scoring.recording import TraceRecorder
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import build_simulation

JND, FLOOR_N = 0.10, 0.02
DURATION_S = 10.0
"""Of a trial of the paper, and of a simulated run."""
SEED = 1
"""Of the hand's tremor."""
PAGE = "the-paper-and-us.md"


class Scene(NamedTuple):
    """What is touched: a shipped file, and what is changed in it."""

    name: str
    file: str
    overrides: tuple[str, ...] = ()


SCENES = (
    Scene("plane", "scene-plane.yaml", ("slave.scene=[{shape: plane, stiffness_n_m: 500}]",)),
    Scene("plane, friction 0.3", "scene-plane.yaml"),
    Scene("dome on a plane", "loopback.yaml"),
    Scene("ball", "scene-sphere.yaml"),
    Scene("hollow ball", "scene-cavity.yaml"),
    Scene("box with edges", "scene-box.yaml"),
    Scene("bumps", "scene-height-field.yaml"),
    Scene("plane, dome, bowl, box", "fig6.yaml"),
)


STUDY = Study(PREDICTORS, WEBERS, FLOOR_N, jnd=JND)
SCENE_STUDY = replace(STUDY, position_step=2e-6)
"""With the wire step of the scenes' files."""

RECORDED, CODED, WHOLE = "recordings", "scenes", "systems"
TEXTS = {
    RECORDED: (
        "Recordings of people, the codec alone",
        "Each recording went through encoder and decoder, sample by sample, quantised as on the wire; nothing is lost "
        "or late. The operator cannot react to what the codec does. Motion along one axis cannot tell a sphere from a "
        "plane: the sphere's fit is not trusted then, and it holds. In a force field there is no surface to find.",
    ),
    CODED: (
        "Simulated scenes, the codec alone",
        f"A simulated hand explored each scene for {DURATION_S:g} s with every sample sent; what the robot was "
        "commanded and felt then went through the codec as a recording does.",
    ),
    WHOLE: (
        "Simulated scenes, the whole system",
        f"The same scenes for {DURATION_S:g} s each with the predictor and the Weber factor at work in both daemons' "
        "loops, in virtual time: the hand yields to the force that was decoded, one tick later, at its own position. "
        "The error is that of the force it felt.",
    ),
}


One = TypeVar("One")
Result = TypeVar("Result")


class Scope(NamedTuple):
    """How much is looked at; the last of the scenes is the one of which single moments are drawn."""

    scenes: tuple[Scene, ...] = SCENES
    webers: tuple[float, ...] = WEBERS
    duration_s: float = DURATION_S


ALL = Scope()


class Run(NamedTuple):
    """One simulated session."""

    scene: Scene
    predictor: str
    weber: float
    duration_s: float


@dataclass(frozen=True)
class Paper:
    """All conditions, and how they are shown."""

    conditions: list[Condition]
    shown: tuple[Scene, Trace]
    """Of which single moments are drawn: a scene, and what was felt there with every sample sent."""
    document: dict[str, Any]
    table: Table
    caption: str

    def draw(self, folder: Path) -> None:
        """Write the page, and beside it the figures and their numbers.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from weberlink.studies.paper.figures import draw_conditions, draw_moments  # noqa: PLC0415 - heavy, only wanted here

        folder.mkdir(parents=True, exist_ok=True)
        draw_conditions(self.conditions, folder, self.caption)
        name, trace = self.shown
        scene = build_scene(_configuration(name, "hybrid", WEBER, FLOOR_N))
        moments = draw_moments(trace, scene, lambda name: SCENE_STUDY.channel(name, WEBER), folder, self.caption)
        page = document(self.conditions, self.caption, moments)
        (folder / PAGE).write_text(page, encoding="utf-8")


def run(
    traces: Sequence[Path],
    *,
    plots: bool,
    workers: int | None,
    progress: Callable[[int, int, str], None],
    scope: Scope = ALL,
) -> Paper:
    """Measure everything. The same traces and seed give the same numbers, whatever the number of workers.

    Args:
        traces: recordings of people; none leaves that condition out.
        plots: whether page and figures will be wanted.
        workers: processes; None for as many as there are processors.
        progress: told how many of how many pieces are done, and what they are.
        scope: of the simulated scenes and the Weber factors.

    Raises:
        ConfigurationError: for a trace that cannot be used, or a missing extra; nothing was computed then.
    """
    if plots:
        need("matplotlib", "plots", "--plots")
    signals = read_recordings(traces)
    began = perf_counter()
    length = scope.duration_s
    sessions = [Run(*parts, length) for parts in product(scope.scenes, PREDICTORS, scope.webers)]
    explorations = [(scene, length) for scene in scope.scenes]
    felt = _done(_feel, sessions, workers, lambda done, total: progress(done, total, "simulated sessions"))
    explored = _done(_explore, explorations, workers, lambda done, total: progress(done, total, "explored scenes"))
    scenes = [Recording(scene.name, trace) for scene, trace in zip(scope.scenes, explored, strict=True)]
    recordings, alone = (
        _coded(study, each, workers, lambda done, total: progress(done, total, "signals through the codec"))
        for study, each in (
            (replace(STUDY, webers=scope.webers), signals),
            (replace(SCENE_STUDY, webers=scope.webers), scenes),
        )
    )
    observed = {RECORDED: recordings, CODED: alone, WHOLE: felt}
    conditions = [Condition(key, *TEXTS[key], observations=observed[key]) for key in TEXTS]
    facts = environment()
    caption = footer(facts, SEED)
    content = {
        "conditions": [_as_json(condition) for condition in conditions],
        "seed": SEED,
        "run_time_s": perf_counter() - began,
        "environment": facts,
    }
    return Paper(conditions, (scope.scenes[-1], explored[-1]), content, _table(conditions, caption), caption)


def _done(
    work: Callable[[One], Result], tasks: Sequence[One], workers: int | None, progress: Callable[[int, int], None]
) -> list[Result]:
    """The results in the order of the tasks."""
    results: dict[int, Result] = {}
    for index, result in spread(work, tasks, workers):
        results[index] = result
        progress(len(results), len(tasks))
    return [results[index] for index in range(len(tasks))]


def _coded(
    study: Study, signals: Sequence[Recording], workers: int | None, progress: Callable[[int, int], None]
) -> list[Observation]:
    """What the codec does with signals that it has no influence on."""
    results = dict(enumerate(_done(rows_of, study.tasks(signals), workers, progress)))
    return [_observation(row) for row in study.ordered(results)]


def _observation(row: Row) -> Observation:
    return Observation(row.trace, row.predictor, row.weber, row.packets_per_s, row.error_rms_jnd)


def _explore(exploration: tuple[Scene, float]) -> Trace:
    """What the robot of an uncoded session was commanded and felt."""
    scene, duration = exploration
    recorder = TraceRecorder()
    build_simulation(_configuration(scene, "zoh", 0.0, 0.0)).run(duration, [recorder])
    return recorder.trace


def _feel(session: Run) -> Observation:
    """Packets and felt error of a coded session."""
    configuration = _configuration(session.scene, session.predictor, session.weber, FLOOR_N)
    score = SessionScore(configuration.system.rate_hz, channels(configuration.system)[1].bank)
    felt = FeltError(Threshold(JND, FLOOR_N))
    build_simulation(configuration).run(session.duration_s, [score, felt])
    rate, error = score.summary()["force"]["packets_per_s"], felt.rms_jnd
    assert error is not None  # the sides of a simulation meet in its first ticks
    return Observation(session.scene.name, session.predictor, session.weber, rate, error)


def _configuration(scene: Scene, predictor: str, weber: float, floor: float) -> Configuration:
    overrides = [
        *scene.overrides,
        f"codec.force.predictor={predictor}",
        f"codec.force.weber={weber}",
        f"codec.force.floor_n={floor}",
        f"master.device.seed={SEED}",
    ]
    return load(Path(str(files("weberlink.configs") / scene.file)), overrides)


def _as_json(condition: Condition) -> dict[str, Any]:
    return {
        "key": condition.key,
        "title": condition.title,
        "signals": condition.units,
        "claims": [found.as_json() for found in condition.savings],
    }


def _table(conditions: Sequence[Condition], caption: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), caption=caption, caption_justify="left")
    for name in ("claim", "at", "paper", *(condition.key for condition in conditions)):
        table.add_column(name, justify="left" if name in ("claim", "at") else "right", no_wrap=True)
    columns = [condition.savings for condition in conditions]
    for claim, *found in zip(CLAIMS, *columns, strict=True):
        cells = ["-" if one.fewer is None else f"{100 * -one.fewer.mean:+.0f} %" for one in found]
        table.add_row(
            f"{claim.predictor} / {claim.reference}", claim.conditions, f"{-100 * claim.fewer:+.0f} %", *cells
        )
    return table
