"""The `paper` command: measure every claim of the paper on recordings and on simulated scenes.

A case is a signal with the codec alone, or a session of the whole system.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import RenderableType

from weberlink.cli.shipped import find
from weberlink.config import Configuration, load
from weberlink.master.trace import Trace
from weberlink.session.simulation import TraceRecorder, build_simulation
from weberlink_figures.session import score_of
from weberlink_figures.tree import to_json
from weberlink_studies import recordings
from weberlink_studies.evaluate.study import EvaluationStudy
from weberlink_studies.evaluate.traces import FILES, NamedTrace, read_traces
from weberlink_studies.frame import FrameResult, Row, Study, check_resources, records
from weberlink_studies.paper.claims import (
    CLAIMS,
    EASY,
    FAILS,
    HOLDS,
    NO_CLAIM,
    PREDICTORS,
    TOO_EASY,
    UNMEASURED,
    WEBER,
    WEBERS,
    judge,
)
from weberlink_studies.parallel import Progress
from weberlink_studies.result import Column, frame_table

if TYPE_CHECKING:
    from pandas import DataFrame

FLOOR_N = 0.02
DURATION_S = 10.0  # of a trial of the paper, and of a simulated run
SEED = 1  # of the hand's tremor
PAGE = "the-paper-and-us.md"
STUDY = EvaluationStudy(PREDICTORS, WEBERS, FLOOR_N)
SCENE_STUDY = replace(STUDY, position_step=2e-6)  # with the position step of the scene configurations
RECORDED, CODED, WHOLE = "recordings", "scenes", "systems"
TITLES = {CODED: "scenes, codec alone", WHOLE: "scenes, whole system"}


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


class PaperOptions(NamedTuple):
    """What is measured; forces over time are drawn of the last scene."""

    traces: Sequence[NamedTrace]
    scenes: tuple[PaperScene, ...] = SCENES
    webers: tuple[float, ...] = WEBERS
    duration_s: float = DURATION_S


class PaperCase(NamedTuple):
    """A signal with some predictors and Weber factors; sessions of the whole system are cases of one pair each."""

    condition: str
    signal: NamedTrace | PaperScene
    predictors: tuple[str, ...]
    webers: tuple[float, ...]
    duration_s: float


def _cases(options: PaperOptions) -> list[PaperCase]:
    every, time = (PREDICTORS, options.webers), options.duration_s
    return [
        *(PaperCase(RECORDED, trace, *every, time) for trace in options.traces),
        *(PaperCase(CODED, scene, *every, time) for scene in options.scenes),
        *(
            PaperCase(WHOLE, scene, (predictor,), (weber,), time)
            for scene, predictor, weber in product(options.scenes, *every)
        ),
    ]


def _run(case: PaperCase) -> list[Row]:
    condition, signal, predictors, webers, duration = case
    if isinstance(signal, NamedTrace):
        study, found = STUDY, signal
        surface = signal.source == FILES or recordings.has_surface(signal.name)
        told = {"condition": condition, "source": signal.source, "surface": surface, "signal": signal.name}
    else:
        told = {"condition": condition, "source": signal.name, "surface": True, "signal": signal.name}
        if condition == WHOLE:
            force = _feel(signal, predictors[0], webers[0], duration)
            return [told | {"predictor": predictors[0], "weber": webers[0]} | force]
        study, found = SCENE_STUDY, NamedTrace(signal.name, explore(signal, duration))
    rows = replace(study, predictors=predictors, webers=webers).rows(found)
    return [
        told | {name: row[name] for name in ("predictor", "weber", "packets_per_s", "error_rms_jnd")} for row in rows
    ]


def explore(scene: PaperScene, duration_s: float) -> Trace:
    """Position and force at the robot in a session with every sample sent."""
    recorder = TraceRecorder()
    build_simulation(_configuration(scene, "zoh", 0.0, 0.0)).run(duration_s, [recorder.add])
    return recorder.trace


def _feel(scene: PaperScene, predictor: str, weber: float, duration_s: float) -> dict[str, float]:
    """Packets and felt error of a coded session."""
    configuration = _configuration(scene, predictor, weber, FLOOR_N)
    score = score_of(configuration.system)
    build_simulation(configuration).run(duration_s, [score.add])
    force = to_json(score.figures().felt)
    return {name: force[name] for name in ("packets_per_s", "error_rms_jnd")}


def _configuration(scene: PaperScene, predictor: str, weber: float, floor: float) -> Configuration:
    overrides = [
        *scene.overrides,
        f"codec.force.predictor={predictor}",
        f"codec.force.weber={weber}",
        f"codec.force.floor_n={floor}",
        f"master.device.seed={SEED}",
    ]
    return load(find(scene.file.removesuffix(".yaml")), overrides)


def _seconds(case: PaperCase) -> float:
    samples = len(case.signal.trace.time_s) if isinstance(case.signal, NamedTrace) else 1e3 * case.duration_s
    return 2e-5 * samples * len(case.predictors) * len(case.webers) + (case.condition != RECORDED) * 1e-4 * samples


def _judged(options: PaperOptions, rows: "DataFrame") -> "DataFrame":
    return judge(rows, len(PREDICTORS) * len(options.webers))


def _summary(options: PaperOptions, rows: "DataFrame") -> dict[str, Any]:
    return {"claims": records(_judged(options, rows))}


MARKS = {HOLDS: "{}*", FAILS: "{}", TOO_EASY: "({})", NO_CLAIM: "{}", UNMEASURED: "-"}
NOTES = (
    f"Packets more or fewer [%], k at a Weber factor of {WEBER:g}, q at equal quality.",
    "*: as many fewer as the paper claims. never: on a signal, not at that quality.",
    f"(): at least {100 * EASY:g} % fewer, too easy to decide anything.",
)
SECTIONS = {
    (RECORDED, True): "recordings",
    (RECORDED, False): "no surface, no claim",
    (CODED, True): TITLES[CODED],
    (WHOLE, True): TITLES[WHOLE],
}


def _claims(judged: "DataFrame") -> "DataFrame":
    """Changes of the packets [%] as text: a row for the paper, for each source and each scene, a column for a claim."""
    from pandas import DataFrame  # noqa: PLC0415 - heavy, an extra

    names = [f"{claim.predictor} / {claim.reference}, {'k' if claim.at == 'weber' else 'q'}" for claim in CLAIMS]
    rows = [["the paper", *(f"{round(-100 * claim.fewer):+d}" for claim in CLAIMS)]]
    for key, title in SECTIONS.items():
        part = judged[(judged.condition == key[0]) & (judged.surface == key[1])]
        rows += [[f"{title}:", *[""] * len(CLAIMS)]] if len(part) else []
        for source, mine in part.groupby("source", sort=False):
            cells = [
                "never" if one.unreached else "-" if isnan(one.fewer) else
                MARKS[one.verdict].format(f"{round(-100 * one.fewer):+d}")
                for one in mine.itertuples()
            ]  # fmt: skip
            rows.append([f"{source} ({mine.signals.max()})" if key[0] == RECORDED else source, *cells])
    return DataFrame(rows, columns=["", *names])


def _tables(options: PaperOptions, rows: "DataFrame", _run_time_s: float, caption: str) -> RenderableType:
    cells = _claims(_judged(options, rows))
    columns = {name: Column(name.replace(" / ", "\n/").replace(", ", "\n")) for name in cells.columns}
    return frame_table(cells, columns, notes=[*NOTES, caption], padding=(0, 1, 0, 0))


HEAD = f"""# The paper and us

What X. Xu, J. Kammerl, R. Chaudhari and E. Steinbach report in "Hybrid signal-based and geometry-based prediction for
haptic data reduction" (HAVE 2011), beside what is measured with this code. Made by `make figures`, not edited by hand.

The paper's numbers are of a simulated scene that people touched with a real device, and its quality is their rating.
Here nobody was asked: the quality is the RMS error of the force in JNDs, one JND being 10 % of the force or 0.04 N.
Ratings of people come from `weberlink study experiment` alone. The floor of the deadband is {FLOOR_N:g} N throughout.

- **Recordings** of people went through encoder and decoder, sample by sample, quantised as on the wire; nothing is lost
  or late. The operator cannot react to what the codec does. Motion along one axis cannot tell a sphere from a plane:
  the sphere's fit is not trusted then, and it holds. Recordings of one source are of one rig, and count as one: the
  number is the geometric mean over them. Geometry can predict the force of a surface only, so where nothing or a
  guidance field is touched the paper claims nothing.
- **Scenes** are simulated: a hand explores each for {DURATION_S:g} s. With the codec alone (`{CODED}`), what the robot
  was commanded and felt in a session with every sample sent is coded as a recording is. With the whole system
  (`{WHOLE}`), predictor and Weber factor are at work in both daemons' loops, in virtual time: the hand yields to the
  decoded force one tick later, at its own position, and the error is that of the force it felt.
"""


def _page(cells: "DataFrame", caption: str) -> str:
    lines = [list(cells.columns), ["---", *["--:"] * len(CLAIMS)], *cells.to_numpy().tolist()]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    pictures = "\n\n".join(
        f"![{words}]({name}.png)"
        for name, words in (
            ("packet_rate", "Packet rate over Weber factor (the paper's Fig. 7)"),
            ("quality_over_rate", "Error over packet rate (Fig. 9)"),
            ("force", f"Force over time of the last scene, the codec alone, k = {WEBER:g} (Figs. 2 and 3)"),
        )
    )
    return f"{HEAD}\n{table}\n\n{' '.join(NOTES).replace('*:', chr(92) + '*:')}\n\n{pictures}\n\n---\n{caption}\n"


def _plots(options: PaperOptions, rows: "DataFrame", folder: Path, caption: str) -> None:
    """Write the page, and the figures beside it."""
    from weberlink_studies.paper.figures import draw_curves, draw_forces  # noqa: PLC0415 - imports matplotlib

    shown = rows[rows.surface]
    draw_curves(shown.assign(panel=shown.condition.map(TITLES).fillna(shown.source)), folder, caption)
    scene = explore(options.scenes[-1], options.duration_s)
    draw_forces(scene, lambda name: SCENE_STUDY.channel(name, WEBER), folder / "force", caption)
    (folder / PAGE).write_text(_page(_claims(_judged(options, rows)), caption), encoding="utf-8")


PAPER = Study("paper", _cases, _run, _tables, _plots, _seconds, _summary, SEED)


def run(traces: Sequence[Path], *, workers: int | None, progress: Progress) -> FrameResult:
    """Measure all claims, or what is done when Ctrl-C comes. The numbers do not depend on the number of workers."""
    check_resources(workers, None)
    named = read_traces(traces or [Path("recordings")])
    return PAPER.result(PaperOptions(named), workers=workers, progress=progress)
