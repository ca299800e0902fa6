"""The shipped files, also of the installed guests: all are listed, in the wheel, and copied with what they name."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from tests.program import ROOT, weberlink
from tests.session.systems import CONFIGS
from weberlink.cli.shipped import copy, listing
from weberlink.config import Configuration, ConfigurationError, load
from weberlink.installation import config_folders
from weberlink.protocol.keys import generate

SCHEMA = "weberlink.schema.json"
PYTHON = (".py", ".pyc")
FOLDERS = [CONFIGS, *(folder for folder in config_folders() if folder.parent.parent == ROOT / "plugins")]
# The address of the robot is for the reader to put in; drivers of hardware say what is uncertain of it.
WARNED = {"lan": {"link.slave"}, "phantom": {"master.device"}}
FILES = sorted(path for folder in FOLDERS for path in folder.glob("*.yaml"))


def paths_in(settings: Any) -> Iterator[Path]:
    """All paths among settings."""
    if isinstance(settings, Path):
        yield settings
    if isinstance(settings, BaseModel):
        settings = [*dict(settings).values(), *(settings.model_extra or {}).values()]
    if isinstance(settings, (tuple, list)):
        for value in settings:
            yield from paths_in(value)


def of_configuration(found: Configuration) -> list[Path]:
    options = [part.options for part in (found.device, found.robot) if part is not None]
    return [path for settings in (found.system, *options) for path in paths_in(settings)]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.parent.name)
def test_the_wheel_has_every_file(folder: Path) -> None:
    project = tomllib.loads((folder.parent / "pyproject.toml").read_text(encoding="utf-8"))
    package = "weberlink" if folder == CONFIGS else f"weberlink_{folder.parent.name}"
    patterns = project["tool"]["setuptools"]["package-data"][f"{package}.configs"]
    files = {path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()}
    assert {path for pattern in patterns for path in folder.glob(pattern) if path.is_file()} == {
        path for path in files if path.suffix not in PYTHON
    }


def test_every_file_and_folder_is_listed() -> None:
    own = [path for folder in config_folders() for path in folder.iterdir() if path.suffix not in PYTHON]
    there = {path.stem if path.suffix == ".yaml" else f"{path.name}/" if path.is_dir() else path.name for path in own}
    assert {name for name, _ in listing()} == there - {"__pycache__/"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_copy_is_valid_and_has_all_that_the_file_names(path: Path, tmp_path: Path) -> None:
    key, mine = tmp_path / "key", tmp_path / "here" / "mine.yaml"
    generate(key)
    mine.parent.mkdir()
    written = copy(path.stem, mine)
    assert set(written) == {each for each in mine.parent.rglob("*") if each.is_file()}
    for each in written:
        folder = CONFIGS if each.name == SCHEMA else path.parent
        original = path if each == mine else folder / each.relative_to(mine.parent)
        assert each.read_bytes() == original.read_bytes()
    assert (mine.with_name(SCHEMA) in written) is path.read_text(encoding="utf-8").startswith("# yaml-language-server")
    for original, copied in zip(of_configuration(load(path)), of_configuration(load(mine)), strict=True):
        assert copied in written or not original.is_file()
    ended = weberlink("check", mine, "--set", f"link.key_file={key}")
    assert (ended.status, ended.errors) == (0, "")
    lines = ended.output.splitlines()
    assert "mine.yaml: valid" in " ".join(ended.output.split())
    channels = 4 if {"rotation", "gripper"} & {line.partition(" ")[0] for line in lines} else 2
    assert len(re.findall(r"update of \d+.* bytes of UDP payload", ended.output)) == channels
    warned = {line.split()[1].rstrip(":") for line in lines if line.startswith("warning")}
    assert warned == WARNED.get(path.stem, set()) or path.parent != CONFIGS


def test_nothing_is_overwritten_and_nothing_written_in_vain(tmp_path: Path) -> None:
    assert copy("replay", tmp_path) != []
    assert copy("replay", tmp_path) == [], "what is there already stays"
    (tmp_path / "replay.yaml").unlink()
    (tmp_path / "traces" / "operator.npz").write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"operator\.npz: exists"):
        copy("replay", tmp_path)
    assert not (tmp_path / "replay.yaml").exists()
    assert (tmp_path / "traces" / "operator.npz").read_text(encoding="utf-8") == "mine"
