"""The files of shipped recordings: every decimal digit of a table, in about a seventh of the CSV.

An archive is a ZIP file with LZMA members, which `numpy.load` reads. A recording has two members: `NAME`, the changes
from row to row of the table in units of the last digit, with the bytes of equal weight side by side, shape (7, 8, n);
and `NAME.digits`, the number of decimals of each column, shape (7,).
"""

import io
import zipfile
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DIGITS = ".digits"
_STAMP = (1980, 1, 1, 0, 0, 0)
"""Of every member, so that equal tables give equal files."""


def write(path: Path, tables: Mapping[str, Sequence[Sequence[str]]]) -> None:
    """Write an archive.

    Args:
        path: of the archive.
        tables: rows of decimal numbers by name, 7 columns; every digit is kept.

    Raises:
        ValueError: a number has too many digits to be kept.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        for name, rows in tables.items():
            columns = [[Decimal(cell) for cell in column] for column in zip(*rows, strict=True)]
            digits = [max(0, *(-int(cell.as_tuple().exponent) for cell in column)) for column in columns]
            units = np.array(
                [[int(cell.scaleb(count)) for cell in column] for column, count in zip(columns, digits, strict=True)]
            )
            if np.abs(units).max(initial=0) >= 2**53 or max(digits) > 22:
                raise ValueError(f"{name}: expected numbers of at most 15 digits")
            changes = np.diff(units, axis=1, prepend=0).astype("<i8")
            split = changes.view(np.uint8).reshape(*changes.shape, 8).transpose(0, 2, 1)
            for member, array in ((name, split), (name + DIGITS, np.array(digits, np.int8))):
                memory = io.BytesIO()
                np.save(memory, np.ascontiguousarray(array))
                info = zipfile.ZipInfo(f"{member}.npy", _STAMP)
                info.compress_type = zipfile.ZIP_LZMA
                archive.writestr(info, memory.getvalue())


def names(path: Path) -> list[str]:
    """The recordings of an archive, in its order."""
    with zipfile.ZipFile(path) as archive:
        members = [member.removesuffix(".npy") for member in archive.namelist()]
    return [member for member in members if not member.endswith(DIGITS)]


def read(path: Path, name: str) -> Array:
    """One recording, shape (n, 7): the numbers that the decimals of its table stand for, to the last bit."""
    with np.load(path) as archive:
        split, digits = archive[name], archive[name + DIGITS]
    changes = np.ascontiguousarray(split.transpose(0, 2, 1)).view("<i8")[..., 0]
    scales = np.array([10.0 ** int(count) for count in digits])
    table: Array = np.cumsum(changes, axis=1).T / scales
    return table
