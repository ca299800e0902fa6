"""The driver of docs/how-to/driver.md: its code is installed as another package, and run."""

import re
import sys
import tomllib
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from tests.program import weberlink
from tests.session.packages import add_drivers, install
from tests.session.systems import CONFIGS

PAGE = (CONFIGS.parent / "docs" / "how-to" / "driver.md").read_text(encoding="utf-8")


def block(language: str, containing: str = "") -> str:
    """The one block of the page in a language that contains something."""
    (found,) = (text for text in re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S) if containing in text)
    return str(found)


MODULES = {
    "paddle": block("python", "class Paddle("),
    "paddle_board": block("python", "class PaddleBoard("),
    "slow_point": block("python", "class SlowPoint("),
    "paddle_commands": block("python", "def sends("),
}
board = sys.modules["paddle_board"] = ModuleType("paddle_board")
exec(MODULES["paddle_board"], board.__dict__)
page: dict[str, Any] = {"__name__": __name__}
exec(block("python", "ForceDeviceContract"), page)


@pytest.fixture(autouse=True)
def guest(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package of the page as pip would leave it."""
    project = tomllib.loads(block("toml"))["project"]
    entry_points = "\n".join(
        f"[{group}]\n" + "\n".join(f"{name} = {value}" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    )
    add_drivers(install(tmp_path_factory.mktemp("site"), project["name"], MODULES, entry_points), monkeypatch)
    yield
    for name in MODULES.keys() - {"paddle_board"}:
        sys.modules.pop(name, None)


@pytest.mark.realtime
class TestPaddle(page["TestPaddle"]): ...  # type: ignore[misc, name-defined]


class TestSlowPoint(page["TestSlowPoint"]): ...  # type: ignore[misc, name-defined]


def test_study_and_command_are_there_and_run() -> None:
    assert weberlink("swing", "--hertz", 2).output == "2 Hz\n"
    pytest.importorskip("weberlink_studies")
    told = weberlink("study", "sends", "--seconds", 0.3).output.splitlines()
    assert [line.partition(":")[0] for line in told] == ["zoh", "linear"] and all("completed" in line for line in told)
