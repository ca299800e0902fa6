"""What is felt of a scene: whole systems of many scenes, delays, links and hands in virtual time, with some schemes.

The reference of a cell is the force that the same hand feels of the same scene under `none` without delay; the hand
yields to what it feels, so the motions of both differ too. Beside the schemes are those that were here before, `none`,
`tdpa`, `mmt` and `auto`; their figures are data, with their origin. Cells that a seed draws
(`weberlink_studies.stability.held_out`) are compared with those that can still be run.
"""

import json
from collections.abc import Sequence
from functools import lru_cache
from importlib import resources
from itertools import product, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType

from weberlink.cli.shipped import find
from weberlink.config import ConfigurationError, System, load
from weberlink.control.contract import LEAST_CONTACT
from weberlink.control.table import SCHEMES
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE, TORQUE
from weberlink_figures.channel import longest_run, turns_between
from weberlink_studies.baselines import BASELINES, recorded
from weberlink_studies.frame import FrameResult, Row, Study, data_frame, records
from weberlink_studies.parallel import Progress
from weberlink_studies.result import Column, frame_table
from weberlink_studies.stability.verdict import accounts, bound_share

if TYPE_CHECKING:
    from pandas import DataFrame

Floats = NDArray[np.float64]

PLANE = "slave.scene=[{{shape: plane, stiffness_n_m: {:g}{}}}]"
LIGHT = "slave.robot.driver=simulated"  # 10 g on a spring of 2500 N/m
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


RUN_S = 10.6  # length of a run, besides two round trips [s]


class DisplayCell(NamedTuple):
    """One run: scene and hand by name, delay each way [ms]; a lossy link has jitter and loses 5 % in bursts.

    `overrides` of a drawn cell are beside those of its names.
    """

    scene: str
    delay_ms: int
    link: str = "clean"
    hand: str = "default"
    overrides: tuple[str, ...] = ()


def cells() -> list[DisplayCell]:
    """The 156 cells: clean and lossy links, other hands, and the last scenes."""
    touched = ("plane", "friction", "dome", "1e4 N/m")
    return [
        *starmap(DisplayCell, product(MAIN, (0, 5, 10, 20, 50, 100, 250))),
        *starmap(DisplayCell, product(MAIN, (5, 20, 100), ["lossy"])),
        *starmap(DisplayCell, product(touched, (0, 20, 100), ["clean"], tuple(HANDS)[1:])),
        *starmap(DisplayCell, product(tuple(SCENES)[10:], (0, 20, 50, 100, 250))),
    ]


FILES = (
    *("loopback", "try", "fig6", "adaptive", "lossless-1dof", "replay", "scene-box", "scene-cavity"),
    *("scene-height-field", "scene-moving", "scene-plane", "scene-simulated-robot", "scene-sphere", "stiff-wall"),
    *("mujoco-arm", "mujoco-peg", "rotation", "arms"),
)
"""Shipped files of a computed hand and robot. The last two turn, and are tried with loss too."""
FILE_DELAYS_MS = (0, 20, 50, 100, 150)


def file_cells() -> list[DisplayCell]:
    """The shipped files as they are, but for the link."""
    links = [*product(FILES, FILE_DELAYS_MS, ["clean"]), *product(FILES[-2:], FILE_DELAYS_MS[1:], ["lossy"])]
    return [*starmap(DisplayCell, links)]


def rows_of(case: tuple[DisplayCell, str]) -> list[Row]:
    """Run a cell with a scheme; an error becomes the `failure` of a row without figures.

    "felt" is the force on the hand, "pressed" that on the robot at the same time. The figures of a row:

        ideal_error_n, error_n  RMS of felt minus reference, and minus pressed, which contains the delay
        shifted_error_n  the least RMS of felt minus pressed over a shift in time
        contacts       begins and ends of the robot's contact
        ghost_s        longest time with more than 1 N felt and nothing pressed
        energy_out_j   largest energy that the hand got out beyond what it gave
        bound_share    largest share of the bound of the account that was got out
        tracking_m     RMS of the robot's command, that of the delay later, minus the hand, from the first second on
        impulse_ratio  integral of felt over that of pressed, both where they are contact
        turned_rad     angle between the robot's command and the hand of the delay before, mean of the last second
        peak_n         largest force pressed
        ripple_n       RMS of felt without its mean over 21 ticks

    Of an arm all these are of its joints, in N m and rad.
    """
    cell, scheme = case
    try:
        figures = _measure(cell, scheme)
    except Exception as error:  # one broken cell must not end the study
        figures = {"failure": f"{type(error).__name__}: {error}"}
    return [cell._asdict() | {"scheme": scheme} | figures]


def _measure(cell: DisplayCell, scheme: str) -> Row:
    (master, slave), system, share, failure = _simulated(cell, scheme)
    axes, delay = _axes(system), cell.delay_ms
    felt, pressed = master["output"][:, axes], slave["raw"][:, axes]
    hand, command = master["position"][:, axes], slave["output"][:, axes]
    sizes, loads = _lengths(felt), _lengths(pressed)
    ideal = _reference(cell._replace(delay_ms=0, link="clean"))
    both = min(len(felt), len(ideal))
    given = np.concatenate([[0.0], np.cumsum((felt[:-1] * np.diff(hand, axis=0)).sum(axis=1))])
    apart = command[delay:] - hand[: len(hand) - delay]
    away = _lengths(apart)[1000:]
    away, turned = away[np.isfinite(away)], None
    if system.codec.joints is not None or system.codec.rotation is not None:
        turned_to, turned_by = slave["output"][delay:, TORQUE], master["position"][: len(apart), TORQUE]
        turns = apart if system.codec.joints is not None else turns_between(turned_to, turned_by)
        turned = float(_lengths(turns[-1000:]).mean())
    ripple = (sizes - np.convolve(sizes, np.ones(21) / 21.0, "same"))[20:-20]
    count, span = len(felt), 2 * delay + 60  # shifted in about 80 steps
    shifts = (
        (felt[max(0, lag) : count + min(0, lag)], pressed[max(0, -lag) : count - max(0, lag)])
        for lag in range(-span, span + 1, max(1, span // 40))
    )
    return {
        "ideal_error_n": _rms(felt[:both] - ideal[:both]),
        "error_n": _rms(felt - pressed),
        "contacts": int(np.count_nonzero(np.diff(loads > 0.05))),
        "ghost_s": 1e-3 * longest_run((sizes > 1.0) & (loads < 0.05)),
        "energy_out_j": float(given.max()),
        "tracking_m": float(np.sqrt(np.mean(away**2))) if len(away) else None,
        "shifted_error_n": min(_rms(ours - theirs) for ours, theirs in shifts),
        "impulse_ratio": float(
            sizes[sizes > LEAST_CONTACT].sum() / max(float(loads[loads > LEAST_CONTACT].sum()), 1e-9)
        ),
        "peak_n": float(loads.max()),
        "turned_rad": turned,
        "ripple_n": float(np.sqrt(np.mean(ripple**2))),
        "bound_share": share,
        "failure": failure,
    }


def _simulated(cell: DisplayCell, scheme: str) -> tuple[tuple[Records, Records], System, float, str]:
    """Records of both sides, their system, the share of the bound, and why a side ended early."""
    (file, more), delay = SCENES.get(cell.scene, (cell.scene if cell.scene in FILES else "loopback", ())), cell.delay_ms
    lossy = cell.link == "lossy"
    faults = f", jitter_ms: {min(5, delay)}, loss: 0.05, burst: 3, seed: 1" if lossy else ", seed: 0"
    silence = max(100, int(5.5 * (delay + (5 if lossy else 0)) + 60))
    longest = max(400, 2 * delay + 100)
    link = [f"emulate={{delay_ms: {delay}{faults}}}", f"silence_ms={silence}", f"longest_round_trip_ms={longest}"]
    overrides = [*(f"link.{each}" for each in link), *more, *HANDS.get(cell.hand, ()), *cell.overrides]
    configuration = load(find(file), overrides)
    records, failure = recorded(configuration, scheme, RUN_S + 4e-3 * delay)
    system = configuration.system
    return records, system, bound_share(records[0], accounts(system)), failure


def _axes(system: System) -> slice:
    """Those by which a cell is judged: all of an arm, the translation of a hand."""
    return FORCE if system.codec.joints is None else slice(None)


@lru_cache(maxsize=len(SCENES) * len(HANDS))
def _reference(cell: DisplayCell) -> Floats:
    """The force felt under `none`, shape (n, axes) [N], [N m]."""
    (master, _), system, _, _ = _simulated(cell, "none")
    forces: Floats = master["output"][:, _axes(system)]
    return forces


def _rms(vectors: Floats) -> float:
    return float(np.sqrt(np.mean((vectors * vectors).sum(axis=-1))))


def _lengths(vectors: Any) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))


GHOST_S = 0.06  # A force that lasts without a contact for this much longer than the round trip is a ghost [s]
MOST_CONTACTS = 24  # the scripts make no more begins and ends of contacts than this; more is chatter
WORSE, WORSE_N = 1.1, 0.05
"""A cell is worse if its error is above that of the best scheme before by this ratio and by this force [N] too."""
KEYS = list(DisplayCell._fields)
RIVALS = ("none", *BASELINES)
"""With what drawn cells are compared: the four schemes before never ran them."""
FIGURES = (
    "ideal_error_n", "error_n", "contacts", "ghost_s", "energy_out_j", "tracking_m", "shifted_error_n",
    "impulse_ratio", "peak_n", "ripple_n", "bound_share", "failure",
)  # fmt: skip
"""Order of the stored figures."""


def former() -> "DataFrame":
    """Rows of the four schemes before; `attrs` has where they come from as `origin`."""
    stored = json.loads((resources.files(__package__) / "former.json").read_text(encoding="utf-8"))
    frame = data_frame([
        dict(zip([*KEYS, "scheme", *FIGURES], [*row[:4], (), scheme, *each], strict=False))
        for row in stored["cells"]
        for scheme, each in zip(stored["schemes"], row[4:], strict=True)
    ])  # fmt: skip
    frame.attrs["origin"] = stored["origin"]
    return frame


def judged(rows: "DataFrame") -> "DataFrame":
    """Rows with the best error of others (missing without one), and what is judged of each; without those that failed.

    The others are the four schemes before; of drawn cells, `RIVALS` as far as they ran.
    """
    from pandas import concat  # noqa: PLC0415 - heavy

    ran = rows[rows.failure == ""]
    others = concat([former(), ran[(ran.overrides != ()) & ran.scheme.isin(RIVALS)]])
    best = others.groupby(KEYS).error_n.min().rename("former_error_n").reset_index()
    ran = ran.merge(best, on=KEYS, how="left")
    beyond = (ran.ghost_s - 2e-3 * ran.delay_ms).clip(lower=0.0)
    least = ran.former_error_n
    return ran.assign(
        ghost_beyond_s=beyond,
        ghost=beyond > GHOST_S,
        worse=(ran.error_n > WORSE * least) & (ran.error_n > least + WORSE_N),
        compared=least.notna(),
        bound_kept=ran.bound_share <= 1.0,
        few_contacts=ran.contacts <= MOST_CONTACTS,
        near_tracking_m=ran.tracking_m.where(ran.delay_ms <= 100),
    )


def summary(rows: "DataFrame") -> "DataFrame":
    """What is judged of each scheme over all of its cells."""
    sums = ["compared", "worse", "ghost", "bound_kept", "few_contacts"]
    found = (
        judged(rows)
        .groupby("scheme", sort=False)
        .agg(**{name: (name, "sum") for name in sums}, cells=("scene", "size"), tracking_m=("near_tracking_m", "max"))
    )
    return found.assign(failed=(rows.failure != "").groupby(rows.scheme).sum()).reset_index()


COLUMNS = {
    "delay_ms": Column("ms"),
    "scene": Column("scene", left=True),
    "scheme": Column("scheme", left=True),
    "former": Column("best", "{:.2f}"),
    "felt": Column("felt", "{:.2f}"),
    "ghost": Column("ghost", lambda seconds: f"{1e3 * seconds:.0f}"),
    "contacts": Column("contacts", "{:.0f}"),
    "out": Column("out", lambda joules: f"{1e3 * joules:.1f}"),
    "bound": Column("bound", lambda share: f"{100 * share:.0f}"),
    "apart": Column("apart", lambda metres: f"{1e3 * metres:.1f}"),
}


class DisplayOptions(NamedTuple):
    """Of the study: schemes, and which cells: the 156, those of a seed, or the shipped files."""

    schemes: tuple[str, ...]
    held_out: int | None = None
    files: bool = False


def _cases(options: DisplayOptions) -> list[tuple[DisplayCell, str]]:
    from weberlink_studies.stability.held_out import held_out  # noqa: PLC0415 - it makes cells of this module

    chosen = file_cells() if options.files else cells() if options.held_out is None else held_out(options.held_out)
    return [(cell, scheme) for scheme in options.schemes for cell in chosen]


def _tables(options: DisplayOptions, rows: "DataFrame", run_time_s: float, caption: str) -> RenderableType:
    if options.files:
        return _files_table(rows, [f"{len(rows)} runs in {run_time_s:.0f} s", caption])
    keys, others, ran = ["delay_ms", "scene", "scheme"], "none, tdpa, mmt, auto", judged(rows)
    if options.held_out is not None:
        keys, others = keys[1:], ", ".join(RIVALS)
    table = (
        ran.sort_values(keys[:-1], kind="stable")
        .groupby(keys, sort=False)
        .agg(
            former=("former_error_n", "mean"),
            felt=("error_n", "mean"),
            ghost=("ghost_beyond_s", "max"),
            contacts=("contacts", "max"),
            out=("energy_out_j", "max"),
            bound=("bound_share", "max"),
            apart=("tracking_m", "max"),
        )
    )
    notes = [
        "felt: RMS of felt minus pressed in N, the delay contained, mean over cells;",
        f"  best: that of the best of {others} in each cell",
        "the largest of ghost (beyond the round trip, ms), contacts",
        "  (begins and ends), out (mJ), bound (share got out, %), apart (mm)",
        *(
            f"{one.scheme}: {one.worse} of {one.compared} worse than that best by 10 % and {WORSE_N:g} N\n"
            f"  {one.ghost} ghosts; bound kept in {one.bound_kept} of {one.cells}; {one.failed} failed\n"
            f"  at most {MOST_CONTACTS} contacts in {one.few_contacts}; up to 100 ms at most "
            f"{1e3 * one.tracking_m:.1f} mm apart"
            for one in summary(rows).itertuples()
        ),
        f"{len(rows)} runs in {run_time_s:.0f} s",
        caption,
    ]
    columns = {name: column for name, column in COLUMNS.items() if name not in {"delay_ms"} - {*keys}}
    return frame_table(table.reset_index(), columns, notes=notes)


def _files_table(rows: "DataFrame", notes: list[str]) -> RenderableType:
    """The ratio of impulses by file and delay, and the largest of the rest."""
    keys = ["scene", "scheme", "link"]
    table = rows.pivot_table(index=keys, columns="delay_ms", values="impulse_ratio", sort=False)
    rest = judged(rows).groupby(keys, sort=False)
    table = table.assign(
        turned=np.rad2deg(rest.turned_rad.max()), bound=rest.bound_share.max(), contacts=rest.contacts.max()
    ).reset_index()
    table["scene"] = table.scene.where(table.link == "clean", table.scene + ", " + table.link)
    notes = [
        "impulse felt over that pressed, by the delay each way in ms",
        "the largest of: bound, share got out, %; contacts, begins and ends;",
        "  turn, command apart from the hand of the delay before, deg",
        *(f"{row.scene}, {row.delay_ms} ms: {row.failure}" for row in rows[rows.failure != ""].itertuples()),
        *notes,
    ]
    columns: dict[Any, Column] = {
        "scene": Column("file"),
        **({"scheme": COLUMNS["scheme"]} if rows.scheme.nunique() > 1 else {}),
        **{delay: Column(f"{delay}", "{:.2f}") for delay in FILE_DELAYS_MS if delay in table},
        "bound": COLUMNS["bound"],
        "contacts": COLUMNS["contacts"],
        "turned": Column("turn", "{:.2f}"),
    }
    return frame_table(table, columns, notes=notes)


def _plots(options: DisplayOptions, rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.stability.figures import display_map  # noqa: PLC0415 - imports matplotlib

    del options
    display_map(judged(rows), folder / "stability_display.png", caption)


def _summary(options: DisplayOptions, rows: "DataFrame") -> dict[str, Any]:
    if options.files:
        return {"files": list(FILES)}
    origin = {"former_origin": former().attrs["origin"]} if options.held_out is None else {"held_out": options.held_out}
    return {"summary": records(summary(rows))} | origin


STUDY = Study(
    "stability --cells", _cases, rows_of, _tables, _plots, lambda case: 1.0 + 1e-3 * case[0].delay_ms, _summary, seed=0
)


def run(
    schemes: Sequence[str],
    held_out: int | None = None,
    *,
    files: bool = False,
    plots: bool = False,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress = lambda *_: None,
) -> FrameResult:
    """Run all cells with each scheme, or as many as are done when Ctrl-C stops them.

    Args:
        schemes: by name; empty for `bounded`, and with drawn cells `RIVALS` too.
        held_out: seed of drawn cells; None for the 156.
        files: the shipped files instead.
        plots: whether figures are wanted, which are of the 156.
        workers: as of `Study.result`, and `dask` and `progress` too.
    """
    if (held_out is not None or files) and plots:
        raise ConfigurationError("--plots: these cells have no figure; write them with --csv or --json")
    if held_out is not None and files:
        raise ConfigurationError("--files: not with --held-out")
    for name in schemes:
        if name not in BASELINES and name not in SCHEMES:
            raise ConfigurationError(f"--scheme: {name!r} is none of {', '.join((*SCHEMES, *BASELINES))}")
    known = schemes or (["bounded"] if held_out is None else ["bounded", *RIVALS])
    options = DisplayOptions(tuple(dict.fromkeys(known)), held_out, files)
    return STUDY.result(options, workers=workers, dask=dask, progress=progress)
