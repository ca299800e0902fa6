"""The files that the installed guests ship: each is valid, in the wheel, and copied with all that it names."""

import tomllib
from pathlib import Path

import pytest

from tests.program import ROOT, weberlink
from weberlink.cli.shipped import copy
from weberlink.config import ConfigurationError
from weberlink.installation import config_folders
from weberlink.protocol.keys import generate

FOLDERS = [folder for folder in map(Path, config_folders()) if folder.parent.parent == ROOT / "plugins"]
SCHEMA = "weberlink.schema.json"
OTHERS = (".py", ".pyc")
FILES = sorted(path for folder in FOLDERS for path in folder.glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_is_valid_and_copied_with_all_that_it_names(path: Path, tmp_path: Path) -> None:
    key, mine = tmp_path / "key", tmp_path / "mine"
    generate(key)
    mine.mkdir()
    try:
        written = copy(path.stem, mine)
    except ConfigurationError as error:
        pytest.skip(str(error))  # a library has no release for this Python
    assert set(written) == {each for each in mine.rglob("*") if each.is_file()}
    for each in written:
        kept = ROOT / "configs" if each.name == SCHEMA else path.parent
        assert each.read_bytes() == (kept / each.relative_to(mine)).read_bytes()
    assert ((mine / SCHEMA) in written) is path.read_text(encoding="utf-8").startswith("# yaml-language-server")
    ended = weberlink("check", mine / path.name, "--set", f"link.key_file={key}")
    assert (ended.status, ended.errors) == (0, "")


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.parent.name)
def test_the_wheel_has_every_file(folder: Path) -> None:
    project = tomllib.loads((folder.parent / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"][f"weberlink_{folder.parent.name}.configs"]
    files = {
        path for path in folder.rglob("*") if path.is_file() and path.suffix not in OTHERS and not path.is_symlink()
    }
    assert {path for pattern in patterns for path in folder.glob(pattern)} == files
