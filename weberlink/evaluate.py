"""The `evaluate` command: traces, predictors and Weber factors into rows, a table and figures."""

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


def run(
    traces: list[Path], predictors: str, webers: str, floor: float, *, wire: bool, plots: Path | None
) -> tuple[dict[str, Any], Table]:
    """Evaluate every combination.

    Args:
        traces: CSV files.
        predictors: names with commas between them.
        webers: Weber factors with commas between them.
        floor: absolute threshold [N].
        wire: quantize and saturate as on the wire.
        plots: folder for figures, or None.

    Returns:
        The JSON document, and the table for people.

    Raises:
        ConfigurationError: for an argument or a trace that cannot be used; nothing was computed then.
    """
    study = Study(_predictors(predictors), _webers(webers), floor, **({} if wire else UNQUANTIZED))  # type: ignore[arg-type]
    try:
        signals = [(path.stem, read_trace(path)) for path in traces]
    except TraceError as error:
        raise ConfigurationError(str(error)) from None
    rows = [row for name, trace in signals for row in study.rows(name, trace)]
    facts = environment()
    if plots is not None:
        _draw(rows, plots, footer(facts))
    document = {"floor_n": floor, "wire": wire, "rows": [row.as_json() for row in rows], "environment": facts}
    return document, _table(rows, footer(facts))


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


def _draw(rows: list[Row], folder: Path, caption: str) -> None:
    try:
        from evaluation.figures import packet_rate  # noqa: PLC0415 - heavy, and only wanted with --plots
    except ImportError:
        raise ConfigurationError('--plots: needs matplotlib; install it with: pip install "weberlink[plots]"') from None
    folder.mkdir(parents=True, exist_ok=True)
    packet_rate(rows, folder / "packet_rate.png", caption)
