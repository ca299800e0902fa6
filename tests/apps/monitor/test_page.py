"""The page in a browser, with scripted messages."""

from collections.abc import Iterator
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.apps.monitor import synthetic_session as session
from tests.apps.monitor.browser import Browser, believed, browser
from tests.apps.monitor.scripted_server import Message, ScriptedServer
from tests.apps.monitor.scripted_visit import unasked, visit

UNKNOWN = "\N{EN DASH}"
PANELS = ["force", "felt", "position", "packets", "delay", "ticks", "energy", "timeline"]
PANELS_OF_SIX = ["force", "torque", "position", "orientation", "felt", "packets", "delay", "ticks", "timeline"]
SETTINGS = {"weber": 0.1, "predictor": "hybrid"}
REPORT: Message = {
    "duration_s": 6.0,
    "ticks": {
        "master": {"count": 6012, "missed": 3, "lateness_us": {"p50": 57.2, "p99": 178.4}, "work_us": {"p50": 43.1}},
        "slave": {"count": 6001, "missed": 0, "lateness_us": {"p50": 54.9, "p99": None}, "work_us": {"p50": 37.0}},
    },
    "force": {
        "samples": 6001,
        "packets": 24,
        "packets_per_s": 4.0123456,
        "reduction": 0.9960006666,
        "reduction_all": 0.977,
        "error_rms": 0.0811,
        "violation_fraction": 0.0142,
        "error_p99_deadbands": 1.11,
    },
    "position": {"packets_per_s": 38.5, "reduction": 0.9615, "error_rms": 0.000122, "violation_fraction": None},
    "link": {"rtt_us": {"p50": 320.5, "p99": 690.0}, "lost": 0},
    "limited": {"force_ticks": 21, "slew_ticks": 7, "motion_ticks": 0, "contact_ticks": 5},
}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as one:
        one.size(1400, 900)
        yield one


@pytest.fixture(scope="module")
def served() -> Iterator[ScriptedServer]:
    with ScriptedServer() as one:
        yield one


@pytest.fixture
def server(page: Browser, served: ScriptedServer) -> Iterator[ScriptedServer]:
    with unasked(page, served) as one:
        yield one


def told(begin: float = 0.0, end: float = 6.0) -> list[Message]:
    """Rows of both sides and the felt error."""
    sides = [session.samples(side, begin, end) for side in ("master", "slave")]
    return [*sides, session.felt(begin, end)]


def clean(page: Browser, server: ScriptedServer) -> None:
    """Nothing was complained of, and nobody else was spoken to."""
    assert page.console() == []
    assert page.hosts() == {f"127.0.0.1:{server.port}"}


def test_session_is_shown_in_every_panel(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told(), session.figures(REPORT), anew=True)
    page.wait(lambda: page.data("state") == "engaged", "the state")
    page.wait(lambda: page.number("force-packets-now") == 12.0, "the figures")
    assert page.text("state") == "engaged"
    assert page.text("force-packets-now") == "12"
    assert page.text("force-reduction-now") == "98.8 %"
    assert page.number("rate") == 1000.0
    assert page.text("felt-deadbands-now") == "0.40"
    assert page.text("faults") == "none"
    last = session.samples("master", 0.0, 6.0)["columns"]["rtt_us"][-1]
    assert page.number("rtt-now") == last
    assert page.text("rtt-now") == f"{last / 1000:.2f}"
    for panel in PANELS:
        assert page.pixels(f"#panel-{panel} canvas") > 5, panel
        assert page.run("return document.querySelector(arguments[0]).innerText", f"#panel-{panel} .help") == "?"
    notes = "return [...document.querySelectorAll('.empty')].filter(e => e.offsetParent).map(e => e.innerText)"
    page.wait(lambda: not any(page.run(notes)), "every panel to be filled")
    clean(page, server)


def seen(page: Browser) -> set[str]:
    """Panels of charts that take room."""
    names = "return [...document.querySelectorAll('#charts .panel')].filter(e => e.clientHeight).map(e => e.id)"
    return {name.removeprefix("panel-") for name in page.run(names)}


def test_6_dof_session_has_torque_and_orientation(page: Browser, server: ScriptedServer) -> None:
    six = REPORT | {
        "torque": {"packets_per_s": 8.8, "reduction": 0.991, "error_rms": 0.0023, "violation_fraction": 0.004},
        "orientation": {"packets_per_s": 14.6, "reduction": 0.985, "error_rms": 0.0028, "violation_fraction": None},
    }
    rows = [session.rotation(side, 0.0, 6.0) for side in ("master", "slave")]
    visit(page, server, session.hello_of_six(), *rows, session.felt(0.0, 6.0), session.figures(six))
    page.wait(lambda: page.number("force-packets-now") == 12.0, "the figures")
    assert seen(page) == set(PANELS_OF_SIX)
    for panel in ("torque", "orientation"):
        page.wait(lambda panel=panel: page.pixels(f"#panel-{panel} canvas") > 5, panel)
    legends = "return document.querySelector(arguments[0]).textContent"
    page.wait(lambda: "50" in page.run(legends, "#panel-torque .legend"), "the torque")
    page.wait(lambda: "17.2 °" in page.run(legends, "#panel-orientation .legend"), "the angle")
    table = page.text("panel-figures")
    assert "2.30 mN" in table and "0.160°" in table and "8.8" in table
    page.wait(lambda: page.data("scene", "turned") != "", "the tool")
    assert float(page.data("scene", "turned")) == pytest.approx(0.3)
    server.say(session.hello(session="1235"), *told(), session.figures(REPORT))
    page.wait(lambda: page.data("scene", "turned") == "", "the next session")
    assert seen(page) == set(PANELS)
    assert "torque" not in page.text("panel-figures")
    clean(page, server)


REPORT_OF_ARM: Message = {name: figures for name, figures in REPORT.items() if name not in ("force", "position")} | {
    "joint_torque": REPORT["force"] | {"error_rms": 0.0123},
    "joint_angle": REPORT["position"] | {"error_rms": 0.0021},
    "gripper_torque": {"packets_per_s": 2.5, "reduction": 0.9975, "error_rms": 0.004, "violation_fraction": 0.0},
    "gripper_angle": {"packets_per_s": 9.5, "reduction": 0.9905, "error_rms": 0.003, "violation_fraction": None},
}
NOW_OF_ARM = {"joint_torque": 12.0, "joint_angle": 38.0, "gripper_torque": 4.0, "gripper_angle": 9.0}


def of_arm(**other: object) -> list[Message]:
    """All messages of a session of two arms."""
    rows = [session.arm(side, 0.0, 6.0) for side in ("master", "slave")]
    saved = {name: 1.0 - pace / 1000.0 for name, pace in NOW_OF_ARM.items()}
    figures = session.figures(REPORT_OF_ARM, packets_per_s_now=NOW_OF_ARM, reduction_now=saved)
    return [session.hello_of_arm(**other), *rows, session.felt(0.0, 6.0), figures]


def test_arm_shows_axes_by_name(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, *of_arm())
    page.wait(lambda: page.number("force-packets-now") == 12.0, "the figures")
    assert seen(page) == {
        "joint-torque",
        "joint-angle",
        "joint-packets",
        "felt",
        "delay",
        "ticks",
        "energy",
        "timeline",
    }
    assert page.run("return document.getElementById('panel-scene').clientHeight") == 0
    table = "return [...document.getElementById(arguments[0]).rows].map(r => [...r.cells].map(c => c.textContent))"
    page.wait(
        lambda: not {"", UNKNOWN} & {*page.run(table, "axes")[0], *page.run(table, "arm-channels")[0]},
        "both sides and their packets",
    )
    rows = page.run(table, "axes")
    assert [row[0] for row in rows] == session.ARM
    last = {side: session.arm(side, 0.0, 6.0)["columns"] for side in ("master", "slave")}
    values = (
        "return [...document.getElementById('axes').rows].map(r => [...r.cells].slice(1).map(c => c.dataset.value))"
    )
    for axis, (leader, follower, measured, felt) in enumerate(page.run(values)):
        assert float(leader) == last["master"]["joint_position"][axis][-1]
        assert float(follower) == last["slave"]["joint_position"][axis][-1]
        assert float(measured) == last["slave"]["joint_raw"][axis][-1]
        assert float(felt) == last["master"]["joint_output"][axis][-1]
    assert page.run(table, "arm-channels") == [
        ["joints, angles", "38.0", "1\u202f000", "96.2 %"],
        ["joints, torques", "12.0", "1\u202f000", "98.8 %"],
        ["gripper, angle", "9.0", "1\u202f000", "99.1 %"],
        ["gripper, torque", "4.0", "1\u202f000", "99.6 %"],
    ]
    figures = page.text("panel-figures")
    assert "12.3 mN" in figures and "0.120°" in figures and "torque packets 24" in figures
    clean(page, server)


def test_axis_of_arm_charts_can_be_chosen(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, *of_arm())
    legend = "return document.querySelector('#panel-joint-angle .legend').textContent"
    page.wait(lambda: "°" in page.run(legend) and UNKNOWN not in page.run(legend).split("°")[0], "the angle")
    first = page.run(legend)
    for panel in ("joint-torque", "joint-angle", "joint-packets"):
        page.wait(lambda panel=panel: page.pixels(f"#panel-{panel} canvas") > 5, panel)
    choose = (
        "const s = document.querySelector('#panel-joint-angle select'); s.selectedIndex = 5;"
        "s.dispatchEvent(new Event('change')); return [...s.options].map(o => o.text)"
    )
    assert page.run(choose) == session.ARM
    page.wait(lambda: page.run(legend) != first and "°" in page.run(legend), "the gripper")
    server.say(session.hello(session="1235"), *told(), session.figures(REPORT))
    page.wait(lambda: seen(page) == set(PANELS), "the Cartesian session")
    assert page.run("return document.getElementById('panel-arm').clientHeight") == 0


def test_deadband_is_green_and_packets_are_marks(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told(), anew=True)  # the charts are empty before

    def shares(chart: str) -> tuple[float, float]:
        """Shares of a chart that are green and pink."""
        red, green, blue = np.moveaxis(page.picture_of(f"chart-{chart}"), 2, 0)
        return float(np.mean(green - np.maximum(red, blue) > 0.03)), float(np.mean(np.minimum(red, blue) - green > 0.3))

    page.wait(lambda: shares("force")[0] > 0.005 and shares("force")[1] > 0.005, "band and marks of the force")
    page.wait(lambda: shares("position")[1] > 0.002, "marks of the position")
    page.wait(lambda: shares("felt")[0] > 0.2, "the zone below 1 deadband")
    assert shares("felt")[1] < 0.001


def test_figures_equal_the_report_exactly(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told(), session.figures(REPORT))
    page.wait(lambda: page.data("force-packets") == "24", "the figures")
    shown = page.run(
        "return [...document.querySelectorAll('[data-figure]')]"
        ".map(e => [e.dataset.figure, e.dataset.value, e.textContent])"
    )
    assert len(shown) > 25
    for path, exact, text in shown:
        expected: Any = REPORT | {"felt": REPORT["force"]}
        for key in path.split("."):
            expected = expected.get(key) if isinstance(expected, dict) else None
        if expected is None:
            assert (exact, text) == ("", UNKNOWN), path
        else:
            assert float(exact) == expected, path
            assert text != UNKNOWN, path
    assert page.text("missed-master") == "3"
    assert page.text("felt-violation") == "1.4 %"
    assert page.text("rtt") == "0.32 ms"
    clean(page, server)


def test_predicted_surface_is_drawn_and_named(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(scene=session.EVERY_SHAPE), *told(), anew=True)
    page.wait(lambda: page.data("scene") == "webgl", "the 3-D view")
    page.wait(lambda: page.data("model") == "sphere", "the model")
    assert "radius 50.0 mm" in page.text("model")
    assert "500 N/m" in page.text("model")
    assert float(page.data("scene", "force")) > 0.5
    before = believed(page)
    assert before > 0.01
    server.say(*(session.samples(side, 6.0, 6.1, model=2) for side in ("master", "slave")))
    page.wait(lambda: page.data("model") == "plane", "the other model")
    server.say(*(session.samples(side, 6.1, 6.2, model=0) for side in ("master", "slave")))
    page.wait(lambda: page.data("model") == "hold", "no model")
    page.wait(lambda: believed(page) < 0.3 * before, "the surface to be gone")
    clean(page, server)


def test_change_request_and_answer_are_shown(page: Browser, server: ScriptedServer) -> None:
    def answer(asked: Message) -> Message:
        if asked.get("predictor") == "zoh":
            return {"type": "answer", "accepted": False, "why": "the bank has no zoh"}
        changed = SETTINGS | {name: setting for name, setting in asked.items() if name != "type"}
        if asked.get("weber") == 0.15:
            before = SETTINGS | {"weber": 0.05}
            return {
                "type": "answer",
                "accepted": True,
                "settings": before,
                "pending": changed,
                "generation": 1,
                "tick": 2,
            }
        return {
            "type": "answer",
            "accepted": True,
            "settings": changed,
            "pending": None,
            "generation": 1,
            "tick": 12345,
        }

    server.answer = answer
    visit(page, server, session.hello(), *told())
    page.wait(lambda: page.run("return !document.getElementById('weber').disabled"), "the slider")
    assert page.text("weber-value") == "10 %"
    before = page.run("return document.querySelector('#panel-felt canvas').toDataURL()")
    page.choose("weber", "0.05")
    page.wait(lambda: page.data("answer") == "accepted", "the answer")
    assert server.asked == [{"type": "change", "weber": 0.05}]
    assert page.text("answer") == "from tick 12345 on, both ends"
    assert page.text("weber-value") == "5 %"
    page.wait(lambda: page.run("return document.querySelector('#panel-felt canvas').toDataURL()") != before, "the mark")
    page.choose("weber", "0.15")  # agreed, but in force from a later tick on
    page.wait(lambda: page.data("answer", "tick") == "2", "the answer")
    assert page.text("weber-value") == "15 %"
    server.say(session.figures(REPORT, settings=SETTINGS | {"weber": 0.05}, generation=1))
    page.wait(lambda: page.data("force-packets") == "24", "figures from before it")
    assert page.text("weber-value") == "15 %"
    server.say(session.figures(REPORT, settings=SETTINGS | {"weber": 0.16}, generation=2))
    page.wait(lambda: page.text("weber-value") == "16 %", "what is in force")
    page.choose("predictor", "zoh")
    page.wait(lambda: page.data("answer") == "refused", "the refusal")
    assert page.text("answer") == "not changed: the bank has no zoh"
    assert page.picked("predictor") == "hybrid"
    assert server.asked[2:] == [{"type": "change", "predictor": "zoh"}]
    clean(page, server)


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (
            {"readonly": True, "changes": [], "sides": {"master": session.description("master", []), "slave": None}},
            "live_changes",
        ),
        ({"readonly": True}, "the address with the key"),
    ],
)
def test_disabled_controls_say_why(page: Browser, server: ScriptedServer, other: Message, reason: str) -> None:
    visit(page, server, session.hello(**other), *told())
    for name in ("weber", "predictor"):
        assert page.run("return document.getElementById(arguments[0]).disabled", name)
        assert reason in page.run("return document.getElementById(arguments[0]).title", f"control-{name}")
    assert reason in page.text("answer")


def test_single_side_shows_its_data(page: Browser, server: ScriptedServer) -> None:
    alone = session.hello(present=["slave"], sides={"master": None, "slave": session.description("slave")})
    visit(page, server, alone, session.samples("slave", 0.0, 3.0))
    page.wait(lambda: page.text("state-detail") == "slave only", "the side")
    assert isnan(page.number("felt-deadbands-now"))
    page.wait(lambda: "both sides" in page.text("chart-felt"), "the note in the chart")
    assert page.number("rtt-now") > 0.0
    clean(page, server)


def test_unknown_values_and_faults_are_shown(page: Browser, server: ScriptedServer) -> None:
    unknown = [None] * 3
    nothing: Message = {
        "type": "samples",
        "side": "master",
        "t": [0.004, 0.008, 0.012],
        "columns": {
            "position": [unknown] * 3,
            "rtt_us": unknown,
            "state": [4, 4, 5],
            "fault": [0, 0, 1],
            "model": [0, 0, 0],
        },
    }
    empty: Message = {"type": "samples", "side": "slave", "t": [], "columns": {}}
    visit(page, server, session.hello(scene=[]), nothing, empty, session.felt(0.0, 0.01, None))
    page.wait(lambda: page.data("state") == "silent", "the state")
    server.say(session.figures({}, faults={"master": {"silence": 2}, "slave": {}}), {"type": "news of a later version"})
    page.wait(lambda: page.data("faults") == "2", "the faults")
    assert page.text("faults") == "silence"
    assert page.data("tile-faults", "level") == "bad"
    assert page.text("rtt-now") == UNKNOWN
    clean(page, server)


def test_released_button_and_trip_are_shown(page: Browser, server: ScriptedServer) -> None:
    rows = told()
    for message in rows[:2]:
        message["columns"]["ramping"] = [2] * len(message["t"])
    rows[1]["columns"]["fault"] = [8] * len(rows[1]["t"])
    met = {"master": {}, "slave": {"tripped": 1}}
    visit(page, server, session.hello(), *rows, session.figures(REPORT, faults=met))
    page.wait(lambda: page.data("state") == "released", "the state")
    assert page.text("state-detail") == "hold the button to engage"
    page.wait(lambda: page.text("faults") == "tripped", "the faults")
    assert page.number("slew-limited") == REPORT["limited"]["slew_ticks"]
    assert page.number("contact-limited") == REPORT["limited"]["contact_ticks"]
    clean(page, server)


@pytest.mark.parametrize(("deadbands", "zone"), [(0.4, "within"), (1.0, "within"), (19.2, "over"), (None, "")])
def test_felt_error_is_named_by_its_value(
    page: Browser, server: ScriptedServer, deadbands: float | None, zone: str
) -> None:
    rows = [*(session.samples(side, 0.0, 2.0) for side in ("master", "slave")), session.felt(0.0, 2.0, deadbands)]
    visit(page, server, session.hello(), *rows)
    shown = nan if deadbands is None else deadbands
    page.wait(lambda: page.number("felt-deadbands-now") == pytest.approx(shown, nan_ok=True), "the value")
    assert page.data("felt-zone") == zone
    assert page.text("felt-zone").partition(" ")[0] == zone
    style = "return getComputedStyle(document.getElementById(arguments[0]))[arguments[1]]"
    assert page.run(style, "felt-zone", "color") == page.run(style, "felt-bar", "backgroundColor")


def test_ended_session_keeps_figures_until_the_next(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told())
    server.say(session.figures(REPORT, ended=True))
    page.wait(lambda: page.data("state") == "ended", "the end")
    assert page.text("state-detail") == "these are the final figures"
    assert page.number("force-packets-now") == REPORT["force"]["packets_per_s"]
    assert (page.text("felt-deadbands-now"), page.text("felt-of")) == ("1.11", "deadbands, p99")
    assert page.text("duration") == "6.0 s"
    assert page.run("return document.getElementById('weber').disabled")
    server.say(session.hello(session="5678"), session.samples("master", 0.0, 0.5), session.samples("slave", 0.0, 0.5))
    page.wait(lambda: page.data("state") == "engaged", "the next session")
    page.wait(lambda: 0.0 < page.number("duration") < 1.0, "its time")
    assert page.data("force-packets") == ""
    clean(page, server)


def test_page_reconnects_to_the_monitor(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told())
    page.wait(lambda: page.data("state") == "engaged", "the state")
    server.stop()
    page.wait(lambda: page.data("state") == "lost", "the loss")
    assert page.text("state") == "no monitor"
    assert page.run("return document.getElementById('weber').disabled")
    server.start()
    page.wait(lambda: page.data("state") == "engaged", "the return")
    assert page.hosts() == {f"127.0.0.1:{server.port}"}


def test_waiting_for_a_session_is_shown(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, anew=True)
    page.wait(lambda: page.text("state-detail") == "waiting for a session to begin", "the state")
    assert page.picked("session") == "none"
    clean(page, server)


def test_another_session_can_be_selected(page: Browser, server: ScriptedServer) -> None:
    server.sessions = [{"session": "5678", "live": True}, {"session": "1234", "live": True}]
    visit(page, server, session.hello(session="5678"), *told(0.0, 0.5), anew=True)
    page.wait(lambda: page.run("return document.getElementById('session').length") == 2, "both sessions")
    assert server.followed[-1] is None
    page.choose("session", "1234")
    page.wait(lambda: server.followed[-1] == "1234", "the choice")
    clean(page, server)


def test_drawing_can_be_paused_and_windowed(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told())
    page.wait(lambda: page.number("duration") > 5.9, "the rows")

    def chart() -> str:
        return str(page.run("return document.querySelector('#panel-force canvas').toDataURL()"))

    page.click("#pause")
    page.wait(lambda: page.text("pause") == "Resume", "the pause")
    page.wait(lambda: chart() == chart(), "the drawing to stop")
    still = chart()
    server.say(*told(6.0, 8.0))
    page.wait(lambda: page.number("duration") > 7.9, "newer rows")
    assert chart() == still
    page.click("#pause")
    page.wait(lambda: chart() != still, "the drawing to go on")
    five = chart()
    page.click('[data-window="20"]')
    page.wait(lambda: chart() != five, "the other window")
    assert page.run("return document.querySelector('[data-window=\"20\"]').getAttribute('aria-pressed')") == "true"
    page.click('[data-window="5"]')
    clean(page, server)


@pytest.mark.parametrize(
    ("width", "greeting"),
    [
        (1000, session.hello()),
        (1000, session.hello_of_six()),
        (2200, session.hello_of_six()),
        (1000, session.hello_of_arm()),
        (400, session.hello_of_arm()),
    ],
    ids=["narrow", "narrow, 6 DoF", "wide, 6 DoF", "narrow, arm", "phone, arm"],
)
def test_layout_is_stable_at_every_width(page: Browser, server: ScriptedServer, width: int, greeting: Message) -> None:
    boxes = (
        "return [...document.querySelectorAll('.tile, .panel')].filter(e => e.offsetParent).map(e => {"
        "const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height].map(Math.round)})"
    )
    page.size(width, 900)
    try:
        visit(page, server, greeting)
        before = page.run(boxes)
        rows = told() if greeting.get("axes") is None else of_arm()[1:-1]
        server.say(*rows, session.figures(REPORT, faults={"master": {"silence": 1}, "slave": {"update": 2}}))
        page.wait(lambda: page.data("faults") == "3", "the figures")
        assert page.run(boxes) == before
        assert page.run("return document.documentElement.scrollWidth") <= width
        assert min(box[3] for box in before) > 60
    finally:
        page.size(1400, 900)


def test_keyboard_reaches_all_controls(page: Browser, server: ScriptedServer) -> None:
    visit(page, server, session.hello(), *told())
    page.wait(lambda: page.run("return !document.getElementById('weber').disabled"), "the controls")
    reach = page.run(
        "return [...document.querySelectorAll('button, input, select, #scene')]"
        ".filter(e => !e.disabled && e.tabIndex < 0).map(e => e.outerHTML)"
    )
    assert reach == []
    unnamed = page.run(
        "return [...document.querySelectorAll('button.help')].filter(e => "
        "!document.getElementById(e.getAttribute('aria-describedby')).textContent.includes('.')).length"
    )
    assert unnamed == 0
    page.wait(lambda: page.data("scene") == "webgl", "the 3-D view")
    drawn = int(page.run("return document.body.dataset.drawn"))
    page.driver.find_element("id", "scene").send_keys("\ue012")  # the left arrow
    page.wait(lambda: int(page.run("return document.body.dataset.drawn")) > drawn, "the turned view")


def test_page_works_without_webgl(tmp_path: Path) -> None:
    with browser(tmp_path, webgl=False) as page, ScriptedServer() as server:
        visit(page, server, session.hello(), *told())
        page.wait(lambda: page.data("state") == "engaged", "the state")
        page.wait(lambda: page.data("scene") == "missing", "the 3-D view")
        assert "WebGL" in page.text("scene")
        assert page.pixels("#panel-force canvas") > 5
        clean(page, server)


LINK: Message = {
    "ways_now": {
        "jitter_us": 3700.0,
        "to_slave": {"one_way_us": 16_240.0, "loss": 0.034, "burst": None},
        "to_master": {"one_way_us": 17_310.0, "loss": 0.012, "burst": 1.5},
    },
    "paths": [
        {"side": "master", "place": 0, "route": "relayed", "words": "relayed by relay.example over wlan0", "changes": 1,
         "remote": "198.51.100.7:3478", "class": "DSCP 46 came as 0"},
        {"side": "master", "place": 1, "route": "relayed", "words": "relayed by relay.example over usb0", "changes": 0,
         "remote": "198.51.100.7:3478", "class": ""},
    ],
    "finding": "",
}  # fmt: skip
WAYS: Message = {
    "jitter_us": {"p50": 3600.0, "p99": 5800.0},
    "to_slave": {"one_way_us": {"p50": 16_600.0, "p99": 17_900.0}, "loss": 0.0191, "burst": None},
    "to_master": {"one_way_us": {"p50": 16_500.0, "p99": 18_100.0}, "loss": 0.021, "burst": 1.3},
}


@pytest.mark.parametrize("width", [1400, 375])
def test_link_panel_shows_ways_and_paths(page: Browser, server: ScriptedServer, width: int) -> None:
    page.size(width, 900)
    try:
        visit(page, server, session.hello(), *told(), session.figures(REPORT | {"ways": WAYS}, **LINK), anew=True)
        page.wait(lambda: page.text("route") == "relayed", "the route")
        page.run("document.getElementById('page-link').click()")
        page.wait(lambda: "16.2" in page.text("way-to-slave"), "the panel")
        rows = [" ".join(row.split()) for row in page.text("panel-link").splitlines()]
        assert "to slave 16.2 16.6 17.9 3.4 % 1.91 % \N{EN DASH}" in " ".join(rows)
        assert "to master 17.3 16.5 18.1 1.2 % 2.10 % 1.3" in " ".join(rows)
        assert rows[-2:] == [
            "master relayed by relay.example over wlan0, to 198.51.100.7:3478, 1 change, DSCP 46 came as 0",
            "master, path 2 relayed by relay.example over usb0, to 198.51.100.7:3478",
        ]
        assert page.number("jitter") == 3700.0
        wide = "return document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        assert page.run(wide), "nothing sticks out"
        clean(page, server)
    finally:
        page.run("document.getElementById('page-figures').click()")
        page.size(1400, 900)


def test_search_for_a_path_is_told_beside_the_state(page: Browser, server: ScriptedServer) -> None:
    rows = [session.samples("master", 0.0, 2.0, state=2)]
    finding = {"paths": [], "finding": "asking the mailbox"}
    visit(page, server, session.hello(present=["master"]), *rows, session.figures(REPORT, **finding), anew=True)
    page.wait(lambda: page.text("state-detail") == "asking the mailbox", "the note")
    server.say(session.figures(REPORT, paths=[], finding=""))
    page.wait(lambda: page.text("state-detail") == "master only", "the path")
    clean(page, server)
