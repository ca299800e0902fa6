"""The driver of docs/how-to/driver.md: its code is installed as another package, and run."""

import re
import sys
import tomllib
from collections.abc import Iterator
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.cli.packages import add_drivers
from tests.hardware.helpers import Answering
from tests.session.packages import install
from tests.session.systems import CONFIGS
from weberlink.geometry.vector import Vector

PAGE = (CONFIGS.parent / "docs" / "how-to" / "driver.md").read_text(encoding="utf-8")
SWING_M = 0.02
YIELDS_M_N = 0.0003


def block(language: str, containing: str = "") -> str:
    """The one block of the page in a language that contains something."""
    (found,) = (text for text in re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S) if containing in text)
    return str(found)


class PaddleBoard(Answering):
    """In a hand that swings to and fro and yields; its motor stops by itself when it has not heard a line for 50 ms."""

    def __init__(self) -> None:
        super().__init__()
        self._commanded_n = 0.0
        self._heard_at = -inf
        self._text = b""
        self._origin: float | None = None

    @property
    def force(self) -> Vector:
        """That its motor makes [N]."""
        return (0.0, self._commanded_n if monotonic() - self._heard_at <= 0.05 else 0.0, 0.0)

    def receive(self, data: bytes, now: float) -> None:
        self._origin = self._origin or now
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            self._commanded_n, self._heard_at = 1e-3 * int(line), now
            phase = (now - self._origin) % 2.0
            position = SWING_M * (1.0 - 2.0 * abs(phase - 1.0)) + YIELDS_M_N * self.force[1]
            self.answers.append(b"%d\n" % round(1e6 * position))


page: dict[str, Any] = {"PaddleBoard": PaddleBoard, "__name__": __name__}
exec(block("python", "ForceDeviceContract"), page)


@pytest.mark.realtime
class TestPaddle(page["TestPaddle"]):  # type: ignore[misc, name-defined]
    """The test of the page, with its driver installed."""

    @pytest.fixture(autouse=True)
    def _driver(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
        """The package of the page as pip would leave it."""
        project = tomllib.loads(block("toml"))["project"]
        entry_points = "\n".join(
            f"[{group}]\n" + "\n".join(f"{name} = {value}" for name, value in entries.items())
            for group, entries in project["entry-points"].items()
        )
        modules = {"paddle": block("python", "class Paddle(")}
        add_drivers(install(tmp_path, project["name"], modules, entry_points), monkeypatch)
        yield
        sys.modules.pop("paddle", None)
