"""Recordings that a page starts: names, marks, ends, and folders that cannot be written."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from plugins.figures.tests.sources import description, records, write
from plugins.page.tests.test_watch import asked, told
from tests.wait import until
from weberlink.telemetry.recorders import format_of
from weberlink.telemetry.ring import RingWriter
from weberlink_figures.watching.rings import RingSource
from weberlink_page.recording import RecordingService, file_name
from weberlink_page.session import PageSession
from weberlink_page.viewer import Viewer
from weberlink_page.watch import SessionWatcher


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        *(("wall", "wall"), ("../../etc/pass wd", "etc-pass-wd"), (".hidden.mcap", "hidden"), ("x" * 81, "x" * 80)),
        *(("a\0b\nc", "a-b-c"), (None, "session-7-20"), ("..", "session-7-20"), (".mcap", "session-7-20")),
    ],
)
def test_name_of_a_file_has_no_path_and_an_empty_one_is_session_and_time(name: str | None, stem: str) -> None:
    assert file_name(name, "7")[: len(stem) if stem.startswith("session") else None] == stem


class Rig:
    """A session of one ring on this host, a page, and a desk."""

    def __init__(self, folder: Path, ring: RingWriter, source: RingSource) -> None:
        self.said: list[str] = []
        self.ring = ring
        self.watch = SessionWatcher(folder / "none", None, self.said.append)
        self.desk = RecordingService(self.watch, folder / "recordings", self.said.append)
        source.description = description("slave") | {"changes": []}
        self.session = PageSession("7", source)
        self.watch.put(self.session)
        self.page = Viewer(None, may_change=True)
        self.watch.join(self.page)
        self.ticks = 0

    def tick(self, count: int = 50) -> None:
        made = records(count, first=self.ticks)
        made["at"] = monotonic() + np.arange(count) * 1e-6
        write(self.ring, made)
        self.ticks += count

    def ask(self, **request: Any) -> dict[str, Any]:
        told_ = {"type": "record", "token": self.watch.requests.token} | request
        answer: dict[str, Any] = asyncio.run(asked(self.watch, self.page, told_))
        assert answer["to"] == "record"
        return answer

    def look(self) -> None:
        async def look() -> None:
            self.watch.look(monotonic())

        asyncio.run(look())

    def state(self) -> dict[str, Any] | None:
        """The newest state that the page was told since the last call."""
        self.look()
        states = [message for message in told(self.page) if message["type"] == "recording"]
        return states[-1] if states else None

    def until_state(self, *wanted: str) -> dict[str, Any]:
        def look() -> dict[str, Any] | None:
            self.tick(5)
            state = self.state()
            return state if state is not None and state["state"] in wanted else None

        return until(look, f"the recording to be {wanted}") or {}


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    path = tmp_path / "weberlink-7-slave.ring"
    ring = RingWriter(path, side="slave", rate_hz=1000.0, capacity=10_000)
    source = RingSource(path)
    rig = Rig(tmp_path, ring, source)
    yield rig
    rig.desk.close()
    ring.close()
    source.close()


def test_recording_is_marked_and_finished(rig: Rig, tmp_path: Path) -> None:
    pytest.importorskip("weberlink_recording")
    rig.tick()
    first = rig.state()
    assert (first or {})["state"] == "off"
    assert not rig.ask(do="stop")["accepted"]
    assert not rig.ask(do="mark", text="x")["accepted"]
    answer, path = rig.ask(do="start", name="a wall"), tmp_path / "recordings" / "a-wall.mcap"
    assert (answer["accepted"], answer["path"]) == (True, str(path))
    assert not rig.ask(do="start")["accepted"], "twice"
    until(lambda: (rig.tick(5), path.exists())[1], "the file")
    assert rig.ask(do="mark", text="the first\ntouch")["accepted"]
    assert rig.until_state("on")["marks"] == 1
    assert rig.ask(do="stop")["accepted"]
    done, recording = rig.until_state("done"), format_of(path, "").read(path)
    assert (recording.complete, [mark.text for mark in recording.marks]) == (True, ["the first touch"])
    assert recording.facts["begun"] == "during the session"
    assert recording.records["slave"]["tick"][0] >= 50
    assert (done["path"], done["bytes"], done["why"]) == (str(path), path.stat().st_size, None)
