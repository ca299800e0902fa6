"""A recording that is played on the page: its clock, its figures, and seeks."""

import asyncio
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from tests.apps.monitor.feeds import RATE, description, records
from tests.apps.monitor.monitors import Monitor
from tests.apps.monitor.test_watch import told
from tests.system.processes import ROOT
from tests.system.systems import CONFIGS
from weberlink.apps.monitor.replay import Playback, PlayClock, Replay, ReplaySource, of_this_release, read_source
from weberlink.apps.monitor.viewer import Viewer
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.system.configuration import ConfigurationError, load
from weberlink.system.recorder import facts
from weberlink.system.scoring.recorded import RecordedSession, SessionMark
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recording.marks import Mark
from weberlink.telemetry.recording.message import Origin
from weberlink.telemetry.recording.writer import RecordingWriter

BANK = ("zoh", "linear", "plane", "sphere")
TICKS = 4000


def source() -> ReplaySource:
    session = RecordedSession(
        records(TICKS, seed=1), records(TICKS, seed=2), RATE, BANK, marks=(SessionMark(11.5, "a touch"),)
    )
    return ReplaySource("wall", session, {side: description(side) for side in ("master", "slave")}, 1e9)


def file(path: Path, *, cut: bool = False) -> Path:
    """A recording of both sides with a mark at 1 s."""
    configuration = load(CONFIGS / "loopback.yaml")
    with RecordingWriter.create(path, facts(configuration)) as writer:
        for seed, side in enumerate(("master", "slave")):
            writer.add_side(Origin(side, RATE, 1e9 + 10.0, 10.0))
            made = records(TICKS, seed=seed)
            made["fault"][2000:3500] = 1
            writer.write(side, made)
            writer.flush()
        writer.mark(Mark(1_000_000_011 * 10**9, "a touch"))
    if cut:
        path.write_bytes(path.read_bytes()[: -(path.stat().st_size // 4)])
    return path


def test_clock_plays_pauses_and_stops_at_the_end() -> None:
    clock = PlayClock(10.0)
    assert clock.position(100.0) == 0.0 and not clock.playing
    clock.play(100.0)
    assert clock.position(101.0) == 1.0
    clock.set_speed(4.0, 102.0)
    assert clock.position(103.0) == 6.0
    clock.pause(103.5)
    assert clock.position(200.0) == 8.0
    clock.seek(1.0, 200.0)
    clock.play(200.0)
    assert clock.position(300.0) == 10.0 and not clock.playing
    clock.play(301.0)
    assert not clock.playing


def test_figures_at_the_end_are_those_of_the_recording() -> None:
    of = source()
    playback = Playback(of)
    playback.catch_up(of.duration_s)
    session, expected = playback.session, of.session.summary()
    assert session.ended
    figures = session.figures()["figures"]
    for channel in ("force", "position"):
        for name, value in expected[channel].items():
            if isinstance(value, float):
                assert figures[channel][name] == pytest.approx(value, rel=1e-9), name
    assert figures["ticks"] == expected["ticks"]
    assert "mark: a touch" in [event.text for event in session.log.events]


def test_position_shows_only_what_was_before_it() -> None:
    playback = Playback(source())
    playback.catch_up(1.25)
    ticks = playback.session.score.summary()["ticks"]
    assert ticks["master"]["count"] == ticks["slave"]["count"] == 1251
    assert not playback.session.ended
    assert not any("touch" in event.text for event in playback.session.log.events)


def test_fields_of_another_release_are_matched_by_name() -> None:
    made = records(20, seed=1)
    names = list(reversed(DTYPE.names or ()))
    other = np.zeros(20, [("extra", "<f8"), *((name, DTYPE[name]) for name in names)])
    for name in names:
        other[name] = made[name]
    assert of_this_release(other).tobytes() == made.tobytes()


Talk = Callable[[SessionWatcher, Viewer, Callable[..., Awaitable[dict[str, Any]]]], Awaitable[None]]


def play(talk: Talk) -> None:
    """Let a page talk to a replay."""

    async def run() -> None:
        watch = SessionWatcher(None, "wall", print)
        replay = Replay(watch, source())
        viewer = Viewer(None, may_change=True)
        watch.join(viewer)

        async def ask(**request: Any) -> dict[str, Any]:
            proof = {"type": "replay", "token": watch.requests.token}
            answer = await watch.requests.answer(viewer, proof | request)
            assert answer is not None and answer["to"] == "replay"
            return answer

        await talk(watch, viewer, ask)
        await replay.close()

    asyncio.run(run())


async def until_told(watch: SessionWatcher, viewer: Viewer, kind: str, **values: Any) -> list[dict[str, Any]]:
    """All messages up to one of a kind with these values."""
    messages: list[dict[str, Any]] = []
    give_up_at = monotonic() + 30.0
    while monotonic() < give_up_at:
        watch.look(monotonic())
        messages += told(viewer)
        for message in messages:
            if message["type"] == kind and all(message.get(name) == value for name, value in values.items()):
                return messages
        await asyncio.sleep(0.01)
    raise AssertionError(f"no {kind} with {values}")


def test_replay_begins_with_the_first_page_and_ends() -> None:
    async def talk(watch: SessionWatcher, viewer: Viewer, ask: Any) -> None:
        first = told(viewer)
        assert [message["type"] for message in first] == ["hello", "handle", "figures", "replay"]
        assert first[0]["replay"] == {"duration_s": 3.999} and first[0]["session"] == "wall"
        assert (await ask(do="play", speed=8))["accepted"]
        messages = await until_told(watch, viewer, "figures", ended=True)
        ended = next(message for message in messages if message.get("ended"))
        assert ended["figures"]["ticks"]["master"]["count"] == TICKS
        assert {message["type"] for message in messages} >= {"samples", "felt", "events", "replay"}

    play(talk)


def test_seek_greets_pages_again_and_keeps_playing() -> None:
    async def talk(watch: SessionWatcher, viewer: Viewer, ask: Any) -> None:
        await ask(do="pause")
        told(viewer)
        assert (await ask(do="seek", at=2.5))["accepted"]
        messages = await until_told(watch, viewer, "hello")
        assert [message["type"] for message in messages if message["type"] == "hello"] == ["hello"]
        messages += told(viewer)
        samples = [message for message in messages if message["type"] == "samples"]
        assert max(samples[-1]["t"]) == pytest.approx(2.5, abs=0.01)
        figures = [message for message in messages if message["type"] == "figures"][-1]
        assert figures["figures"]["ticks"]["master"]["count"] == 2501 and not figures["ended"]
        state = [message for message in messages if message["type"] == "replay"][-1]
        assert (state["playing"], state["at"], state["speed"]) == (False, 2.5, 1.0)
        await ask(do="seek", at=99.0)
        await until_told(watch, viewer, "figures", ended=True)
        await ask(do="play", speed=0.25)  # from the beginning
        await until_told(watch, viewer, "hello")
        await until_told(watch, viewer, "replay", playing=True, speed=0.25)
        assert watch.sessions["wall"].score.summary()["ticks"]["master"]["count"] < 500

    play(talk)


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"do": "jump"},
        {"do": "seek"},
        {"do": "seek", "at": float("nan")},
        {"do": "play", "speed": 9},
        {"speed": "1"},
    ],
)
def test_wrong_request_is_refused(request_: dict[str, Any]) -> None:
    async def talk(watch: SessionWatcher, viewer: Viewer, ask: Any) -> None:
        answer = await ask(**request_)
        assert not answer["accepted"] and answer["why"].startswith("expected ")

    play(talk)


def test_file_is_described_as_its_session_was(tmp_path: Path) -> None:
    said: list[str] = []
    of = read_source([file(tmp_path / "wall.mcap")], said.append)
    assert not said and (of.name, of.began, round(of.duration_s, 3)) == ("wall", 10.0, 3.999)
    playback = Playback(of)
    hello = playback.session.hello()
    assert hello["names"]["device"] == "operator" and hello["scene"] and hello["readonly"]
    playback.catch_up(3.0)
    fault = next(event for event in playback.session.log.events if event.level == "alarm")
    assert fault.at == 2.0 and fault.wall == pytest.approx(1e9 + 12.0, abs=1e-3)
    mark = next(event for event in playback.session.log.events if event.text == "mark: a touch")
    assert mark.at == pytest.approx(1.0, abs=1e-6)


def test_truncated_file_plays_what_is_there(tmp_path: Path) -> None:
    said: list[str] = []
    of = read_source([file(tmp_path / "cut.mcap", cut=True)], said.append)
    (line,) = said
    assert "cut.mcap: not whole (cut off); playing what is there" in line
    Playback(of).catch_up(of.duration_s)


@pytest.mark.parametrize(("content", "words"), [(b"", "is empty"), (b"nonsense", "is no MCAP file"), (None, "No such")])
def test_file_that_is_no_recording_is_one_line(tmp_path: Path, content: bytes | None, words: str) -> None:
    path = tmp_path / "bad.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=words):
        read_source([path], print)


def test_command_refuses_a_bad_file(tmp_path: Path) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(b"nonsense")
    result = subprocess.run(
        [sys.executable, "-m", "weberlink", "monitor", "--replay", str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 2 and result.stderr.count("\n") == 1 and "--replay: " in result.stderr


def test_command_serves_the_recording(tmp_path: Path) -> None:
    with Monitor(tmp_path, "--replay", file(tmp_path / "wall.mcap")) as monitor:
        assert monitor.url
        assert "waiting for a daemon" not in monitor.said
