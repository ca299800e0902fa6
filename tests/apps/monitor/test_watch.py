"""Sessions that come and go, and which of them each page is shown."""

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from tests.watching.feeds import HandFeed, records, write
from weberlink.apps.monitor.viewer import Viewer
from weberlink.apps.monitor.watch import ENDED_KEPT, FIND_S, SessionWatcher
from weberlink.telemetry.ring import RingWriter
from weberlink.watching.rings import find_rings
from weberlink.watching.session import WatchedSession


def ring(folder: Path, session: int, side: str) -> RingWriter:
    path = folder / f"weberlink-{session}-{side}.ring"
    return RingWriter.create(path, side=side, rate_hz=1000.0, capacity=64)


def told(viewer: Viewer) -> list[dict[str, Any]]:
    messages = []
    while (text := viewer.take()) is not None:
        messages.append(json.loads(text))
    return messages


def test_page_sees_the_end_that_comes_after_the_last_records() -> None:
    async def run() -> None:
        feed = HandFeed("slave")
        watch = SessionWatcher(Path("/nonexistent"), None, print)
        watch.put(WatchedSession("7", feed))
        viewer = Viewer(None, may_change=True)
        watch.join(viewer)
        feed.put(records(20))
        watch.look(0.0)
        feed.over = True
        watch.look(1.0)
        assert told(viewer)[-1]["ended"]

    asyncio.run(run())


def test_page_follows_to_the_next_session(tmp_path: Path) -> None:
    said: list[str] = []

    async def run() -> None:
        watch = SessionWatcher(tmp_path, None, said.append)
        viewer = Viewer(None, may_change=True)
        watch.join(viewer)
        watch.look(0.0)
        (greeting,) = told(viewer)
        assert greeting["session"] is None and greeting["token"] == watch.requests.token and watch.newest is None
        first = ring(tmp_path, 7, "slave")
        write(first, records(20, first=0))
        watch.look(1.0)
        assert [message["type"] for message in told(viewer)] == ["hello", "handle", "samples", "events", "figures"]
        other = ring(tmp_path, 7, "master")
        write(other, records(20, first=0))
        write(first, records(20, first=20))
        watch.look(2.0)
        messages = told(viewer)
        assert messages[0]["type"] == "hello" and messages[0]["present"] == ["master", "slave"]
        assert {message["side"] for message in messages if message["type"] == "samples"} == {"master", "slave"}
        second = ring(tmp_path, 8, "master")
        first.close()
        other.close()
        watch.look(3.0)
        messages = told(viewer)
        assert [(message["type"], message["session"]) for message in messages if "session" in message] == [
            ("figures", "7"), ("hello", "8"), ("figures", "8")
        ]  # fmt: skip
        assert messages[0]["ended"] and messages[0]["figures"]["ticks"]["slave"]["count"] == 40
        assert [of["session"] for of in watch.overview()] == ["8", "7"]
        second.close()
        watch.look(4.0)
        assert told(viewer)[-1]["ended"]
        for session in watch.sessions.values():
            session.close()

    asyncio.run(run())
    assert said[-1] == "session 8: over"


def test_pinned_page_stays_with_its_session(tmp_path: Path) -> None:
    async def run() -> None:
        watch = SessionWatcher(tmp_path, None, lambda _: None)
        feeds = {name: HandFeed("slave") for name in ("1", "2")}
        for name, feed in feeds.items():
            watch.put(WatchedSession(name, feed))
        pinned, free = Viewer("1", may_change=True), Viewer(None, may_change=True)
        for viewer in (pinned, free):
            watch.join(viewer)
        for feed in feeds.values():
            feed.put(records(40))
        watch.look(0.0)
        assert {message.get("session", "1") for message in told(pinned)} == {"1"}
        assert {message.get("session", "2") for message in told(free)} == {"2"}
        watch.leave(pinned)
        feeds["2"].over = True
        watch.look(1.0)
        messages = told(free)
        assert messages[0]["ended"] and messages[1]["session"] == "1"  # which still runs

    asyncio.run(run())


def test_page_pinned_to_a_later_session_waits() -> None:
    async def run() -> None:
        watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
        viewer = Viewer("9", may_change=True)
        watch.join(viewer)
        watch.put(WatchedSession("1", HandFeed("slave")))
        watch.look(0.0)
        assert told(viewer)[-1]["session"] == "1"
        watch.put(WatchedSession("9", HandFeed("slave")))
        watch.put(WatchedSession("10", HandFeed("slave")))
        watch.look(1.0)
        assert told(viewer)[0]["session"] == "9"
        watch.look(2.0)
        assert {message.get("session", "9") for message in told(viewer)} == {"9"}

    asyncio.run(run())


def test_only_the_requested_session_is_opened(tmp_path: Path) -> None:
    with ring(tmp_path, 7, "slave"), ring(tmp_path, 8, "slave"):
        watch = SessionWatcher(tmp_path, "8", lambda _: None)
        watch.look(0.0)
        assert list(watch.sessions) == ["8"]
        watch.sessions["8"].close()


def test_foreign_file_is_reported_once(tmp_path: Path) -> None:
    said: list[str] = []
    (tmp_path / "weberlink-9-slave.ring").write_bytes(b"x" * 500)
    watch = SessionWatcher(tmp_path, None, said.append)
    watch.look(0.0)
    watch.look(FIND_S * 2)
    assert watch.sessions == {}
    assert len(said) == 1 and "not a telemetry ring" in said[0]


def test_rings_of_dead_daemons_are_ignored(tmp_path: Path) -> None:
    writer = ring(tmp_path, 7, "slave")
    writer.close(unlink=False)
    watch = SessionWatcher(tmp_path, None, lambda _: None)
    watch.look(0.0)
    assert watch.sessions == {}


def test_ended_sessions_are_forgotten() -> None:
    watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
    feeds = []
    for number in range(ENDED_KEPT + 3):
        feed = HandFeed("slave")
        feed.over = True
        feeds.append(feed)
        watch.put(WatchedSession(str(number), feed))
    watch.look(0.0)
    assert list(watch.sessions) == [str(number) for number in range(3, ENDED_KEPT + 3)]
    assert [feed.is_closed for feed in feeds] == [True] * 3 + [False] * ENDED_KEPT


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (None, "expected"),
        ([], "expected"),
        ({"type": "stop"}, "expected"),
        ({"type": "change", "weber": 0.1, "token": "another"}, "not the token of the monitor"),
        ({"type": "change", "weber": 0.1, "token": 7}, "not the token of the monitor"),
        ({"type": "change", "weber": 0.1, "token": "\ud800"}, "not the token of the monitor"),
        ({"type": "change", "weber": 0.1}, "not the token of the monitor"),
        ({"type": "change", "token": "right"}, "nothing to change"),
        ({"type": "change", "weber": 0.1, "token": "right"}, "no running session"),
        ({"type": "session", "do": "start", "token": "right"}, "weberlink try does"),
        ({"type": "session", "do": "stop", "token": "right"}, "no running session"),
        ({"type": "session", "do": "emergency", "token": "right"}, "no running session"),
        ({"type": "session", "do": "jump", "token": "right"}, "start, stop or emergency"),
        ({"type": "drive", "target": [0, 0], "held": True, "token": "right"}, "three finite numbers"),
    ],
)
def test_invalid_change_is_refused_with_the_reason(request_: object, why: str) -> None:
    watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
    if isinstance(request_, dict) and request_.get("token") == "right":
        request_ = request_ | {"token": watch.requests.token}
    answer = asyncio.run(watch.requests.answer(Viewer(None, may_change=True), request_))
    assert answer is not None and answer["type"] == "answer" and answer["accepted"] is False
    assert why in answer["why"]


def test_read_only_page_changes_nothing() -> None:
    async def run() -> Any:
        watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
        watch.put(WatchedSession("7", HandFeed("slave", ring=Path("/nonexistent/ring"))))
        viewer = Viewer(None, may_change=False)
        watch.join(viewer)
        greeting = told(viewer)[0]
        assert greeting["readonly"] is True and greeting["token"] is None
        return await watch.requests.answer(viewer, {"type": "change", "weber": 0.1})

    assert "read-only" in asyncio.run(run())["why"]


def test_rings_are_paired_by_launcher_newest_last(tmp_path: Path) -> None:
    for name in (
        "weberlink-7-master.ring",
        "weberlink-7-slave.ring",
        "weberlink-7-slave.json",
        "weberlink-12-slave.ring",
        "weberlink-12-slave.ring.x8d2",
        "weberlink-x-slave.ring",
        "weberlink-9-other.ring",
        "another.ring",
    ):
        (tmp_path / name).touch()
    found = find_rings(tmp_path)
    assert {name: sorted(rings) for name, rings in found.items()} == {"7": ["master", "slave"], "12": ["slave"]}
    assert found["12"]["slave"].path == tmp_path / "weberlink-12-slave.ring"
    assert found["12"]["slave"].inode == (tmp_path / "weberlink-12-slave.ring").stat().st_ino
    assert find_rings(tmp_path / "missing") == {}


def test_subscribed_page_gets_the_history() -> None:
    async def run() -> None:
        watch = SessionWatcher(None, "7", print)
        feed = HandFeed("slave")
        watch.put(WatchedSession("7", feed))
        viewers = [Viewer(None, may_change=False), Viewer(None, may_change=False)]
        for viewer in viewers:
            watch.join(viewer)
        assert await watch.requests.answer(viewers[0], {"type": "subscribe", "history": True}) is None
        feed.put(records(2000))
        for now in (0.0, 1.0, 2.0):
            watch.look(now)
        sent = [[message for message in told(viewer) if message["type"] == "history"] for viewer in viewers]
        assert not sent[1]
        (newest,) = sent[0]  # a page that reads late gets the newest only
        assert newest["session"] == "7" and len(newest["columns"]["t"]) == 20
        wrong = await watch.requests.answer(viewers[1], {"type": "subscribe", "history": 1})
        assert wrong is not None and not wrong["accepted"]

    asyncio.run(run())
