"""The shipped recordings: their archives, names and licences."""

from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.studies import recordings
from weberlink.studies.recordings import archive
from weberlink.studies.recordings.catalogue import DATA

MOST_BYTES = 3_000_000
"""All archives together; they are part of the wheel."""

decimals = st.decimals(min_value=-1000, max_value=1000, allow_nan=False, allow_infinity=False, places=11).map(str)


@examples(30)
@given(rows=st.lists(st.lists(decimals, min_size=7, max_size=7), min_size=1, max_size=20))
def test_an_archive_keeps_every_digit(rows: list[list[str]], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("archive") / "some.npz"
    archive.write(path, {"a": rows, "b": rows[:1]})
    assert archive.names(path) == ["a", "b"]
    assert archive.read(path, "a").tolist() == [[float(cell) for cell in row] for row in rows]
    assert archive.read(path, "b").shape == (1, 7)


def test_a_number_of_too_many_digits_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="digits"):
        archive.write(tmp_path / "some.npz", {"a": [["1.23456789012345678"] * 7]})


def test_equal_tables_give_equal_files(tmp_path: Path) -> None:
    rows = [[str(Decimal(row) / 8)] * 7 for row in range(9)]
    for name in ("one", "other"):
        archive.write(tmp_path / name, {"a": rows})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


@pytest.mark.parametrize("name", recordings.names())
def test_a_recording_is_a_signal_in_si_units(name: str) -> None:
    trace = recordings.load(name)
    assert recordings.source_of(name).name == name.rstrip("0123456789").rpartition("_")[0].removesuffix(
        "".join(f"_{what}" for what in ("rigid", "foam", "spring", "free") if f"_{what}_" in name)
    )
    assert 4.0 < trace.duration_s < 25.0
    assert 0.99e-3 < trace.period_s < 5.1e-3
    assert np.ptp(trace.position_m, axis=0).max() < 1.0
    assert 0.05 < np.abs(trace.force_n).max() < 100.0
    assert not len(trace.gaps_s) or name.startswith("panda")


def test_names_are_different_and_unknown_ones_are_refused() -> None:
    listed = recordings.names()
    assert len(set(listed)) == len(listed) == 41
    with pytest.raises(KeyError, match="no shipped recording"):
        recordings.load("tue_rigid_99")


def test_archives_are_small_and_have_their_licence_and_source() -> None:
    assert sum(source.archive.stat().st_size for source in recordings.SOURCES.values()) < MOST_BYTES
    page, licence = (DATA / "README.md").read_text(encoding="utf-8"), (DATA / "MIT.txt").read_text(encoding="utf-8")
    for source in recordings.SOURCES.values():
        count = len(source.recordings())
        assert f"| `{source.archive.name}` | {count} | {source.repository} | {source.licence} |" in page
        assert source.licence == "Apache-2.0" or f"for {source.archive.name}" in licence
    assert {path.name for path in DATA.iterdir()} == {
        "README.md", "MIT.txt", *(source.archive.name for source in recordings.SOURCES.values())
    }  # fmt: skip
