"""The `stability` study: maps stiff and extreme cases, as sampled walls and as whole systems in virtual time."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import Group, RenderableType

from weberlink.cli.shipped import find
from weberlink.config import Configuration, ConfigurationError, load
from weberlink_studies.baselines import BASELINES, recorded
from weberlink_studies.frame import Row, Study
from weberlink_studies.result import Column, frame_table
from weberlink_studies.stability.cells import HEIGHT, CellTiming, SystemCell, cells, scene, timing
from weberlink_studies.stability.measured_wall import survey, walls
from weberlink_studies.stability.verdict import accounts, verdict
from weberlink_studies.stability.wall import SampledWall

if TYPE_CHECKING:
    from pandas import DataFrame

SEED = 0


class MapOptions(NamedTuple):
    """Of the map: `full` for more stiffnesses, round trips and walls."""

    full: bool = False


def rows_of(case: SampledWall | SystemCell) -> list[Row]:
    """The row of a wall or of a system."""
    if isinstance(case, SampledWall):
        return [{"kind": "wall"} | survey(case)]
    limits = case.limits() if case.scheme == "none" and not case.by_torque else {}
    return [{"kind": "system", **asdict(case), "ideal_n": case.ideal_n, **limits, **judge(case)}]


def judge(cell: SystemCell) -> Row:
    """Run a cell in virtual time; an error becomes the verdict "failed", and a range that is left "refused"."""
    try:
        when = timing(cell)
        composed = configuration(cell, when)
        records, failure = recorded(composed, cell.scheme, when.end + 1.0)
        return verdict(cell, when, records, accounts(composed.system), failure or None)
    except ConfigurationError as error:
        return {"state": "refused", "bounded": False, "failure": str(error)}
    except Exception as error:  # one broken cell must not end the map
        return {"state": "failed", "bounded": False, "failure": f"{type(error).__name__}: {error}"}


def configuration(cell: SystemCell, when: CellTiming) -> Configuration:
    """The shipped default with the parameters of the cell and a scene of one object; the two arms for joints."""
    return load(find("arms" if cell.robot == "arm" else "loopback"), overrides(cell, when))


def overrides(cell: SystemCell, when: CellTiming) -> list[str]:
    """What differs from the shipped default, as the command line takes it: "path.to.key=value" each."""
    one_way_ms, jitter_ms = 500.0 * cell.round_trip_s, 1e3 * cell.jitter_s
    home, steps = [0.0, 0.0, HEIGHT], list(when.steps)
    hand = cell.wall.hand.model_dump(mode="json")
    values: dict[str, Any] = {
        "link.emulate": {"delay_ms": one_way_ms, "jitter_ms": jitter_ms, "loss": cell.loss, "seed": cell.seed},
        "link.silence_ms": 200.0,
        "link.longest_round_trip_ms": 400.0 + 2.0 * (one_way_ms + jitter_ms),
        "control.scheme": "none" if cell.scheme in BASELINES else cell.scheme,
    }
    if cell.robot == "arm":
        values |= {
            "codec.joints.angle.coupling_nm_rad": cell.stiffness_n_m,
            "slave.robot.stiffness_nm_rad": cell.stiffness_n_m,
            "master.device.script": steps,
            "master.device.repeat": False,
        }
        return [f"{path}={json.dumps(value)}" for path, value in values.items()]
    robot: dict[str, Any] = {"driver": "point"}
    if cell.robot == "simulated":
        robot = {"driver": "simulated", "mass_kg": cell.robot_mass_kg, "damping_n_s_m": cell.robot_damping_n_s_m}
    if cell.robot == "tool":  # a stick of 6 cm that touches with its ends and its middle
        robot |= {"tool": {"points_m": [[x, 0.0, 0.0] for x in (0.03, 0.0, -0.03)], "torque_n_m": 2.0}}
        values |= {"codec.rotation": {}, "master.limits.torque_nm": 0.5}
    turned = {"wrist": {}, "torque_n_m": 0.5} if cell.robot == "tool" else {}
    values |= {
        "rate_hz": cell.rate_hz,
        "codec.force.predictor": cell.predictor,
        "codec.force.weber": cell.weber,
        "codec.force.floor_n": cell.floor_n,
        "codec.position.predictor": cell.position_predictor,
        "codec.position.weber": cell.weber,
        "codec.position.bound_m": cell.bound_m,
        # No tremor: every oscillation during the hold then comes from the loop.
        "master.device": {"driver": "operator", "hand": hand, "tremor_m": 0.0, "home_m": home, "repeat": False}
        | {"script": steps}
        | turned,
        "master.limits.device_ms": max(20.0, 3e3 / cell.rate_hz),
        "slave.limits.robot_ms": max(20.0, 3e3 / cell.rate_hz),
        "slave.robot": robot | {"home_m": home},
        "slave.scene": scene(cell),
    }
    return [f"{path}={json.dumps(value)}" for path, value in values.items()]


def span(scale: float, form: str) -> Any:
    """A function from values to the text "least-largest", or one number where both are alike; None for no value."""

    def text(values: Any) -> str | None:
        known = scale * values.dropna()
        if not len(known):
            return None
        low, high = f"{known.min():{form}}", f"{known.max():{form}}"
        return low if low == high else f"{low}..{high}" if low.startswith("-") else f"{low}-{high}"

    return text


SYSTEMS = {
    "family": Column("scene"),
    "scheme": Column("scheme", left=True),
    "calm": Column("calm"),
    "felt": Column("felt"),
    "impulse": Column("impulse"),
    "drift": Column("drift", "{:.1f}"),
    "out": Column("out", "{:.2g}"),
    "bound": Column("bound", "{:.0f}"),
    "limited": Column("lim", "{:.0f}"),
}
EXTREMES = (
    {"case": Column("extreme")}
    | {name: SYSTEMS[name] for name in list(SYSTEMS)[1:]}
    | {"calm": Column("state", left=True)}
)


def summary(systems: "DataFrame", by: list[str]) -> "DataFrame":
    """Figures of groups of systems, as they are printed."""
    known = ["felt", "impulse_ratio", "drift_m", "energy_out_j", "bound_share", "failure"]
    systems = systems.reindex(columns=[*dict.fromkeys([*systems.columns, *known])])
    systems = systems.assign(limited=systems.saturated.map(lambda limits: int(bool(limits)), na_action="ignore"))
    found = systems.groupby(by, sort=False).agg(
        bounded=("bounded", "sum"),
        count=("bounded", "size"),
        state=("state", "first"),
        felt=("felt", span(100.0, ".0f")),
        impulse=("impulse_ratio", span(100.0, ".0f")),
        drift=("drift_m", lambda values: 1e3 * values.max()),
        out=("energy_out_j", "max"),
        bound=("bound_share", lambda values: 100.0 * values.max()),
        limited=("limited", "sum"),
    )
    calm = found.bounded.astype(str) + "/" + found["count"].astype(str)
    found["calm"] = calm.mask(found["count"] == 1, found.state)
    return found.reset_index()


def _tables(options: MapOptions, rows: "DataFrame", run_time_s: float, caption: str) -> RenderableType:
    del options
    parts: list[RenderableType] = []
    systems, surveyed = rows[rows.kind == "system"], rows[rows.kind == "wall"]
    notes = [f"{len(systems)} systems and {len(surveyed)} walls in {run_time_s:.0f} s", caption]
    if len(surveyed):
        wrong = surveyed.passive_but_active.sum()
        low, high = surveyed.stable_to_n_m.min(), surveyed.stable_to_n_m.max()
        notes = [
            f"walls: limit measured within {surveyed.deviation.abs().max():.1%} of the eigenvalues', "
            f"{low:.2g} to {high:.2g} N/m",
            f"active on the passive side of Colgate's bound: {wrong:.0f}",
            *notes,
        ]
    if "bound_kept" in systems:
        kept = systems[(systems.scheme == "bounded") & systems.bound_kept.notna()].bound_kept
        notes = [f"bounded: the account's bound is kept in {kept.sum()} of {len(kept)}", *notes]
    legend = [
        "calm: settled, decaying or driven; felt: force held, % of that on the ideal wall",
        "  (moving wall, torque: impulse); impulse: on hand over that on robot, %",
        "drift: largest, mm; out: J got out since the press; bound: largest share of the",
        "  account's bound got out, %; lim: limited at operator, sensor or contact",
    ]
    extreme = systems[systems.family == "extremes"]
    mapped = systems[systems.family != "extremes"]
    if len(mapped):
        table = summary(mapped, ["family", "scheme"])
        parts.append(frame_table(table, SYSTEMS, notes=legend if len(extreme) else [*legend, *notes]))
    if len(extreme):
        parts += ["", frame_table(summary(extreme, ["case", "scheme"]), EXTREMES, notes=notes)]
    return Group(*parts) if parts else "\n".join(notes)


def _plots(options: MapOptions, rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.stability.figures import stability_map, stability_wall  # noqa: PLC0415 - imports matplotlib

    del options
    stability_wall(rows[rows.kind == "wall"], folder / "stability_wall.png", caption)
    stability_map(rows[rows.kind == "system"], folder / "stability_map.png", caption)


STUDY: Study[MapOptions, SampledWall | SystemCell] = Study(
    "stability",
    lambda options: [*walls(full=options.full), *cells(SEED, full=options.full)],
    rows_of,
    _tables,
    _plots,
    lambda case: 1.5e-4 * timing(case).end * case.rate_hz if isinstance(case, SystemCell) else 1.0,
    lambda options, _: {"full": options.full},
    SEED,
)
