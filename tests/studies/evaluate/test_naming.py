"""Names of traces: short, and all different."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.evaluate.naming import names

parts = st.sampled_from(["a", "b", "run", "run.csv"])
paths = st.builds(lambda folders, stem, end: Path("/", *folders, stem + end), st.lists(parts, max_size=3), parts,
                  st.sampled_from([".csv", ".mcap", ""]))  # fmt: skip


@pytest.mark.parametrize(
    ("listed", "expected"),
    [
        (["/x/one.csv", "/y/two.csv"], ["one", "two"]),
        (["/x/run.csv", "/y/run.csv", "/y/other.csv"], ["x/run", "y/run", "other"]),
        (["/x/run.csv", "/x/run.mcap"], ["run.csv", "run.mcap"]),
        (["/x/k/run.csv", "/y/k/run.csv"], ["x/k/run", "y/k/run"]),
        (["/x/run.csv", "/x/run.mcap", "/y/run.csv"], ["x/run.csv", "x/run.mcap", "y/run.csv"]),
        (["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"], ["/x/run.csv", "/x/run.mcap", "/x/run.csv.csv"]),
    ],
)
def test_a_name_is_as_long_as_it_takes(listed: list[str], expected: list[str]) -> None:
    assert names([Path(each) for each in listed]) == expected


@given(st.lists(paths, unique_by=str, max_size=6))
def test_different_files_have_different_names(listed: list[Path]) -> None:
    found = names(listed)
    assert len(set(found)) == len(found) == len(listed)
