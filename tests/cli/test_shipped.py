"""The shipped files: all are listed, and a copy works as the file itself does, wherever it is."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from tests.session.systems import CONFIGS
from weberlink.cli.shipped import copy, listing
from weberlink.config import Configuration, ConfigurationError, load
from weberlink.installation import config_folders

SCHEMA = "weberlink.schema.json"
SHIPPED = sorted(path for path in CONFIGS.rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc"))


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


def test_the_wheel_has_every_file() -> None:
    project = tomllib.loads((CONFIGS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["weberlink.configs"]
    assert sorted({path for pattern in patterns for path in CONFIGS.glob(pattern) if path.is_file()}) == SHIPPED


def test_every_file_and_folder_is_listed() -> None:
    own = [path for folder in config_folders() for path in folder.iterdir() if path.suffix not in (".py", ".pyc")]
    there = {path.stem if path.suffix == ".yaml" else f"{path.name}/" if path.is_dir() else path.name for path in own}
    assert {name for name, _ in listing()} == there - {"__pycache__/"}


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_copy_has_all_that_the_file_names(path: Path, tmp_path: Path) -> None:
    written = copy(path.stem, tmp_path / "mine.yaml")
    assert (tmp_path / "mine.yaml").read_bytes() == path.read_bytes()
    assert set(written) == {each for each in tmp_path.rglob("*") if each.is_file()}
    if path.read_text(encoding="utf-8").startswith("# yaml-language-server"):
        assert (tmp_path / SCHEMA).read_bytes() == (CONFIGS / SCHEMA).read_bytes()
    here, there = of_configuration(load(path)), of_configuration(load(tmp_path / "mine.yaml"))
    for original, copied in zip(here, there, strict=True):
        if original.is_file():
            assert copied.is_relative_to(tmp_path)
            assert copied.read_bytes() == original.read_bytes()


def test_nothing_is_overwritten_and_nothing_written_in_vain(tmp_path: Path) -> None:
    assert copy("replay", tmp_path) != []
    assert copy("replay", tmp_path) == [], "what is there already stays"
    (tmp_path / "replay.yaml").unlink()
    (tmp_path / "traces" / "operator.npz").write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"operator\.npz: exists"):
        copy("replay", tmp_path)
    assert not (tmp_path / "replay.yaml").exists()
    assert (tmp_path / "traces" / "operator.npz").read_text(encoding="utf-8") == "mine"
