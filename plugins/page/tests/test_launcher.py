"""The session that a page starts, with a small program in the place of `weberlink loopback`."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from signal import SIGINT
from time import monotonic
from typing import Any

import pytest

from tests.wait import in_loop
from weberlink_page.launcher import SceneChoice, SessionLauncher, TryOrder

SCENES = {"dome": SceneChoice("A dome", ()), "box": SceneChoice("A box", ("slave.scene=box",))}
# Notes its arguments, and runs until it is told to end, or as long as --duration says.
PROGRAM = """
import json, os, signal, sys, time
if "wrong=1" in sys.argv:
    sys.exit("weberlink: wrong: no such key")
caught = []
signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
with open(sys.argv[1], "a") as notes:
    notes.write(json.dumps([os.getpid(), os.getsid(0), sys.argv[2:]]) + "\\n")
limit = float(sys.argv[sys.argv.index("--duration") + 1]) if "--duration" in sys.argv else 60.0
until = time.monotonic() + limit
while not caught and time.monotonic() < until:
    time.sleep(0.01)
if "stopped=1" in sys.argv:
    json.dump({"outcome": "failed: emergency stop"}, sys.stdout)
    sys.exit(1)
json.dump({"outcome": "interrupted" if caught else "completed", "ticks": 7}, sys.stdout)
sys.exit(1 if "failing=1" in sys.argv else 0)
"""


class Told:
    def __init__(self, notes: Path, order: TryOrder) -> None:
        self.notes = notes
        self.lines: list[str] = []
        self.messages: list[dict[str, Any]] = []
        self.inherited: list[tuple[str, str]] = []
        program = (sys.executable, "-S", "-c", PROGRAM, str(notes))
        self.interrupted = asyncio.Event()
        self.launcher = SessionLauncher(order, self.lines.append, self.messages.append, self._inherit, program)

    def interrupt(self) -> None:
        self.launcher.signal(SIGINT)
        self.interrupted.set()

    async def _inherit(self, former: str | None, name: str) -> None:
        self.inherited.append((former, name))

    @property
    def started(self) -> list[tuple[int, int, list[str]]]:
        """Process, session of processes, and arguments of each program that has begun."""
        return [json.loads(line) for line in self.notes.read_text().splitlines()] if self.notes.exists() else []

    async def until_begun(self, number: int) -> int:
        """Wait until that many have begun; returns the process id of the last."""
        while min(len(self.started), len(self.launcher.started)) < number:
            await asyncio.sleep(0.01)
        self.launcher.note_running(str(self.started[-1][0]))
        return self.started[-1][0]

    @property
    def ended(self) -> tuple[int, dict[str, Any] | None]:
        assert self.launcher.last is not None
        return self.launcher.last.status, self.launcher.last.report


def order(*overrides: str, duration_s: float | None = None) -> TryOrder:
    return TryOrder("try.yaml", overrides, SCENES, "dome", duration_s)


@asynccontextmanager
async def visit(folder: Path, order: TryOrder) -> AsyncIterator[Told]:
    """A visit, which is over at the end of the `with`."""
    told = Told(folder / "notes", order)
    running = asyncio.create_task(told.launcher.run(told.interrupted))
    yield told
    await running


@in_loop
async def test_interrupted_visit_ends_with_the_report(tmp_path: Path) -> None:
    async with visit(tmp_path, order("a=1")) as told:
        await told.until_begun(1)
        told.interrupt()
    ((pid, group, arguments),) = told.started
    assert arguments == ["loopback", "try.yaml", "--json", "-", "--set", "a=1"]
    assert pid == group, "Ctrl-C does not reach it"
    assert told.ended == (0, {"outcome": "interrupted", "ticks": 7})
    assert [message["state"] for message in told.messages] == ["starting", "running", "idle"]


@in_loop
async def test_another_scene_is_another_session_and_one_is_started_at_a_time(tmp_path: Path) -> None:
    async with visit(tmp_path, order()) as told:
        await told.until_begun(1)
        assert not told.launcher.request_start("sea", 0)["accepted"]
        assert told.launcher.request_start("box", 0) == {"accepted": True}
        await asyncio.sleep(0)
        assert not told.launcher.request_start("box", 0)["accepted"], "under way"
        await told.until_begun(2)
        assert told.launcher.rooms["scene"] == "box"
        told.interrupt()
        assert not told.launcher.request_start("box", 0)["accepted"], "it ends"
    (first, _, _), (second, _, arguments) = told.started
    assert arguments[-2:] == ["--set", "slave.scene=box"]
    assert told.inherited == [(str(first), str(second))]
    assert [(message["state"], message["scene"]) for message in told.messages[2:]] == [
        *(("starting", "box"), ("running", "box"), ("idle", "box"))
    ]


@pytest.mark.parametrize(("when", "started"), [("before", 1), ("after", 2)])
@in_loop
async def test_no_start_from_before_an_emergency_stop_is_done_after_it(tmp_path: Path, when: str, started: int) -> None:
    async with visit(tmp_path, order()) as told:
        await told.until_begun(1)
        assert told.launcher.request_start("box", 0) == {"accepted": True}
        while len(told.launcher.started) < 2 and when == "after":
            await asyncio.sleep(0)
        at = monotonic()
        told.launcher.on_emergency(at)
        told.launcher.on_emergency(at + 1e-3)  # the other way of the same press
        assert told.launcher.stops == 1
        while told.launcher.message["state"] != "idle":
            await asyncio.sleep(0.01)
        assert len(told.launcher.started) == started
        late = told.launcher.request_start("box", 0)
        assert (late["accepted"], "emergency stop" in late["why"]) == (False, True), "asked before it was known"
        begun = len(told.started)
        assert told.launcher.request_start("box", 1) == {"accepted": True}
        while len(told.launcher.started) == started:
            await asyncio.sleep(0.01)
        told.launcher.on_emergency(monotonic() - 0.5)  # a press from before, repeated
        await told.until_begun(begun + 1)
        told.interrupt()
    assert told.ended == (0, {"outcome": "interrupted", "ticks": 7})


@in_loop
async def test_a_session_that_an_emergency_stop_ended_leaves_another_to_be_started(tmp_path: Path) -> None:
    async with visit(tmp_path, order("stopped=1", duration_s=0.2)) as told:
        while told.launcher.last is None:
            await asyncio.sleep(0.01)
        told.interrupt()
    assert (told.launcher.message["state"], told.launcher.message["why"]) == ("idle", "failed: emergency stop")


@in_loop
async def test_first_session_that_does_not_begin_ends_the_visit(tmp_path: Path) -> None:
    async with visit(tmp_path, order("wrong=1")) as told:
        pass
    message = {"type": "launcher", "state": "failed", "scene": "dome", "why": "wrong: no such key", "stops": 0}
    assert (told.launcher.message, told.ended) == (message, (1, None))


@in_loop
async def test_limited_visit_ends_with_its_session(tmp_path: Path) -> None:
    async with visit(tmp_path, order("failing=1", duration_s=0.2)) as told:
        pass
    assert told.started[0][2][-2:] == ["--duration", "1.000"], "the shortest"
    assert told.ended == (1, {"outcome": "completed", "ticks": 7})
