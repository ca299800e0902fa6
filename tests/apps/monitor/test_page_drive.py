"""The page in a browser: the visitor drives, with scripted messages."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from math import hypot, radians, tan
from time import sleep
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.apps.monitor import synthetic_session as session
from tests.apps.monitor.browser import Browser, browser
from tests.apps.monitor.scripted_server import Message, ScriptedServer

Target = NDArray[np.float64]

CAMERA = np.array([-0.85, -2.1, 1.3])
"""Where the view looks from at first, towards the middle of the scene."""
AWAY = np.array([0.85, 2.1, 0.0]) / hypot(0.85, 2.1)
RIGHT = np.array([2.1, -0.85, 0.0]) / hypot(0.85, 2.1)
UP = np.array([0.0, 0.0, 1.0])
FREE: Message = {"type": "handle", "state": "free", "why": None}
DRIVEN: Message = {
    "drivable": True,
    "token": "secret",
    "workspace_m": 0.08,
    "link": {"delay_ms": 0, "jitter_ms": 0, "loss": 0.0},
}
STAMPS = """
const post = Worker.prototype.postMessage;
window.stamps = [];
Worker.prototype.postMessage = function (message) {
  if (message.text?.includes('"drive"')) stamps.push(performance.now());
  post.call(this, message);
};
"""
COUNTED = """
window.made = window.tones = 0;
const [Context, Tone] = [AudioContext, OscillatorNode];
window.AudioContext = class extends Context { constructor(options) { super(options); made += 1; } };
window.OscillatorNode = class extends Tone { constructor(context, options) { super(context, options); tones += 1; } };
"""
GAMEPAD = """
window.rumbles = [];
window.pad = {
  connected: true, axes: [0, 0, 0, 0], buttons: Array.from({length: 16}, () => ({pressed: false, value: 0})),
  vibrationActuator: {
    playEffect: (kind, effect) => { rumbles.push({kind, ...effect}); return Promise.resolve("complete"); },
    reset: () => Promise.resolve("complete"),
  },
};
navigator.getGamepads = () => [null, window.pad];
dispatchEvent(new Event("gamepadconnected"));
"""


@pytest.fixture(scope="module")
def served() -> Iterator[ScriptedServer]:
    with ScriptedServer() as one:
        yield one


@pytest.fixture(scope="module")
def page(served: ScriptedServer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as one:
        one.size(1000, 800)
        one.open(served.address)
        one.wait(lambda: one.data("scene") == "webgl", "the 3-D view")
        yield one


NUMBERS = count(1)


@pytest.fixture
def server(page: Browser, served: ScriptedServer) -> Iterator[ScriptedServer]:
    """A new session with its handle in the middle of the scene, seen as at first; nothing is asked yet."""
    name = str(next(NUMBERS))
    served.answer = lambda _: None
    scene = [*session.SCENE, {"shape": "note", "text": name}]  # a scene of its own: the view begins anew
    served.say({"type": "handle", "state": "none", "why": name})
    served.say(session.hello(session=name, scene=scene, **DRIVEN), rest(0.0, 0.2))
    page.wait(lambda: page.text("handle-state") == name, "the session")
    served.say(FREE)
    page.wait(lambda: page.data("handle-state") == "free", "the handle")
    served.asked.clear()
    yield served
    chain(page).reset_actions()  # a test that failed may still hold the handle
    page.run("document.activeElement.blur()")
    assert page.console() == []


def rest(begin: float, end: float, **other: Any) -> Message:
    """Rows of the master with the handle at rest in the middle, in no contact; `other` replaces columns."""
    rows = session.samples("master", begin, end)
    count = len(rows["t"])
    rows["columns"] |= {"position": [[0.0] * count] * 3, "output": [[0.0] * count] * 3}
    rows["columns"] |= {name: [[part] * count for part in value] for name, value in other.items()}
    return rows


def drives(server: ScriptedServer) -> list[Message]:
    return [asked for asked in server.asked if asked["type"] == "drive"]


def stops(server: ScriptedServer) -> list[Message]:
    return [asked for asked in server.asked if asked["type"] == "session"]


def target(server: ScriptedServer) -> Target:
    return np.array(drives(server)[-1]["target"])


def chain(page: Browser) -> Any:
    """Actions of a person at the page."""
    from selenium.webdriver import ActionChains  # noqa: PLC0415 - an optional library

    return ActionChains(page.driver, duration=20)


def hold(page: Browser) -> None:
    """The mouse grasps the handle."""
    chain(page).move_to_element(page.driver.find_element("id", "scene")).click_and_hold().perform()
    page.wait(lambda: page.data("handle-state") == "held", "the hold")


def let_go(page: Browser, server: ScriptedServer) -> None:
    chain(page).release().perform()
    page.wait(lambda: not drives(server)[-1]["held"], "the release")


def after(server: ScriptedServer, page: Browser, condition: Callable[[Target], Any]) -> Target:
    """The newest target once it fulfils a condition."""
    page.wait(lambda: bool(drives(server) and condition(target(server))), "the target")
    return target(server)


def pixel_m(page: Browser) -> float:
    """Size of a pixel at the middle of the scene [m]."""
    height = page.run("return document.querySelector('#scene canvas').clientHeight")
    aspect = page.run("const c = document.querySelector('#scene canvas'); return c.clientWidth / c.clientHeight")
    reach = max(55.0, 1.15 * 20.0) * max(1.0, 1.02 / aspect)
    return float(2e-3 * reach * np.linalg.norm(CAMERA) * tan(radians(16.0)) / height)


def test_drag_moves_target_on_vertical_plane(page: Browser, server: ScriptedServer) -> None:
    page.run(STAMPS)
    hold(page)
    assert drives(server)[0] == {"type": "drive", "target": [0.0, 0.0, 0.0], "held": True, "token": "secret"}
    chain(page).move_by_offset(40, -30).perform()
    moved = after(server, page, lambda t: hypot(*t) > 0.005)
    sleep(0.2)
    moved = target(server)
    size = pixel_m(page)
    slope = np.linalg.norm(CAMERA) / hypot(CAMERA[0], CAMERA[1])
    assert abs(moved @ AWAY) < 1e-5
    assert moved @ RIGHT == pytest.approx(40 * size, rel=0.1)
    assert moved @ UP == pytest.approx(30 * size * slope, rel=0.1)
    assert np.diff(page.run("return stamps")).min() > 7.5
    let_go(page, server)
    assert drives(server)[-1]["target"] == moved.tolist()
    assert page.data("handle-state") == "free"


def test_busy_page_repeats_target_for_half_a_second(page: Browser, server: ScriptedServer) -> None:
    hold(page)
    server.asked.clear()
    page.run("const end = performance.now() + 1500; while (performance.now() < end);")
    assert 4 < len(drives(server)) < 35  # every 30 ms, but not until the end
    assert page.data("handle-state") == "held"
    let_go(page, server)


def test_drag_beside_handle_orbits(page: Browser, server: ScriptedServer) -> None:
    scene = page.driver.find_element("id", "scene")
    before = page.picture_of("scene")
    actions = chain(page).move_to_element_with_offset(scene, 90, 60).click_and_hold()
    actions.move_by_offset(40, 10).release().perform()
    page.wait(lambda: bool(np.any(page.picture_of("scene") != before)), "the view to turn")
    assert drives(server) == []
    page.click("#anywhere")
    chain(page).move_to_element_with_offset(scene, 90, 60).click_and_hold().perform()
    page.wait(lambda: len(drives(server)) > 0, "the handle to be held")
    assert drives(server)[0]["target"] == [0.0, 0.0, 0.0]
    let_go(page, server)
    page.click("#anywhere")


def test_wheel_changes_depth_while_held(page: Browser, server: ScriptedServer) -> None:
    hold(page)
    page.run(
        "const e = new WheelEvent('wheel', {deltaY: -300, bubbles: true, cancelable: true});"
        "document.querySelector('#scene canvas').dispatchEvent(e); return e.defaultPrevented"
    )
    deep = after(server, page, lambda t: hypot(*t) > 0.005)
    assert np.linalg.norm(deep - 0.012 * AWAY) < 1e-5
    let_go(page, server)


def test_second_finger_changes_depth(page: Browser, server: ScriptedServer) -> None:
    from selenium.webdriver.common.actions.action_builder import ActionBuilder  # noqa: PLC0415 - an optional library
    from selenium.webdriver.common.actions.interaction import POINTER_TOUCH  # noqa: PLC0415
    from selenium.webdriver.common.actions.pointer_actions import PointerActions  # noqa: PLC0415
    from selenium.webdriver.common.actions.pointer_input import PointerInput  # noqa: PLC0415

    scene = page.driver.find_element("id", "scene")
    make: Any = PointerInput
    actions = ActionBuilder(page.driver, mouse=make(POINTER_TOUCH, "first"), duration=20)
    second: Any = PointerActions(actions.add_pointer_input(POINTER_TOUCH, "second"), duration=20)
    first: Any = actions.pointer_action
    first.move_to(scene).pointer_down().pause(0.02).pause(0.02).pause(0.02).pause(0.02).pointer_up()
    second.pause(0.02).pause(0.02).move_to(scene, 60, 40).pointer_down().move_to(scene, 60, 10).pointer_up()
    actions.perform()
    page.wait(lambda: drives(server) and not drives(server)[-1]["held"], "the release")
    deep = target(server)
    assert deep @ AWAY == pytest.approx(30 * pixel_m(page), rel=0.1)
    assert np.linalg.norm(deep - (deep @ AWAY) * AWAY) < 1e-5


def test_keys_move_target_and_release_it(page: Browser, server: ScriptedServer) -> None:
    from selenium.webdriver.common.keys import Keys  # noqa: PLC0415 - an optional library

    page.run("document.getElementById('scene').focus()")
    for key, direction in ((Keys.ARROW_RIGHT, RIGHT), (Keys.ARROW_DOWN, -UP), (Keys.PAGE_UP, AWAY)):
        chain(page).key_down(key).perform()
        moved = after(server, page, partial(lambda along, t: t @ along > 0.002, direction))
        assert np.linalg.norm(moved - (moved @ direction) * direction) < 1e-5
        chain(page).key_up(key).perform()
        page.wait(lambda: not drives(server)[-1]["held"], "the release")
    chain(page).key_down(Keys.SPACE).key_down(Keys.ESCAPE).perform()
    page.wait(lambda: page.data("handle-state") == "free", "Escape to let go")
    chain(page).key_up(Keys.ESCAPE).key_up(Keys.SPACE).send_keys(Keys.ESCAPE).perform()
    assert not stops(server)
    sent = len(drives(server))
    chain(page).key_down(Keys.SHIFT).send_keys(Keys.ARROW_LEFT).key_up(Keys.SHIFT).perform()
    sleep(0.1)
    assert len(drives(server)) == sent  # that turns the view


def test_emergency_stop_comes_at_once_while_the_handle_is_held(page: Browser, server: ScriptedServer) -> None:
    from selenium.webdriver.common.keys import Keys  # noqa: PLC0415 - an optional library

    server.answer = lambda asked: {"type": "answer", "accepted": True, "to": asked["type"]}
    page.run("document.getElementById('scene').focus()")
    chain(page).key_down(Keys.SPACE).perform()
    page.wait(lambda: page.data("handle-state") == "held", "the hold")
    chain(page).send_keys(Keys.F2).perform()
    page.wait(lambda: stops(server), "the request")
    chain(page).key_up(Keys.SPACE).perform()
    assert len(stops(server)) == 1


def test_target_under_keys_stays_near_handle(page: Browser, server: ScriptedServer) -> None:
    from selenium.webdriver.common.keys import Keys  # noqa: PLC0415 - an optional library

    page.run("document.getElementById('scene').focus()")
    chain(page).key_down(Keys.ARROW_DOWN).perform()
    sleep(1.3)
    chain(page).key_up(Keys.ARROW_DOWN).perform()
    page.wait(lambda: not drives(server)[-1]["held"], "the release")
    assert np.linalg.norm(target(server)) == pytest.approx(0.03, abs=1e-4)  # the handle does not follow


@pytest.mark.parametrize(
    "leaving",
    [
        "dispatchEvent(new Event('blur'))",
        "dispatchEvent(new Event('pagehide'))",
        "dispatchEvent(new PointerEvent('pointercancel', {pointerId: 1}))",
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange'))",
    ],
    ids=["blur", "leaving", "cancelled", "hidden"],
)
def test_leaving_the_page_releases(page: Browser, server: ScriptedServer, leaving: str) -> None:
    hold(page)
    page.run(leaving)
    page.wait(lambda: not drives(server)[-1]["held"], "the release")
    assert page.data("handle-state") != "held"
    chain(page).release().perform()
    page.run("delete document.hidden")


def test_refused_handle_is_told(page: Browser, server: ScriptedServer) -> None:
    hold(page)
    server.say({"type": "handle", "state": "taken", "why": None})
    page.wait(lambda: page.text("handle-state") == "somebody else drives", "the refusal")
    page.wait(lambda: not drives(server)[-1]["held"], "the release")
    chain(page).release().perform()
    sent = len(drives(server))
    chain(page).click_and_hold().move_by_offset(10, 0).release().perform()
    assert len(drives(server)) == sent
    server.say({"type": "handle", "state": "none", "why": "the master has ended"})
    page.wait(lambda: page.text("handle-state") == "the master has ended", "the reason")
    server.say({"type": "handle", "state": "yours", "why": None})
    page.wait(lambda: page.data("handle-state") == "yours", "the handle")
    hold(page)
    assert page.text("handle-state").startswith("yours")
    let_go(page, server)


def test_session_without_pointer_shows_no_driving(page: Browser, server: ScriptedServer) -> None:
    server.say({"type": "handle", "state": "none", "why": None}, session.hello(session="5678"), rest(0.0, 0.2))
    page.wait(lambda: page.picked("session") == "5678", "the session")
    shown = "return [...document.querySelectorAll('#drive, #link, #handle-state')].filter(e => e.offsetParent)"
    page.wait(lambda: page.run(shown) == [], "driving to be hidden")
    chain(page).move_to_element(page.driver.find_element("id", "scene")).click_and_hold().release().perform()
    assert drives(server) == []


def test_link_sliders_ask_once_and_show_answer(page: Browser, server: ScriptedServer) -> None:
    def answer(asked: Message) -> Message | None:
        if asked["type"] != "change":
            return None
        if "loss" in asked:
            return {"type": "answer", "to": "change", "accepted": False, "why": "the link is not emulated"}
        return {"type": "answer", "to": "change", "accepted": True, "link": {"delay_ms": 40, "loss": 0.0}}

    server.answer = answer
    page.wait(lambda: not page.run("return document.getElementById('delay_ms').disabled"), "the slider")
    page.run(
        "const e = document.getElementById('delay_ms');"
        "for (const value of [30, 45]) { e.value = value; e.dispatchEvent(new Event('change')); }"
    )
    page.wait(lambda: page.data("answer") == "accepted", "the answer")
    changes = [asked for asked in server.asked if asked["type"] == "change"]
    assert changes == [{"type": "change", "delay_ms": 45, "token": "secret"}]
    assert (page.text("delay_ms-value"), page.picked("delay_ms")) == ("40 ms", "40")
    page.choose("loss", "0.12")
    page.wait(lambda: page.data("answer") == "refused", "the refusal")
    assert page.text("answer") == "not changed: the link is not emulated"
    assert (page.text("loss-value"), page.picked("loss")) == ("0 %", "0")
    assert [asked["loss"] for asked in server.asked if "loss" in asked] == [0.12]


def test_gamepad_drives_and_rumbles(page: Browser, server: ScriptedServer) -> None:
    page.run(GAMEPAD)
    page.wait(lambda: "gamepad" in page.text("handle-state"), "the gamepad")
    page.run("pad.axes[0] = 1")
    sleep(0.1)
    assert drives(server) == []  # without its dead-man's button
    page.run("pad.buttons[0].pressed = true")
    moved = after(server, page, lambda t: t @ RIGHT > 0.003)
    assert np.linalg.norm(moved - (moved @ RIGHT) * RIGHT) < 1e-5
    page.run("pad.axes = [0, 0, 0, -1]")
    after(server, page, lambda t: t @ AWAY > 0.003)
    server.say(rest(0.2, 0.3, output=[0.0, 0.0, 2.5]))
    page.wait(lambda: page.run("return rumbles.length") > 0, "the contact")
    sleep(0.1)
    server.say(rest(0.3, 0.4, output=[0.0, 0.0, 2.5]))
    page.wait(lambda: page.run("return rumbles.length") > 1, "the force")
    contact, force = page.run("return rumbles")[:2]
    assert (contact["kind"], contact["weakMagnitude"]) == ("dual-rumble", 1)
    assert force["strongMagnitude"] == pytest.approx(0.5)
    page.run("pad.buttons[0].pressed = false")
    page.wait(lambda: not drives(server)[-1]["held"], "the release")
    page.run("navigator.getGamepads = () => []; dispatchEvent(new Event('gamepaddisconnected'))")


def test_sound_is_off_until_switched_on(page: Browser, server: ScriptedServer) -> None:
    page.run(COUNTED)
    server.say(rest(0.2, 0.3, output=[0.0, 0.0, 2.0]))
    page.wait(lambda: float(page.data("scene", "force") or 0) > 1.9, "the force")
    assert page.run("return made") == 0
    page.choose("sound", "force")
    assert (page.run("return made"), page.run("return tones")) == (1, 1)
    sleep(0.2)  # the context begins to run
    server.say(rest(0.3, 0.4), rest(0.4, 0.5, output=[0.0, 0.0, 2.0]))
    page.wait(lambda: page.run("return tones") == 2, "the click of the contact")
    page.choose("sound", "off")


def falling(page: Browser, server: ScriptedServer, begin: float) -> set[str]:
    """How many packets' marks were seen in the air while new packets came."""
    seen = set()
    for k in range(8):
        server.say(session.samples("slave", begin + 0.05 * k, begin + 0.05 * (k + 1)))
        sleep(0.06)
        seen.add(page.data("scene", "falling"))
    return seen


def test_new_packets_fall_unless_motion_is_reduced(page: Browser, server: ScriptedServer) -> None:
    assert max(map(int, falling(page, server, 0.2))) > 0
    motion = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": motion})
    try:
        server.say(session.samples("slave", 0.6, 1.6))
        page.wait(lambda: page.data("scene", "falling") == "0", "the marks to lie")
        assert falling(page, server, 1.6) == {"0"}
    finally:
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_latency_is_time_to_first_row_that_follows(page: Browser, server: ScriptedServer) -> None:
    hold(page)
    sleep(0.25)  # the target is still
    chain(page).move_by_offset(30, 0).perform()
    after(server, page, lambda t: t @ RIGHT > 0.002)
    server.say(rest(0.2, 0.3, position=[0.0, 0.0, 0.001]))  # across
    assert page.run("return document.body.dataset.latencies ?? ''") == ""
    server.say(rest(0.3, 0.4, position=(0.001 * RIGHT).tolist()))
    page.wait(lambda: page.run("return document.body.dataset.latencies") != "", "the measurement")
    (took,) = map(float, page.run("return document.body.dataset.latencies").split())
    assert 1.0 < took < 1000.0
    assert "ms" in page.text("latency")
    let_go(page, server)


def test_clock_of_server_is_measured(page: Browser, server: ScriptedServer) -> None:
    server.answer = lambda asked: (
        {"type": "pong", "at": asked["at"], "now": 5.0 + asked["at"] / 1000.0} if asked["type"] == "ping" else None
    )
    server.say(session.hello(**DRIVEN))
    page.wait(lambda: page.run("return document.body.dataset.clockOffset || ''"), "the pong")
    offset, rtt = page.run("return [document.body.dataset.clockOffset, document.body.dataset.serverRtt].map(Number)")
    assert offset == pytest.approx(5000.0 - rtt / 2.0, abs=0.1)


def test_handle_is_drawn_with_newest_row(page: Browser, server: ScriptedServer) -> None:
    page.click("#pause")
    hold(page)
    page.wait(lambda: page.data("scene", "force") == "0", "the first row")
    server.say(rest(0.2, 0.3, output=[0.0, 3.0, 0.0]))
    page.wait(lambda: float(page.data("scene", "force")) == 3.0, "the newest row")
    let_go(page, server)
    page.click("#pause")
