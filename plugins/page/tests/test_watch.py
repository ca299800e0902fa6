"""Sessions that come and go, which of them each page is shown, and its bounded queue."""

import json
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given, strategies as st

from plugins.figures.tests.sources import HandSource, records, write
from tests.wait import in_loop
from weberlink.telemetry.ring import RingWriter
from weberlink_figures.watching.rings import find_rings
from weberlink_page.session import PageSession
from weberlink_page.viewer import ANSWERS_WAITING, MOST_WAITING, OUTLIVING, Topic, Viewer
from weberlink_page.watch import SessionWatcher


def ring(folder: Path, session: int, side: str) -> RingWriter:
    path = folder / f"weberlink-{session}-{side}.ring"
    return RingWriter(path, side=side, rate_hz=1000.0, capacity=64)


def told(viewer: Viewer) -> list[dict[str, Any]]:
    return [json.loads(text) for text in iter(viewer.take, None)]


@in_loop  # the watcher asks daemons for their settings
async def test_page_follows_to_the_next_session_and_sees_each_end(tmp_path: Path) -> None:
    said: list[str] = []
    watch, viewer = SessionWatcher(tmp_path, None, said.append), Viewer(None, may_change=True)
    watch.join(viewer)
    watch.look(0.0)
    (greeting,) = told(viewer)
    assert (greeting["session"], greeting["token"], watch.newest) == (None, watch.requests.token, None)
    first = ring(tmp_path, 7, "slave")
    write(first, records(20))
    watch.look(1.0)
    assert [message["type"] for message in told(viewer)] == ["hello", "handle", "samples", "events", "figures"]
    other = ring(tmp_path, 7, "master")
    write(other, records(20))
    write(first, records(20, first=20))
    watch.look(2.0)
    hello, *messages = told(viewer)
    assert (hello["type"], hello["present"]) == ("hello", ["master", "slave"])
    assert {message["side"] for message in messages if message["type"] == "samples"} == {"master", "slave"}
    second = ring(tmp_path, 8, "master")
    first.close()
    other.close()
    watch.look(3.0)
    messages = told(viewer)
    named = [(message["type"], message["session"]) for message in messages if "session" in message]
    assert named == [("figures", "7"), ("hello", "8"), ("figures", "8")]
    assert (messages[0]["ended"], messages[0]["figures"]["ticks"]["slave"]["count"]) == (True, 40)
    assert [of["session"] for of in watch.overview()] == ["8", "7"]
    second.close()
    watch.look(4.0)
    assert (told(viewer)[-1]["ended"], said[-1].startswith("session 8")) == (True, True)
    for session in watch.sessions.values():
        session.close()


def test_pinned_page_stays_with_its_session_and_others_see_the_newest() -> None:
    watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
    pinned, free = Viewer("1", may_change=True), Viewer(None, may_change=True)
    for name in ("1", "2"):
        watch.put(PageSession(name, HandSource("slave")))
    for viewer in (pinned, free):
        watch.join(viewer)
    assert {message.get("session", "1") for message in told(pinned)} == {"1"}
    assert {message.get("session", "2") for message in told(free)} == {"2"}


async def asked(watch: SessionWatcher, viewer: Viewer, request: object) -> Any:
    read = watch.requests.read(viewer, json.dumps(request))
    return read if read["type"] == "answer" else await watch.requests.answer(viewer, read)


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (None, "request"),
        ({"type": "stop"}, "request"),
        ({"type": "change", "weber": 0.1, "token": "another"}, "not the token of the monitor"),
        ({"type": "change", "weber": 0.1, "token": "\ud800"}, ""),
        ({"type": "change", "weber": "0.1", "token": "right"}, "change.weber"),
        ({"type": "change", "speed": 0.1, "token": "right"}, "change.speed"),
        ({"type": "change", "token": "right"}, "nothing to change"),
        ({"type": "change", "weber": 0.1, "token": "right"}, "no running session"),
        ({"type": "session", "do": "start", "token": "right"}, "weberlink try does"),
        ({"type": "session", "do": "stop", "token": "right"}, "no running session"),
        ({"type": "emergency", "token": "right"}, "no running session"),
        ({"type": "drive", "target": [0, 0, True], "held": True, "token": "right"}, "drive.target"),
        ({"type": "drive", "target": [0, 0, float("nan")], "held": True, "token": "right"}, "drive.target"),
        ({"type": "drive", "target": [0, 0, 0], "held": 1, "token": "right"}, "drive.held"),
        ({"type": "record", "do": "start", "token": "right"}, "record: this monitor does not do that"),
    ],
)
@in_loop
async def test_invalid_request_is_refused_with_the_reason(request_: object, why: str) -> None:
    watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
    if isinstance(request_, dict) and request_.get("token") == "right":
        request_ = request_ | {"token": watch.requests.token}
    answer = await asked(watch, Viewer(None, may_change=True), request_)
    assert answer["type"] == "answer" and answer["accepted"] is False
    assert why in answer["why"]


def test_rings_are_paired_by_launcher_newest_last(tmp_path: Path) -> None:
    ours = ("7-master.ring", "7-slave.ring", "12-slave.ring")
    for name in (*ours, "7-slave.json", "12-slave.ring.x8d2", "x-slave.ring", "9-other.ring"):
        (tmp_path / f"weberlink-{name}").touch()
    (tmp_path / "another.ring").touch()
    found = find_rings(tmp_path)
    assert [(name, sorted(rings)) for name, rings in found.items()] == [("7", ["master", "slave"]), ("12", ["slave"])]
    path = tmp_path / "weberlink-12-slave.ring"
    assert (found["12"]["slave"].path, found["12"]["slave"].inode) == (path, path.stat().st_ino)
    assert find_rings(tmp_path / "missing") == {}


TOPICS = get_args(Topic)
BOUND = sum(MOST_WAITING.get(topic, 1) for topic in TOPICS) + ANSWERS_WAITING


def said(text: str) -> dict[str, str]:
    return {"type": "answer", "text": text}


@given(st.lists(st.sampled_from([*TOPICS, "answer"]), max_size=600))
def test_queue_is_bounded_and_keeps_the_newest(topics: list[str]) -> None:
    viewer = Viewer(None, may_change=False)
    for number, topic in enumerate(topics):
        text = f"{topic} {number}"
        if topic == "hello":
            viewer.greet(said(text))
        elif topic == "answer":
            viewer.answer(said(text))
        else:
            viewer.put(topic, said(text))
        assert len(viewer) <= BOUND
    left = [message["text"] for message in told(viewer)]
    for is_answer in (True, False):
        numbers = [int(text.split()[1]) for text in left if text.startswith("answer") == is_answer]
        assert numbers == sorted(numbers)
    greeted = max((number for number, topic in enumerate(topics) if topic == "hello"), default=-1)
    for topic in {*TOPICS, "answer"}:
        put = [number for number, each in enumerate(topics) if each == topic]
        if put and (topic in (*OUTLIVING, "answer") or put[-1] >= greeted):
            assert f"{topic} {put[-1]}" in left
        elif put:
            assert not any(text.startswith(f"{topic} ") for text in left)
