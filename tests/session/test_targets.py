"""Targets of a long run are tried before it, and nothing is left behind."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from weberlink.session.targets import TargetError, check_file, check_folder


def test_good_targets_leave_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "old.json").write_text("kept")
    os.mkfifo(tmp_path / "pipe")
    before = sorted(path.name for path in tmp_path.iterdir())
    for name in ("new.json", "old.json", "pipe"):
        check_file(tmp_path / name)
    check_file(Path("/dev/null"))
    check_folder(tmp_path)
    check_folder(tmp_path / "made" / "later")
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert (tmp_path / "old.json").read_text() == "kept"


@pytest.mark.parametrize(
    ("check", "name", "told"),
    [
        (check_file, ".", "is a folder; give the name of a file"),
        (check_file, "file/a", "is not a folder; create it first"),
        (check_file, "a" * 300, "give a shorter name"),
        (check_file, "/sys/a", "give another place"),
        (check_folder, "file", "is not a folder; give another place"),
        (check_folder, "/sys/plots", "give another place"),
    ],
)
def test_bad_targets_say_what_to_do(check: Callable[[Path], None], name: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TargetError, match=told):
        check(tmp_path / name)
