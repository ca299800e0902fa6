"""What only a browser shows of the page, with scripted messages: layout, drawing, input, and the emergency stop.

The scripts that need no document have their own tests in `page`.
"""

import re
from collections.abc import Iterator
from functools import cache
from math import hypot, nan
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from plugins.figures.tests.sources import RATE, HandSource, description, records
from plugins.page.tests.browser import Browser, browser
from plugins.page.tests.scripted_server import Message, ScriptedServer
from plugins.page.tests.test_scripts import MODULES
from plugins.recording.tests import arm_sessions as arms
from tests.session.systems import system
from weberlink_page.session import PageSession, samples_message

TOKEN = "t0ken"
DESK, PHONE = (1400, 900), (390, 844)
AWAY = np.array([0.85, 2.1, 0.0]) / hypot(0.85, 2.1)  # depth in the view, as it is seen at first
ESCAPE, ENTER, STOP, RIGHT = "\ue00c", "\ue007", "\ue032", "\ue014"
OUTSIDE = """
return [...document.querySelectorAll('button, input, select, canvas, td, dd')].filter(e => e.offsetParent).filter(e => {
    const b = e.getBoundingClientRect(); return b.left < 0 || b.right > innerWidth;
  }).map(e => e.outerHTML)
"""
BOX = (
    "const b = document.getElementById(arguments[0]).getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]"
)
WHEEL = "new WheelEvent('wheel', {deltaY: -300, bubbles: true})"
PANELS = "return [...document.querySelectorAll('#charts > .panel')].filter(e => e.offsetParent).map(e => e.id.slice(6))"
FIGURES = "return [...document.querySelectorAll('[data-figure]')].map(e => [e.dataset.figure, e.dataset.value])"
ALARM: Message = {"name": "unconnected", "level": "failed", "text": "unconnected for 6.9 s"}
EVENT: Message = {"at": 1.0, "wall": 1.7e9, "level": "alarm", "side": "master", "text": "the link is silent"}
RECORDING: Message = {"type": "recording", "state": "on", "path": "a.mcap", "bytes": 4.1e6, "seconds": 12.3, "marks": 2}
FREE: Message = {"type": "handle", "state": "free", "why": None}
SIDES = ("master", "slave")
SECONDS = 2.0


@cache
def live(kind: str = "3") -> PageSession:
    """What a monitor knows of a session with this many axes, after `SECONDS` in virtual time."""
    if kind == "arm":
        made, changes = [arms.records(side, round(SECONDS * arms.RATE)) for side in SIDES], {"system": arms.SYSTEM}
    else:
        file = {"3": "loopback.yaml", "6": "rotation.yaml"}[kind]
        made, changes = system(file=file).advance(round(SECONDS * RATE)), description("slave", file)
    sources = [HandSource(side, began=float(its["at"][0])) for side, its in zip(SIDES, made, strict=True)]
    for source, its in zip(sources, made, strict=True):
        source.description = description(source.side) | changes | {"changes": ["weber", "predictor"]}
        source.put(its)
    session = PageSession("1234", sources[1])
    session.admit(sources[0])
    session.rows()
    return session


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser without WebGL, of which a processor would draw every frame."""
    with browser(tmp_path_factory.mktemp("flat"), webgl=False) as one:
        yield one


@pytest.fixture(scope="module")
def deep(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("deep")) as one:
        yield one


@pytest.fixture
def page(request: pytest.FixtureRequest) -> Browser:
    found: Browser = request.getfixturevalue(getattr(request, "param", "flat"))
    return found


in_depth = pytest.mark.parametrize("page", ["deep"], indirect=True)


@pytest.fixture(scope="module")
def served() -> Iterator[ScriptedServer]:
    with ScriptedServer() as one:
        yield one


@pytest.fixture
def server(page: Browser, served: ScriptedServer) -> Iterator[ScriptedServer]:
    page.size(*DESK)
    page.scheme("dark")
    served.sessions = []
    served.answer = lambda asked: {"type": "answer", "accepted": True, "to": asked["type"]}
    yield served
    page.driver.get("about:blank")
    page.wait(lambda: not served.viewers, "the page to leave")
    served.asked.clear()
    served.posted.clear()


def greeting(kind: str = "3") -> list[Message]:
    """Of a monitor that may do everything, and the rows so far."""
    scenes = [{"name": "dome", "title": "Dome"}, {"name": "box", "title": "Box"}]
    told = {
        "token": TOKEN,
        "names": {"file": "try.yaml"},
        "rooms": {"start": True, "scenes": scenes, "scene": "dome"},
        "records": True,
        "drivable": True,
        "workspace_m": 0.08,
        "link": {"delay_ms": 0, "jitter_ms": 0, "loss": 0.0},
    }
    return [live(kind).hello() | told, *live(kind).backlog()]


def visit(page: Browser, server: ScriptedServer, *messages: Message) -> None:
    server.greeting = list(messages)
    page.open(server.address)
    page.wait(lambda: page.data("scene") in ("webgl", "missing"), "the 3-D view, or that there is none")
    page.wait(lambda: page.picked("session") == messages[0]["session"], "the greeting to be shown")


def chain(page: Browser) -> Any:
    from selenium.webdriver import ActionChains  # noqa: PLC0415 - an optional library

    return ActionChains(page.driver, duration=20)


def asked(server: ScriptedServer, kind: str) -> list[Message]:
    """The requests of a type without their token, which each of them had."""
    assert {each.get("token") for each in server.asked} <= {TOKEN}
    return [
        {k: v for k, v in each.items() if k not in ("type", "token")} for each in server.asked if each["type"] == kind
    ]


PANELS_OF = {
    "3": "force felt position packets delay ticks energy timeline",
    "6": "force torque felt position orientation packets delay ticks timeline",
    "arm": "joint-torque felt joint-angle joint-packets delay ticks energy timeline",
}


AXE = """
const done = arguments[arguments.length - 1];
axe.run(document, {rules: {"target-size": {enabled: true}}, resultTypes: ["violations"]}).then(
  ({violations}) => done(violations.flatMap(({id, impact, nodes}) =>
    nodes.map(({html, any}) => `${impact} ${id}: ${html.slice(0, 120)} (${any[0]?.message ?? ""})`))),
  (error) => done([String(error)]),
);
"""


def findings(page: Browser) -> Any:
    """What axe-core complains of in the open page, a line each: its weight, its rule, and the element."""
    path = MODULES / "axe-core" / "axe.min.js"
    if not path.is_file():
        pytest.skip("needs axe-core: make build/page")
    page.run(f"if (!window.axe) {{ {path.read_text(encoding='utf-8')} }}")
    return page.driver.execute_async_script(AXE)


@pytest.mark.parametrize(
    ("page", "kind", "size", "scheme"),
    [
        ("deep", "3", DESK, "dark"),
        ("flat", "3", PHONE, "light"),
        ("deep", "6", (1000, 830), "dark"),
        ("flat", "arm", PHONE, "dark"),
    ],
    indirect=["page"],
)
def test_every_kind_of_session_is_drawn_at_every_size_and_axe_finds_nothing(
    page: Browser, server: ScriptedServer, kind: str, size: tuple[int, int], scheme: str
) -> None:
    page.size(*size)
    page.scheme(scheme)
    others = (live(kind).figures() | {"alarms": [ALARM]}, {"type": "events", "events": [EVENT]}, RECORDING, FREE)
    visit(page, server, *greeting(kind), *others)
    page.wait(lambda: page.number("duration") == pytest.approx(SECONDS, abs=0.1), "the rows")
    assert page.run(PANELS) == PANELS_OF[kind].split()
    for name in PANELS_OF[kind].split():
        page.run("document.getElementById(arguments[0]).scrollIntoView({block: 'center'})", f"panel-{name}")
        page.wait(lambda name=name: page.pixels(f"#panel-{name} canvas") > 5, f"the chart {name}")
    assert page.run(OUTSIDE) == []
    page.run("scrollTo(0, 100000)")
    for name in ("emergency", "tile-state"):
        left, top, right, bottom = page.run(BOX, name)
        assert 0 <= left < right <= size[0] and 0 <= top < bottom <= size[1], "in sight, wherever the page is scrolled"
    if kind == "3":
        assert findings(page) == []
    assert page.console() == []
    assert page.hosts() == {f"127.0.0.1:{server.port}"}


def test_what_is_told_is_shown_and_figures_are_those_of_the_report(page: Browser, server: ScriptedServer) -> None:
    told = live().figures()
    report = told["figures"] | {"felt": told["figures"]["force"], "now": told["ways_now"]}
    visit(page, server, *greeting())
    for message, element, text in (
        (told | {"alarms": [ALARM]}, "alarms", ALARM["text"]),
        ({"type": "events", "events": [EVENT]}, "events-count", "1"),
        (RECORDING, "recording", "12.3 s, 4.1 MB, 2 marks"),
        (told | {"ended": True, "faults": {"master": {"silence": 2}}}, "state", "ended"),
    ):
        server.say(message)
        page.wait(lambda element=element, text=text: text in page.text(element), text)
    shown = page.run(FIGURES)
    assert len(shown) > 25
    for path, exact in shown:
        value: Any = report
        for key in path.split("."):
            value = (value or {}).get(key)
        assert float(exact or "nan") == pytest.approx(nan if value is None else value, nan_ok=True), path
    now = [page.number(name) for name in ("duration", "faults", "felt-deadbands-now")]
    assert now == [SECONDS, 2, report["felt"]["error_p99_deadbands"]]


def test_emergency_is_sent_both_ways_by_finger_and_by_keyboard_whatever_has_the_focus(
    page: Browser, server: ScriptedServer
) -> None:
    visit(page, server, *greeting())

    def until_asked(count: int) -> None:
        page.wait(lambda: len(server.posted) >= count <= len(asked(server, "emergency")), "both requests")

    left, top, *_ = page.run(BOX, "emergency")
    at = {"x": left + 20, "y": top + 20, "button": "left", "clickCount": 1}
    page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", at | {"type": "mousePressed"})
    until_asked(1)
    presses = [*((name, STOP) for name in ("record-text", "weber", "room-scene")), ("emergency", ENTER)]
    for count, (focused, key) in enumerate(presses, 2):
        page.driver.find_element("id", focused).send_keys(key)
        until_asked(count)
        page.wait(lambda: page.data("emergency") == "stopped", "the stop")
    chain(page).key_down("\ue009").send_keys(STOP).key_up("\ue009").send_keys(ESCAPE).perform()
    page.click("#pause")
    posted = [re.fullmatch(r"/api/emergency\?session=1234&age_ms=\d+", path) for path, _ in server.posted]
    assert all(posted) and len(posted) == 5, "with another key it is not the stop"
    assert {token for _, token in server.posted} == {TOKEN}
    page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", at | {"type": "mouseReleased"})


def test_emergency_that_fails_says_so_and_what_to_do(page: Browser, server: ScriptedServer) -> None:
    server.answer = lambda asked: {"type": "answer", "accepted": False, "to": asked["type"], "why": "wrong token"}
    visit(page, server, *greeting())
    page.click("#emergency")
    page.wait(lambda: page.data("emergency") == "failed", "the refusal")
    assert page.text("notice").startswith("NOT stopped: wrong token") and "Ctrl-C" in page.text("notice")
    ages = lambda: [each["age_ms"] for each in asked(server, "emergency")]  # noqa: E731
    page.wait(lambda: len(ages()) >= 3 <= len(server.posted), "both requests again")
    assert ages() == sorted(ages()) and 400.0 < ages()[2] < 1e4, "since the press"
    server.say(live().figures() | {"ended": True})
    page.wait(lambda: page.data("emergency") == "stopped", "the end of the session")
    server.stop()
    page.wait(lambda: page.data("state") == "lost", "the loss")
    page.click("#emergency")
    page.wait(lambda: "the monitor does not answer" in page.text("notice"), "the failure")
    server.start()
    page.wait(lambda: page.data("state") != "lost", "the page to connect again")


@in_depth
def test_pointer_and_keys_drive(page: Browser, server: ScriptedServer) -> None:
    rest = samples_message("master", records(200), 10.0, live().layout)
    visit(page, server, greeting()[0], rest, FREE)
    page.wait(lambda: page.data("handle-state") == "free", "the handle")
    drives = lambda: asked(server, "drive")  # noqa: E731
    scene = page.driver.find_element("id", "scene")
    chain(page).move_to_element(scene).click_and_hold().perform()
    page.wait(lambda: page.data("handle-state") == "held" and drives(), "the hold")
    assert drives()[0] == {"target": [0.0, 0.0, 0.0], "held": True}
    chain(page).move_by_offset(40, -30).perform()
    page.wait(lambda: hypot(*drives()[-1]["target"]) > 0.005, "the target to move")
    sleep(0.1)
    moved = np.array(drives()[-1]["target"])
    assert abs(moved @ AWAY) < 1e-5 and moved[2] > 0, "on the vertical plane"
    page.run(f"document.querySelector('#scene canvas').dispatchEvent({WHEEL})")
    page.wait(lambda: np.array(drives()[-1]["target"]) @ AWAY == pytest.approx(0.012, abs=1e-5), "the depth")
    server.asked.clear()
    began = monotonic()
    page.run("const end = performance.now() + 1500; while (performance.now() < end);")
    before_and_after = (monotonic() - began - 1.5) / 0.025  # repeats of a page that is not busy
    assert 4 < len(drives()) < 35 + before_and_after, "a busy page repeats the target, but not for long"
    chain(page).release().perform()
    page.wait(lambda: not drives()[-1]["held"], "the release")
    chain(page).key_down(RIGHT).perform()
    page.wait(lambda: drives()[-1]["held"] and drives()[-1]["target"][0] > 0.002, "the keys")
    chain(page).send_keys(ESCAPE).perform()
    page.wait(lambda: not drives()[-1]["held"], "Escape to let go")
    chain(page).key_up(RIGHT).perform()
    count = len(drives())
    # Beside the handle a drag turns the view.
    chain(page).move_to_element_with_offset(scene, 150, 90).click_and_hold().move_by_offset(9, 0).release().perform()
    assert (len(drives()), page.console()) == (count, [])
    scene.send_keys(STOP)
    page.wait(lambda: len(server.posted) == len(asked(server, "emergency")) == 1, "the emergency stop")
    server.say(FREE | {"state": "taken", "why": "another visitor drives"})
    page.wait(lambda: "another visitor drives" in page.text("handle-state"), "who drives")


def test_controls_ask_and_show_the_answer(page: Browser, server: ScriptedServer) -> None:
    server.answer = lambda asked: {"type": "answer", "to": asked["type"], "accepted": True, "tick": 2166}
    server.sessions = [{"session": name, "file": "try.yaml", "live": True} for name in ("1234", "5678")]
    visit(page, server, *greeting())
    page.wait(lambda: page.run("return !document.getElementById('weber').disabled"), "the controls")
    for name, value in (("weber", "0.2"), ("predictor", "plane"), ("delay_ms", "20")):
        page.choose(name, value)
        page.wait(lambda name=name: name in asked(server, "change")[-1:][0] if asked(server, "change") else False, name)
        page.wait(lambda: page.data("answer") == "accepted" and "2166" in page.text("answer"), "the answer")
    page.choose("room-scene", "box")
    page.driver.find_element("id", "record-text").send_keys("a wall")
    page.click("#record-switch")
    server.say(RECORDING)
    page.driver.find_element("id", "panel-scene").click()
    chain(page).send_keys("m").perform()
    for selector in ("#record-switch", "#start", "#stop"):
        page.click(selector)
    page.wait(lambda: len(server.asked) >= 8, "all requests")
    assert asked(server, "change") == [{"weber": 0.2}, {"predictor": "plane"}, {"delay_ms": 20}]
    assert asked(server, "session") == [{"do": "start", "scene": "box", "stops": 0}, {"do": "stop"}]
    assert asked(server, "record") == [{"do": "start", "name": "a wall"}, {"do": "mark", "text": ""}, {"do": "stop"}]
    page.choose("session", "5678")
    page.wait(lambda: server.followed[-1] == "5678", "the other session")


def test_page_works_without_webgl_and_without_a_session(page: Browser, server: ScriptedServer) -> None:
    server.greeting = []
    page.open(server.address)
    page.wait(lambda: "weberlink try" in page.text("start-help"), "the help")
    server.greeting = greeting()  # for a page that has just lost its connection
    server.say(*server.greeting)
    page.wait(lambda: page.data("state") == "engaged", "the session")
    assert page.data("scene") == "missing" and "WebGL" in page.text("scene")
    page.wait(lambda: page.pixels("#panel-force canvas") > 5, "the charts")
    assert page.console() == []
