"""The page as a control room: emergency stop, alarms, events, recording, view, layouts, accessibility."""

import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from math import sin
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imsave

from tests.apps.monitor import axe
from tests.apps.monitor import synthetic_session as session
from tests.apps.monitor.browser import Browser, browser
from tests.apps.monitor.scripted_server import Message, ScriptedServer
from tests.apps.monitor.scripted_visit import unasked, visit

TOKEN = "t0ken"
DESK, PHONE = (1400, 900), (390, 844)
WITHIN_MS = 100.0
"""How long the emergency stop may take from the finger to the network."""
PRESSES = 3
SLOWER = 6
"""How many times slower than the machine a page may be."""
MOST_EVENTS = 200
SENT_AT = """
// The page hands a message for its WebSocket to a thread.
window.sent = {down: [], socket: [], http: []};
addEventListener("pointerdown", (event) => window.sent.down.push(event.timeStamp), true);
const {postMessage} = Worker.prototype;
Worker.prototype.postMessage = function (order) {
  if (order.text?.includes("emergency")) window.sent.socket.push(performance.now());
  return postMessage.call(this, order);
};
const {fetch} = window;
window.fetch = (...request) => {
  if (String(request[0]).includes("emergency")) window.sent.http.push(performance.now());
  return fetch(...request);
};
"""
ESCAPE, ENTER, STOP = "\ue00c", "\ue007", "\ue032"
FOCUSED = ("record-text", "weber", "room-scene", "scene", "pause", "emergency")
"""A text, a slider, a choice, the view, and buttons."""
KEYS = [*((name, STOP) for name in FOCUSED), ("emergency", ENTER), ("emergency", " ")]
"""What has the focus, and the key."""
SHOWN = "return getComputedStyle(document.getElementById(arguments[0])).visibility"
WIDE = "return document.documentElement.scrollWidth - innerWidth"
SCENES = [{"name": "dome", "title": "Dome on a plane"}, {"name": "box", "title": "Box"}]
ALARM: Message = {"name": "missed_ticks", "level": "degraded", "text": "7 % of ticks missed"}
LOST: Message = {"name": "unconnected", "level": "failed", "text": "unconnected for 6.9 s"}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as one:
        one.scheme("dark")
        yield one


@pytest.fixture(scope="module")
def served() -> Iterator[ScriptedServer]:
    with ScriptedServer() as one:
        yield one


@pytest.fixture
def server(page: Browser, served: ScriptedServer) -> Iterator[ScriptedServer]:
    page.size(*DESK)
    with unasked(page, served) as one:
        one.answer = lambda asked: {"type": "answer", "accepted": True, "to": asked["type"]}
        yield one


def hello(**other: Any) -> Message:
    """The greeting of a monitor that may do everything."""
    return session.hello(
        token=TOKEN,
        names={"file": "configs/try.yaml", "device": "pointer", "robot": "virtual", "peer": "127.0.0.1:47000"},
        rooms={"start": True, "scenes": SCENES, "scene": "dome"},
        records=True,
        **other,
    )


def told() -> list[Message]:
    return [*(session.samples(side, 0.0, 2.0) for side in ("master", "slave")), session.felt(0.0, 2.0)]


def figures(*alarms: Message, **other: Any) -> Message:
    state: Message = {"alarms": list(alarms), "engaged": {"master": True, "slave": False}, "button": "held"}
    return session.figures({"duration_s": 2.0}, **(state | other))


def events(*texts: str, level: str = "info", first: int = 0) -> Message:
    listed = [
        {"at": float(k), "wall": 1.7e9 + k, "level": level, "side": "master", "text": text}
        for k, text in enumerate(texts, first)
    ]
    return {"type": "events", "session": "1234", "events": listed}


def asked(page: Browser, server: ScriptedServer, count: int) -> list[Message]:
    """What the page has asked for, after so many requests; each had the token, which is left out."""
    page.wait(lambda: len(server.asked) >= count, f"{count} requests")
    requests = [dict(each) for each in server.asked]
    assert {each.pop("token", None) for each in requests} == {TOKEN}
    return requests


def press(page: Browser, name: str) -> None:
    page.run("document.getElementById(arguments[0]).click()", name)


def tap(page: Browser, name: str) -> None:
    """As a pointer does, without the driver's own look at the page, which takes seconds in a slow one."""
    box = "const b = document.getElementById(arguments[0]).getBoundingClientRect(); return [b.left, b.top]"
    left, top = page.run(box, name)
    for kind in ("mousePressed", "mouseReleased"):
        at = {"type": kind, "x": left + 20, "y": top + 20, "button": "left", "clickCount": 1}
        page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", at)


def ready(page: Browser, name: str) -> None:
    page.wait(lambda: page.run("return !document.getElementById(arguments[0]).disabled", name), name)


def wait_more(page: Browser, expression: str, least: int) -> None:
    """Until a number of the page is as large."""
    page.wait(lambda: int(page.run(f"return {expression}")) >= least, expression)


@contextmanager
def flooded(server: ScriptedServer) -> Iterator[None]:
    """New rows at the pace of a session, all the time."""
    over = threading.Event()

    def pour() -> None:
        begin = 2.0
        while not over.wait(0.05):
            server.say(*(session.samples(side, begin, begin + 0.05) for side in ("master", "slave")))
            begin += 0.05

    thread = threading.Thread(target=pour)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.realtime(alone=True)
def test_emergency_is_sent_twice_within_100_ms(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    ready(page, "stop")
    page.run(SENT_AT)
    page.driver.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": SLOWER})
    try:
        with flooded(server):
            for count in range(1, PRESSES + 1):
                wait_more(page, "document.body.dataset.drawn", 1 + int(page.run("return document.body.dataset.drawn")))
                tap(page, "emergency")
                wait_more(page, "window.sent.http.length", count)
    finally:
        page.driver.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": 1})
    sent = {name: np.asarray(times) for name, times in page.run("return window.sent").items()}
    for way in ("socket", "http"):
        took = sent[way] - sent["down"]
        assert min(took) >= 0.0
        assert np.median(took) < WITHIN_MS, took
    assert asked(page, server, PRESSES) == PRESSES * [{"type": "session", "do": "emergency"}]
    page.wait(lambda: len(server.posted) == PRESSES, "the requests by HTTP")
    assert set(server.posted) == {("/api/emergency?session=1234", TOKEN)}


def test_emergency_stop_says_how_to_start_again(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    page.click("#emergency")
    page.wait(lambda: page.text("state") == "stopped", "the state")
    assert "press Start" in page.text("notice")
    assert page.run("return document.getElementById('alert').textContent") == page.text("notice")
    server.say(figures(ended=True), hello(session="5678"))
    page.wait(lambda: page.data("emergency") == "", "the next session")
    assert page.text("notice") == ""


def test_emergency_stop_by_keyboard(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told())
    ready(page, "record-text")
    for count, (focused, key) in enumerate(KEYS, 1):
        page.driver.find_element("id", focused).send_keys(key)
        assert len(asked(page, server, count)) == count
        page.wait(lambda: page.data("emergency") == "stopped", "the stop")
    page.wait(lambda: len(server.posted) == len(KEYS), "the requests by HTTP")
    assert len(server.asked) == len(KEYS)


def test_key_of_the_emergency_stop_is_on_its_button(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told())
    keys = "const b = document.getElementById('emergency'); return [b.getAttribute('aria-keyshortcuts'), b.innerText]"
    name, text = page.run(keys)
    assert name == "F2" and name in text.split()


@pytest.mark.parametrize("modifier", ["\ue009", "\ue00a"], ids=["control", "alt"])
def test_key_of_the_emergency_stop_with_another_is_none(page: Browser, server: ScriptedServer, modifier: str) -> None:
    from selenium.webdriver.common.action_chains import ActionChains  # noqa: PLC0415 - an optional library

    visit(page, server, hello(), *told())
    ActionChains(page.driver).key_down(modifier).send_keys(STOP).key_up(modifier).perform()
    page.click("#pause")
    page.click("#pause")
    assert server.asked == []


def test_escape_closes_help_and_stops_nothing(page: Browser, server: ScriptedServer) -> None:
    from selenium.webdriver.common.action_chains import ActionChains  # noqa: PLC0415 - an optional library

    visit(page, server, hello(), *told(), figures())
    button = page.driver.find_element("css selector", "[aria-describedby=help-controls]")
    other = page.driver.find_element("id", "title-controls")
    chain = lambda: ActionChains(page.driver, duration=0)  # noqa: E731
    ways = {
        "clicked": chain().move_to_element(button).click(),
        "pointed at": chain().move_to_element(button),
        "focused": chain().move_to_element(other).click().send_keys("\ue004"),  # Tab
    }
    for way, opens in ways.items():
        opens.perform()
        page.wait(lambda: page.run(SHOWN, "help-controls") == "visible", f"the help that is {way}")
        chain().send_keys(ESCAPE).perform()
        page.wait(lambda: page.run(SHOWN, "help-controls") == "hidden", f"the end of the help that is {way}")
        page.run("document.activeElement.blur()")
        chain().move_to_element(other).perform()
    for name in FOCUSED:
        page.driver.find_element("id", name).send_keys(ESCAPE)
    server.say(figures(ended=True))
    page.wait(lambda: page.data("state") == "ended", "the end of the session")
    assert server.asked == server.posted == []


def test_emergency_that_fails_says_so(page: Browser, server: ScriptedServer) -> None:
    server.answer = lambda asked: {"type": "answer", "accepted": False, "to": asked["type"], "why": "wrong token"}
    visit(page, server, hello(), *told())
    page.click("#emergency")
    page.wait(lambda: page.data("emergency") == "failed", "the refusal")
    assert page.text("notice").startswith("NOT stopped: wrong token")
    server.say(figures(ended=True))
    page.wait(lambda: page.data("emergency") == "stopped", "the end of the session")
    server.stop()
    page.wait(lambda: page.data("state") == "lost", "the loss")
    page.click("#emergency")
    page.wait(lambda: "the monitor does not answer" in page.text("notice"), "the failure")


def test_alarms_are_shown_and_announced_once(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    page.wait(lambda: page.text("alarms") == "no alarms", "no alarms")
    spoken = "const e = document.getElementById('alert'); return [e.getAttribute('role'), e.textContent]"
    server.say(figures(ALARM))
    page.wait(lambda: page.text("alarms") == ALARM["text"], "the alarm")
    assert page.run(spoken) == ["alert", "degraded: 7 % of ticks missed"]
    server.say(figures(ALARM | {"text": "8 % of ticks missed"}, LOST))
    page.wait(lambda: LOST["text"] in page.text("alarms"), "the other alarm")
    assert "8 % of ticks missed" in page.text("alarms")
    assert page.run(spoken) == ["alert", "failed: unconnected for 6.9 s"]
    server.say(figures())
    page.wait(lambda: page.text("alarms") == "no alarms", "the end of the alarms")


def test_event_log_is_bounded_and_newest_first(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), events("<b>connected</b>"), events("<b>connected</b>"))
    press(page, "page-events")
    page.wait(lambda: "connected" in page.text("events"), "the event")
    rows = "return [...document.querySelectorAll('#events li')].map(e => e.innerText)"
    assert len(page.run(rows)) == 1  # known already
    assert page.run(rows)[0].endswith("master <b>connected</b>")
    server.say(events(*(f"event {k}" for k in range(500)), level="warn", first=1))
    page.wait(lambda: "event 499" in page.text("events"), "the events")
    assert len(page.run(rows)) == MOST_EVENTS
    assert "warn master event 499" in page.run(rows)[0]
    assert page.text("events-count") == "500"
    server.say(hello(session="5678"), *told())
    page.wait(lambda: page.run(rows) == [], "another session")


def test_session_is_started_and_stopped(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    ready(page, "stop")
    page.click("#stop")
    assert asked(page, server, 1) == [{"type": "session", "do": "stop"}]
    server.say(figures(ended=True), {"type": "launcher", "state": "idle", "scene": None, "why": None})
    page.wait(lambda: page.text("start") == "Start", "the end")
    page.choose("room-scene", "box")
    page.click("#start")
    assert asked(page, server, 2)[1] == {"type": "session", "do": "start", "scene": "box"}
    server.say({"type": "launcher", "state": "starting", "scene": "box", "why": None})
    page.wait(lambda: page.text("notice") == "starting Box …", "the start")
    server.say({"type": "launcher", "state": "failed", "scene": "box", "why": "port 47000 is in use"})
    page.wait(lambda: page.text("notice") == "not started: port 47000 is in use", "the failure")


def test_names_engagement_and_button_are_shown(page: Browser, server: ScriptedServer) -> None:
    server.sessions = [
        {"session": "5678", "file": "/tmp/other.yaml", "live": False},
        {"session": "1234", "file": "configs/try.yaml", "live": True},
    ]
    visit(page, server, hello(), *told(), figures())
    page.wait(lambda: page.data("engagement") == "master", "the engagement")
    assert (page.text("engagement"), page.text("hold")) == ("master engaged", "button held")
    named = [page.text(f"name-{kind}") for kind in ("file", "device", "robot", "peer")]
    assert named == ["try.yaml", "pointer", "virtual", "127.0.0.1:47000"]
    options = "return [...document.getElementById('session').options].map(e => e.text)"
    page.wait(lambda: len(page.run(options)) == 2, "both sessions")
    assert page.run(options) == ["5678 · other.yaml · ended", "1234 · try.yaml · running"]


def test_recording_and_marks(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    ready(page, "record-switch")
    page.driver.find_element("id", "record-text").send_keys("trial m")
    page.click("#record-switch")
    assert asked(page, server, 1) == [{"type": "record", "do": "start", "name": "trial m"}]
    on: Message = {"type": "recording", "state": "on", "path": "a.mcap", "bytes": 4.1e6, "seconds": 12.3, "marks": 2}
    server.say(on)
    page.wait(lambda: page.text("recording") == "12.3 s, 4.1 MB, 2 marks", "the recording")
    page.driver.find_element("id", "scene").send_keys("m")
    assert asked(page, server, 2)[1] == {"type": "record", "do": "mark", "text": ""}
    page.driver.find_element("id", "record-text").send_keys("bump")
    page.click("#mark")
    assert asked(page, server, 3)[2] == {"type": "record", "do": "mark", "text": "bump"}
    page.click("#record-switch")
    assert asked(page, server, 4)[3] == {"type": "record", "do": "stop"}
    server.say(on | {"state": "done"})
    page.wait(lambda: page.text("notice") == "recorded: a.mcap (12.3 s, 4.1 MB, 2 marks)", "the end")
    assert page.text("recording") == ""
    server.say(on, on | {"state": "failed", "why": "no space left on the disk"})
    page.wait(lambda: page.text("notice") == "recording failed: no space left on the disk (a.mcap)", "the failure")


def test_page_says_why_it_cannot_record(page: Browser, server: ScriptedServer) -> None:
    hidden = "return document.getElementById(arguments[0]).offsetParent === null"
    visit(page, server, hello(), *told())
    ready(page, "record-switch")
    assert page.run(hidden, "record-why")
    visit(page, server, hello() | {"records": False, "records_why": "recording: needs mcap"}, *told(), figures())
    page.wait(lambda: page.text("record-why") == "recording: needs mcap", "the reason")
    assert page.run(hidden, "record")
    server.say(figures(ended=True))
    page.wait(lambda: page.run(hidden, "record-why"), "the end of the session")


def test_whole_session_is_drawn_as_history(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told(), figures())
    page.click('[data-window="all"]')
    assert asked(page, server, 1) == [{"type": "subscribe", "history": True}]
    t = [2.0 * k for k in range(600)]
    columns: Message = {
        name: [1.0 + sin(0.02 * x) for x in t] for name in ("force_max", "felt_max", "packets", "missed")
    }
    columns |= {"t": t, "rtt_ms": [None] * len(t)}
    server.say({"type": "history", "session": "1234", "step_s": 2.0, "columns": columns})
    drawn = [f"#panel-history-{name} canvas" for name in ("force", "felt", "packets", "missed")]
    page.wait(lambda: min(map(page.pixels, drawn)) > 5, "the charts")
    page.wait(lambda: page.run("return document.querySelector('#panel-history-delay .empty').innerText") != "", "none")
    assert not page.run("return document.getElementById('panel-force').offsetParent")
    page.click('[data-window="20"]')
    assert asked(page, server, 2)[1] == {"type": "subscribe", "history": False}
    assert page.run("return document.getElementById('panel-history-force').offsetParent") is None


def test_view_shows_frame_and_its_age(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told())
    assert page.run("return document.getElementById('panel-view').offsetParent") is None
    picture = BytesIO()
    imsave(picture, np.random.default_rng(1).random((48, 64, 3)), format="jpg")
    server.pictures = [struct.pack("<d", 0.25) + picture.getvalue()]
    server.say(hello(view=True))
    page.wait(lambda: page.pixels("#frame") > 100, "the picture")
    assert page.run("const {width, height} = document.getElementById('frame'); return [width, height]") == [64, 48]
    page.wait(lambda: page.number("frame-age") >= 0.25, "its age")
    page.wait(lambda: page.text("frame-age").startswith("no frame for 1."), "no other")
    server.say(hello())
    page.wait(lambda: page.run("return document.getElementById('panel-view').offsetParent") is None, "no view")


def test_page_without_token_disables_what_changes(page: Browser, server: ScriptedServer) -> None:
    other = {"token": None, "readonly": True}
    visit(page, server, hello() | other, *told(), figures())
    page.wait(lambda: page.text("engagement") == "master engaged", "the figures")
    names = ("start", "stop", "record-switch", "mark")
    assert all(page.run("return document.getElementById(arguments[0]).disabled", name) for name in names)
    page.run("document.activeElement.blur()")
    assert server.asked == []


def test_start_help_until_a_session(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, anew=True)
    page.wait(lambda: "weberlink try" in page.text("start-help"), "the help")
    assert "weberlink loopback" in page.text("start-help")
    assert page.text("state") == "no session"
    server.say(hello(), *told())
    page.wait(lambda: page.run("return document.getElementById('start-help').offsetParent") is None, "the session")
    page.wait(lambda: page.pixels("#panel-force canvas") > 5, "the charts")


def test_phone_shows_everything_without_scrolling_sideways(page: Browser, server: ScriptedServer) -> None:
    page.size(*PHONE)
    visit(page, server, hello(), *told(), figures(ALARM, LOST))
    page.wait(lambda: LOST["text"] in page.text("alarms"), "the alarms")
    box = (
        "scrollTo(0, arguments[1]); const b = document.getElementById(arguments[0]).getBoundingClientRect();"
        "return [b.left, b.top, b.right, b.bottom]"
    )
    assert page.run(WIDE) <= 0
    for at in (0, 100_000):
        for name in ("emergency", "tile-state"):
            left, top, right, bottom = page.run(box, name, at)
            assert 0 <= left < right <= PHONE[0] and 0 <= top < bottom <= PHONE[1]
    assert page.run(box, "scene", 0)[1] < page.run(box, "weber", 0)[1] < page.run(box, "panel-force", 0)[1]
    outside = page.run(
        "return [...document.querySelectorAll('button, input, select, canvas, td, dd')].filter(e => e.offsetParent)"
        ".filter(e => {const b = e.getBoundingClientRect(); return b.left < 0 || b.right > innerWidth})"
        ".map(e => e.outerHTML)"
    )
    assert outside == []
    for width in (600, 980, 1199):
        page.size(width, 900)
        page.wait(lambda: page.run(WIDE) <= 0, f"no scrolling at {width}")


def test_theme_is_switched_and_kept(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, hello(), *told())
    ground = "return getComputedStyle(document.body).backgroundColor"
    dark = page.run(ground)
    chart = "return document.querySelector('#panel-timeline canvas').toDataURL()"
    before = page.run(chart)
    page.choose("theme", "light")
    light = page.run(ground)
    assert light != dark
    page.wait(lambda: page.run(chart) != before, "the charts")
    page.driver.refresh()
    page.wait(lambda: page.picked("theme") == "light", "the choice")
    assert page.run(ground) == light
    page.choose("theme", "auto")
    assert page.run(ground) == dark


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_axe_finds_nothing(page: Browser, server: ScriptedServer, size: tuple[int, int], tmp_path: Any) -> None:
    script = axe.source(tmp_path)
    page.size(*size)
    on: Message = {"type": "recording", "state": "on", "path": "a.mcap", "bytes": 4.1e6, "seconds": 12.3, "marks": 2}
    link = {"delay_ms": 20, "jitter_ms": 0, "loss": 0.02}
    everything = hello(drivable=True, workspace_m=0.06, link=link)
    free: Message = {"type": "handle", "state": "free", "why": None}
    visit(page, server, everything, *told(), figures(ALARM, LOST), events("connected"), on, free, anew=True)
    page.wait(lambda: page.text("recording") != "" and LOST["text"] in page.text("alarms"), "all of it")
    try:
        for scheme in ("light", "dark"):
            page.scheme(scheme)
            assert axe.findings(page, script) == [], scheme
        press(page, "page-events")
        server.say(session.felt(2.0, 4.0, 19.2))
        page.wait(lambda: page.data("felt-zone") == "over", "the felt error")
        page.run("document.querySelector('[data-window=\"all\"]').click()")
        assert axe.findings(page, script) == []
    finally:
        page.scheme("dark")
