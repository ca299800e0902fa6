"""The commands of the page: arguments, scenes, the unit, what they import; and when the monitor's program ends."""

import asyncio
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.compiled import COMPILED
from tests.program import weberlink
from tests.session.systems import configuration
from tests.test_operation import assert_accepted_and_little_exposed, assert_starts_a_command
from weberlink.session.simulation import TraceRecorder
from weberlink_figures.reporting import simulated
from weberlink_page import program
from weberlink_page.launcher import SCENES
from weberlink_page.program import end_when_left

CONFIGS = Path(__file__).parents[1] / "configs"
UNIT = CONFIGS / "weberlink-monitor.service"
OTHERS = ("aioice", "foxglove", "mcap", "pylibfranka", "rosbags", "segno", "twisted", "websockets", "wormhole", "zenoh")
WRONG = {
    "monitor --port 70000": ("--port", 2),
    "try --scene moon": ("--scene moon", 2),
    "try --listen 192.0.2.1 --public": ("--listen 192.0.2.1", 1),
    **{
        f"{command} --listen {address}": (f"--listen {address}", 2)
        for command in ("try", "monitor")
        for address in ("0.0.0.0", "::", "192.0.2.1")
    },
}


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_argument_is_one_line_that_names_it(line: str) -> None:
    field, status = WRONG[line]
    assert field in weberlink(*line.split()).complaint(status)


def test_they_import_nothing_of_other_guests() -> None:
    told = "import sys, weberlink.cli, weberlink_page.program; print(*sys.modules)"
    there = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout.split()
    assert "aiohttp" in there
    guests = {name.partition(".")[0] for name in there if name.startswith("weberlink_")} - {COMPILED}
    assert guests <= {"weberlink_figures", "weberlink_page", "weberlink_pointer"}
    assert not set(OTHERS) & {*there}


def test_the_unit_starts_the_monitor_and_is_little_exposed(tmp_path: Path) -> None:
    assert_starts_a_command(UNIT)
    assert_accepted_and_little_exposed(UNIT, tmp_path)


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_to_try_is_felt(name: str) -> None:
    trace = TraceRecorder()
    figures = simulated(configuration(*SCENES[name].overrides, file=CONFIGS / "try.yaml"), 2.5, trace.add)
    assert (figures.outcome, figures.faults) == ("completed", {"master": {}, "slave": {}})
    assert figures.felt.packets > 2
    assert 0.5 < np.linalg.norm(trace.trace.force_n, axis=1).max() < 10.0


LIMIT_S = 60.0


class Pages:
    """How many pages are open; each look takes a second."""

    def __init__(self, opened: list[tuple[float, float]], until: float) -> None:
        self.now, self._opened, self._until = 0.0, opened, until

    def __len__(self) -> int:
        self.now += 1.0
        if self.now > self._until:
            raise EOFError
        return sum(begin <= self.now < end for begin, end in self._opened)


@pytest.mark.parametrize(
    ("opened", "ends_at"),
    [
        ([], None),  # nobody has come yet
        ([(5, 10), (69, 80), (139, 1000)], None),  # opened again just within the time
        ([(5, 1000), (5, 20)], None),  # another one
        ([(5, 10)], 70),
        ([(5, 10), (71, 80)], 70),
    ],
)
def test_page_that_stays_closed_ends_the_visit(
    opened: list[tuple[float, float]], ends_at: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages, said = Pages(opened, 500.0), list[str]()
    monkeypatch.setattr(program, "monotonic", lambda: pages.now)

    async def run() -> bool:
        over = asyncio.Event()
        try:
            await end_when_left(pages, LIMIT_S, over, said.append, 0.0)
        except EOFError:
            assert not over.is_set()
        return over.is_set()

    assert asyncio.run(run()) is (ends_at is not None)
    assert len(said) == (ends_at is not None)
    assert ends_at is None or pages.now == pytest.approx(ends_at, abs=1.0)
