"""The `paper` command: measure every claim of the paper on recordings and on simulated scenes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from rich.table import Table

from weberlink.master.trace import Trace
from weberlink.studies.curves import Observation
from weberlink.studies.evaluate.study import EvaluationStudy, rows_of
from weberlink.studies.evaluate.traces import NamedTrace, read_traces
from weberlink.studies.paper.claims import CLAIMS, PREDICTORS, WEBER, WEBERS, Claim
from weberlink.studies.paper.document import PaperCondition, document
from weberlink.studies.parallel import parallel_map
from weberlink.studies.result import StudyResult, plain_table
from weberlink.system.configuration import Configuration, load
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer
from weberlink.system.interruption import Interruption
from weberlink.system.scoring.recording import TraceRecorder
from weberlink.system.scoring.session import score_of
from weberlink.system.simulate import build_simulation

FLOOR_N = 0.02
DURATION_S = 10.0
"""Of a trial of the paper, and of a simulated run."""
SEED = 1
"""Of the hand's tremor."""
PAGE = "the-paper-and-us.md"


class PaperScene(NamedTuple):
    """A scene: a shipped configuration, and changes to it."""

    name: str
    file: str
    overrides: tuple[str, ...] = ()


SCENES = (
    PaperScene("plane", "scene-plane.yaml", ("slave.scene=[{shape: plane, stiffness_n_m: 500}]",)),
    PaperScene("plane, friction 0.3", "scene-plane.yaml"),
    PaperScene("dome on a plane", "loopback.yaml"),
    PaperScene("ball", "scene-sphere.yaml"),
    PaperScene("hollow ball", "scene-cavity.yaml"),
    PaperScene("box with edges", "scene-box.yaml"),
    PaperScene("bumps", "scene-height-field.yaml"),
    PaperScene("plane, dome, bowl, box", "fig6.yaml"),
)


STUDY = EvaluationStudy(PREDICTORS, WEBERS, FLOOR_N)
SCENE_STUDY = replace(STUDY, position_step=2e-6)
"""With the position step of the scene configurations."""

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


class PaperScope(NamedTuple):
    """What is simulated; forces over time are drawn of the last scene."""

    scenes: tuple[PaperScene, ...] = SCENES
    webers: tuple[float, ...] = WEBERS
    duration_s: float = DURATION_S


ALL = PaperScope()


class SimulatedSession(NamedTuple):
    scene: PaperScene
    predictor: str
    weber: float
    duration_s: float


@dataclass(frozen=True)
class Paper(StudyResult):
    """The measured claims. `draw` writes the page, and beside it the figures and their numbers."""

    conditions: list[PaperCondition]


def run(
    traces: Sequence[Path],
    *,
    plots: bool,
    workers: int | None,
    progress: Callable[[int, int, str], None],
    scope: PaperScope = ALL,
) -> Paper:
    """Measure all claims. The numbers do not depend on the number of workers.

    Args:
        traces: recordings of people; without any, that condition is left out.
        plots: whether page and figures will be written.
        workers: processes; None for one per processor.
        progress: called with the number of tasks done, of all tasks, and what they are.
        scope: simulated scenes and Weber factors.

    Raises:
        ConfigurationError: for a trace that cannot be used, or a missing extra; nothing was computed then.
    """
    if plots:
        need("matplotlib", "studies", "--plots")
    signals = read_traces(traces)
    began, interruption = perf_counter(), Interruption()

    def done(work: Callable[[Any], Any], tasks: Sequence[Any], what: str) -> list[Any]:
        def tell(count: int, total: int) -> None:
            progress(count, total, what)

        return list(parallel_map(work, tasks, workers, progress=tell, interruption=interruption).values())

    def coded(study: EvaluationStudy, named: Sequence[NamedTrace]) -> list[Observation]:
        tasks = replace(study, webers=scope.webers).cases(named)
        return [
            Observation(*(row[name] for name in ("trace", "predictor", "weber", "packets_per_s", "error_rms_jnd")))
            for rows in done(rows_of, tasks, "signals through the codec")
            for row in rows
        ]

    sessions = [SimulatedSession(*parts, scope.duration_s) for parts in product(scope.scenes, PREDICTORS, scope.webers)]
    felt = done(_feel, sessions, "simulated sessions")
    explored = done(_explore, [(scene, scope.duration_s) for scene in scope.scenes], "explored scenes")
    recordings = coded(STUDY, signals)
    # Ctrl-C may have left some scenes out: then `alone` is not used.
    scenes = [NamedTrace(scene.name, trace) for scene, trace in zip(scope.scenes, explored, strict=False)]
    alone = coded(SCENE_STUDY, scenes)
    observed = {RECORDED: recordings, CODED: alone, WHOLE: felt}
    facts = environment()
    caption = footer(facts, SEED)
    if interruption.noted:
        return _partial(observed, caption, {"seed": SEED, "run_time_s": perf_counter() - began, "environment": facts})
    conditions = [PaperCondition(key, *TEXTS[key], observed[key]) for key in TEXTS]
    content = {
        "conditions": [_as_json(condition) for condition in conditions],
        "seed": SEED,
        "run_time_s": perf_counter() - began,
        "environment": facts,
    }

    def draw(folder: Path) -> None:
        from weberlink.studies.paper.figures import draw_conditions, draw_forces  # noqa: PLC0415 - imports matplotlib

        draw_conditions(conditions, folder, caption)
        draw_forces(explored[-1], lambda name: SCENE_STUDY.channel(name, WEBER), folder / "force", caption)
        (folder / PAGE).write_text(document(conditions, caption, drawn=True), encoding="utf-8")

    return Paper(content, _table(conditions, caption), draw, conditions)


def _partial(observed: Mapping[str, Sequence[Observation]], caption: str, facts: dict[str, Any]) -> Paper:
    """What was observed until Ctrl-C. No claim is judged by it: a claim is about all signals."""
    table = plain_table("signal", "predictor", "k", "packets/s", "RMS JND", left=("predictor",), caption=caption)
    for one in (one for found in observed.values() for one in found):
        table.add_row(one.unit, one.predictor, f"{one.weber:g}", f"{one.packets_per_s:.1f}", f"{one.quality:.3f}")
    document = {"observations": {key: [asdict(one) for one in found] for key, found in observed.items()}} | facts
    count = sum(map(len, observed.values()))
    return Paper(document, table, None, [], interrupted=f"{count} observations, too few to judge a claim,")


def _explore(exploration: tuple[PaperScene, float]) -> Trace:
    """Position and force at the robot in a session with every sample sent."""
    scene, duration = exploration
    recorder = TraceRecorder()
    build_simulation(_configuration(scene, "zoh", 0.0, 0.0)).run(duration, [recorder])
    return recorder.trace


def _feel(session: SimulatedSession) -> Observation:
    """Packets and felt error of a coded session."""
    configuration = _configuration(session.scene, session.predictor, session.weber, FLOOR_N)
    system = configuration.system
    score = score_of(system)
    build_simulation(configuration).run(session.duration_s, [score])
    force = score.summary()["force"]
    return Observation(
        session.scene.name, session.predictor, session.weber, force["packets_per_s"], force["error_rms_jnd"]
    )


def _configuration(scene: PaperScene, predictor: str, weber: float, floor: float) -> Configuration:
    overrides = [
        *scene.overrides,
        f"codec.force.predictor={predictor}",
        f"codec.force.weber={weber}",
        f"codec.force.floor_n={floor}",
        f"master.device.seed={SEED}",
    ]
    return load(Path(str(files("weberlink.configs") / scene.file)), overrides)


def _as_json(condition: PaperCondition) -> dict[str, Any]:
    return {
        "key": condition.key,
        "title": condition.title,
        "signals": condition.units,
        "claims": [found.as_json() for found in condition.results],
        "observations": [asdict(one) for one in condition.observations],
    }


def _table(conditions: Sequence[PaperCondition], caption: str) -> Table:
    """Savings with verdicts, and below them the signals that never reach the quality."""
    keys = (condition.key for condition in conditions)
    never = [
        f"{_pair(found.claim)}, {condition.key}: {len(found.unreached)} of {found.signals} signals "
        f"never reach the quality ({', '.join(found.unreached)})"
        for condition in conditions
        for found in condition.results
        if found.unreached
    ]
    table = plain_table("claim", "at", "paper", *keys, left=("at",), caption="\n".join([*never, caption]))
    columns = [condition.results for condition in conditions]
    for claim, *found in zip(CLAIMS, *columns, strict=True):
        cells = ["-" if one.fewer is None else f"{100 * -one.fewer.mean:+.0f} % {one.verdict}" for one in found]
        at = "k" if claim.at == "weber" else "quality"
        table.add_row(_pair(claim), at, f"{-100 * claim.fewer:+.0f} %", *cells)
    return table


def _pair(claim: Claim) -> str:
    return f"{claim.predictor} / {claim.reference}"
