"""Records of telemetry that a test makes up."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import FIELDS

TICK = 1e-3


def ticks(count: int, *, start: float = 0.0, every: float = TICK, **columns: ArrayLike) -> NDArray[Any]:
    """Records of `count` ticks that are `every` [s] apart; zeros but for the `columns`, which broadcast over them."""
    made = np.zeros(count, DTYPE)
    made["at"] = start + every * np.arange(count)
    for name, values in columns.items():
        put(made[name], values)
    return made


def put(column: NDArray[Any], values: ArrayLike) -> None:
    """Fill a column; a vector of fewer axes than it has is filled up with zeros."""
    (column[..., : np.shape(values)[-1]] if column.ndim > 1 and np.ndim(values) else column)[...] = values


def phases(*parts: tuple[int, dict[str, ArrayLike]], **columns: Any) -> NDArray[Any]:
    """Records of parts that follow each other, each its ticks and its columns; `columns` hold in all."""
    made = ticks(sum(count for count, _ in parts), **columns)
    begin = 0
    for count, own in parts:
        for name, values in own.items():
            put(made[name][begin : begin + count], values)
        begin += count
    return made


def assert_whole(records: NDArray[Any]) -> None:
    """Every value of every record of the writer process is that of its own tick; but for its deadline."""
    tick = records["tick"]
    for field in FIELDS[1:]:
        expected = tick % 251 if field.kind == "u1" else tick.astype(field.kind)
        values = records[field.name]
        assert np.array_equal(values, expected if field.axes == 1 else np.repeat(expected[:, None], field.axes, axis=1))
