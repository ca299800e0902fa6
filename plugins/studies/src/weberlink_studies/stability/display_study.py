"""What is felt of a scene, as a study: all cells with some schemes, beside the schemes that were here before.

Those are `none`, `tdpa`, `mmt` and `auto`; their figures are data, with their origin.
"""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from weberlink.config import ConfigurationError
from weberlink.control.table import SCHEMES
from weberlink_studies.baselines import BASELINES
from weberlink_studies.frame import FrameResult, Study, data_frame, records
from weberlink_studies.parallel import Progress
from weberlink_studies.result import Column, frame_table
from weberlink_studies.stability.display import DisplayCell, cells, rows_of

if TYPE_CHECKING:
    from pandas import DataFrame

GHOST_S = 0.06  # A force that lasts without a contact for this much longer than the round trip is a ghost [s]
MOST_CONTACTS = 24  # the scripts make no more begins and ends of contacts than this; more is chatter
WORSE, WORSE_N = 1.1, 0.05
"""A cell is worse if its error is above that of the best scheme before by this ratio and by this force [N] too."""
KEYS = list(DisplayCell._fields)
FIGURES = (
    "ideal_error_n", "error_n", "contacts", "ghost_s", "energy_out_j", "tracking_m", "shifted_error_n",
    "impulse_ratio", "peak_n", "ripple_n", "bound_share", "failure",
)  # fmt: skip
"""Order of the stored figures."""


def former() -> "DataFrame":
    """Rows of the four schemes before; `attrs` has where they come from as `origin`."""
    stored = json.loads((files(__package__) / "former.json").read_text(encoding="utf-8"))
    frame = data_frame([
        dict(zip([*KEYS, "scheme", *FIGURES], [*row[:4], scheme, *each], strict=False))
        for row in stored["cells"]
        for scheme, each in zip(stored["schemes"], row[4:], strict=True)
    ])  # fmt: skip
    frame.attrs["origin"] = stored["origin"]
    return frame


def judged(rows: "DataFrame") -> "DataFrame":
    """Rows with the best error before (missing without one), and what is judged of each; without those that failed."""
    best = former().groupby(KEYS).error_n.min().rename("former_error_n").reset_index()
    ran = rows[rows.failure == ""].merge(best, on=KEYS, how="left")
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
    "former": Column("former", "{:.2f}"),
    "felt": Column("felt", "{:.2f}"),
    "ghost": Column("ghost", lambda seconds: f"{1e3 * seconds:.0f}"),
    "contacts": Column("contacts", "{:.0f}"),
    "out": Column("out", lambda joules: f"{1e3 * joules:.1f}"),
    "bound": Column("bound", lambda share: f"{100 * share:.0f}"),
    "apart": Column("apart", lambda metres: f"{1e3 * metres:.1f}"),
}


def _tables(schemes: Sequence[str], rows: "DataFrame", run_time_s: float, caption: str) -> RenderableType:
    del schemes
    ran = judged(rows).sort_values("delay_ms", kind="stable")
    table = ran.groupby(["delay_ms", "scene", "scheme"], sort=False).agg(
        former=("former_error_n", "mean"),
        felt=("error_n", "mean"),
        ghost=("ghost_beyond_s", "max"),
        contacts=("contacts", "max"),
        out=("energy_out_j", "max"),
        bound=("bound_share", "max"),
        apart=("tracking_m", "max"),
    )
    notes = [
        "felt: RMS of felt minus pressed in N, the delay contained, mean over links",
        "  and hands; former: that of the best of none, tdpa, mmt, auto in each cell",
        "the largest of ghost (beyond the round trip, ms), contacts",
        "  (begins and ends), out (mJ), bound (share got out, %), apart (mm)",
        *(
            f"{one.scheme}: {one.worse} of {one.compared} worse than the best before by 10 % and {WORSE_N:g} N\n"
            f"  {one.ghost} ghosts; bound kept in {one.bound_kept} of {one.cells}; {one.failed} failed\n"
            f"  at most {MOST_CONTACTS} contacts in {one.few_contacts}; up to 100 ms at most "
            f"{1e3 * one.tracking_m:.1f} mm apart"
            for one in summary(rows).itertuples()
        ),
        f"{len(rows)} runs in {run_time_s:.0f} s",
        caption,
    ]
    return frame_table(table.reset_index(), COLUMNS, notes=notes)


def _plots(schemes: Sequence[str], rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.stability.figures import display_map  # noqa: PLC0415 - imports matplotlib

    del schemes
    display_map(judged(rows), folder / "stability_display.png", caption)


def _summary(schemes: Sequence[str], rows: "DataFrame") -> dict[str, Any]:
    del schemes
    return {"summary": records(summary(rows)), "former_origin": former().attrs["origin"]}


STUDY = Study(
    "stability --cells",
    lambda schemes: [(cell, scheme) for scheme in dict.fromkeys(schemes) for cell in cells()],
    rows_of,
    _tables,
    _plots,
    lambda case: 1.0 + 1e-3 * case[0].delay_ms,
    _summary,
    seed=0,
)


def run(
    schemes: Sequence[str], *, workers: int | None = None, dask: str | None = None, progress: Progress = lambda *_: None
) -> FrameResult:
    """Run all cells, or as many as are done when Ctrl-C stops them, with each scheme; arguments as of `Study.result`."""
    for name in schemes:
        if name not in BASELINES and name not in SCHEMES:
            raise ConfigurationError(f"--scheme: {name!r} is none of {', '.join((*SCHEMES, *BASELINES))}")
    return STUDY.result(list(schemes), workers=workers, dask=dask, progress=progress)
