"""The shipped file is one that the program takes, and copies with all that it names."""

from pathlib import Path

import pytest

from tests.program import weberlink
from weberlink.cli.shipped import copy

FILE = Path(__file__).parents[1] / "configs" / "franka.yaml"


def test_the_file_is_valid() -> None:
    pytest.importorskip("pylibfranka", reason="pylibfranka has no release for this Python")
    ended = weberlink("check", FILE)
    assert ended.status == 0
    assert "franka" in ended.output


def test_a_copy_has_the_schema_beside_it(tmp_path: Path) -> None:
    written = copy("franka", tmp_path)
    assert {path.name for path in written} == {"franka.yaml", "weberlink.schema.json"}
    assert (tmp_path / "franka.yaml").read_text() == FILE.read_text()
