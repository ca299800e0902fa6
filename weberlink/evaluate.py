"""The `evaluate` command: traces, predictors and Weber factors into rows, a table and figures."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.table import Table

from codec.predictors import HYBRID, PREDICTORS
from evaluation.environment import environment, footer
from evaluation.traces import Row, Study
from master.trace import TraceError, read_trace
from weberlink.configuration import ConfigurationError

UNQUANTIZED = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}
"""Steps far below any sensor's noise, without a range."""


@dataclass(frozen=True)
class Evaluation:
    """The rows of all combinations, and how they are shown."""

    rows: list[Row]
    document: dict[str, Any]
    table: Table
    caption: str

    def draw(self, folder: Path) -> None:
        """Write the figures.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from evaluation.figures import packet_rate  # noqa: PLC0415 - heavy, and only wanted with --plots

        folder.mkdir(parents=True, exist_ok=True)
        packet_rate(self.rows, folder / "packet_rate.png", self.caption)


def run(traces: list[Path], predictors: str, webers: str, floor: float, *, wire: bool, plots: bool) -> Evaluation:
    """Evaluate every combination.

    Args:
        traces: CSV files.
        predictors: names with commas between them.
        webers: Weber factors with commas between them.
        floor: absolute threshold [N].
        wire: quantize and saturate as on the wire.
        plots: whether figures will be wanted.

    Raises:
        ConfigurationError: for an argument or a trace that cannot be used; nothing was computed then.
    """
    if plots and find_spec("matplotlib") is None:
        raise ConfigurationError('--plots: needs matplotlib; install it with: pip install "weberlink[plots]"')
    study = Study(_predictors(predictors), _webers(webers), floor, **({} if wire else UNQUANTIZED))  # type: ignore[arg-type]
    try:
        signals = [(path.stem, read_trace(path)) for path in traces]
    except TraceError as error:
        raise ConfigurationError(str(error)) from None
    rows = [row for name, trace in signals for row in study.rows(name, trace)]
    facts = environment()
    document = {"floor_n": floor, "wire": wire, "rows": [row.as_json() for row in rows], "environment": facts}
    return Evaluation(rows, document, _table(rows, footer(facts)), footer(facts))


def _predictors(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    known = [*PREDICTORS, HYBRID]
    for name in names:
        if name not in known:
            raise ConfigurationError(f"--predictor: {name!r} is none of {', '.join(known)}")
    return names


def _webers(text: str) -> list[float]:
    try:
        factors = [float(part) for part in text.split(",")]
    except ValueError:
        raise ConfigurationError(f"--weber: must be numbers with commas between them, not {text!r}") from None
    for factor in factors:
        if not 0.0 <= factor <= 1.0:
            raise ConfigurationError(f"--weber: must be 0 to 1, not {factor:g}")
    return factors


def _table(rows: list[Row], caption: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), caption=caption, caption_justify="left")
    for name in ("trace", "predictor", "k", "packets/s", "fewer", "RMS N", "max N", "max JND", "us/tick"):
        table.add_column(name, justify="left" if name in ("trace", "predictor") else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.trace,
            row.predictor,
            f"{row.weber:g}",
            f"{row.packets_per_s:.1f}",
            f"{100 * row.reduction:.1f} %",
            f"{row.error_rms_n:.3f}",
            f"{row.error_max_n:.3f}",
            f"{row.jnd_max:.2f}",
            f"{row.tick_us:.1f}",
        )
    return table
