"""The page on a live session: figures of the report, a live change, and a picture."""

from collections.abc import Iterator
from math import nan
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest

from tests.apps.monitor.browser import Browser, believed, browser
from tests.apps.monitor.monitors import Monitor
from tests.system.processes import PATIENT, Program, document
from tests.system.systems import CONFIGS
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

pytestmark = pytest.mark.realtime

IN_CONTACT_N = 2.0
PAUSE_IN_CONTACT = """
const [least, models] = arguments;
const watch = setInterval(() => {
  const {force} = document.getElementById('scene').dataset;
  if (!(force >= least) || !models.includes(document.getElementById('model').dataset.value)) return;
  clearInterval(watch);
  document.getElementById('pause').click();
}, 20);
"""
"""Stops the drawing as soon as the operator feels so much [N] of what is believed to be one of these."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as one:
        one.size(1400, 900)
        one.scheme("dark")
        yield one


def value(report: dict[str, Any], path: str) -> float:
    """A figure of the report; NaN where it says that it is not known."""
    inner: Any = report
    for key in path.split("."):
        inner = inner[key]
    return nan if inner is None else float(inner)


def test_numbers_on_the_page_equal_the_report(page: Browser, tmp_path: Path) -> None:
    out = tmp_path / "report.json"
    with Monitor(tmp_path) as monitor:
        page.open(monitor.address)  # a monitor that is there before the session sees all of it
        # Of six degrees of freedom, which has every figure that there is.
        with Program("loopback", CONFIGS / "rotation.yaml", "--duration", "2", "--json", out, *PATIENT) as program:
            name = str(program.pid)
            page.wait(lambda: name in page.text("session").split(), "the session")
            page.choose("session", name)
            # A page that the machine holds up may see no more of three seconds than their end.
            page.wait(lambda: page.data("state") in ("engaged", "ended"), "the rows")
            assert program.finish()[0] == 0
        page.wait(lambda: page.data("state") == "ended", "the end")
        assert page.data("seen-from-start") == "true"
        shown = dict(
            page.run(
                "return [...document.querySelectorAll('[data-figure]')].map(e => [e.dataset.figure, e.dataset.value])"
            )
        )
        assert page.number("force-packets-now") == float(shown["force.packets_per_s"])
        assert page.console() == []
        assert len(page.hosts()) == 1
    report = document(out.read_text(encoding="utf-8"))
    report["felt"] = report["force"]
    assert len(shown) > 25
    assert float(shown["felt.packets"]) > 0
    for path, exact in shown.items():
        if path.startswith(("joint_", "gripper_")):
            assert exact == "", "of an arm alone"
            continue
        if path.startswith("now."):  # of the last moment, which no report has
            continue
        assert float(exact or "nan") == pytest.approx(value(report, path), rel=1e-9, nan_ok=True), path


@pytest.fixture(scope="module")
def demonstration(page: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, str]]:
    """A running session: process id of its launcher, and address of its page."""
    with (
        Program("loopback", *PATIENT) as program,
        Monitor(tmp_path_factory.mktemp("m"), "--session", program.pid) as monitor,
    ):
        page.open(monitor.address)
        yield program.pid, monitor.address


def test_predicted_surface_is_drawn(page: Browser, demonstration: tuple[int, str]) -> None:
    page.wait(lambda: page.data("scene") == "webgl", "the 3-D view")
    page.wait(lambda: page.number("duration") > 1.0, "rows")
    for _ in range(4):  # at some moments of a contact the surface is seen edge-on
        page.run(PAUSE_IN_CONTACT, IN_CONTACT_N, ["plane", "sphere"])
        page.wait(lambda: page.text("pause") == "Resume", "the hand on a surface")
        if believed(page) > 0.01:
            break
        page.run("document.getElementById('pause').click()")
        page.wait(lambda: page.text("pause") == "Pause", "the drawing to go on")
        sleep(0.7)
    assert believed(page) > 0.01
    assert page.number("felt-deadbands-now") >= 0.0
    assert page.console() == []


@pytest.mark.hunt
def test_weber_factor_from_the_page_takes_effect(page: Browser, demonstration: tuple[int, str]) -> None:
    session, address = demonstration
    page.open(address)
    page.wait(lambda: page.run("return !document.getElementById('weber').disabled"), "the slider")
    assert page.number("weber-value") == 0.1
    page.choose("weber", "0.2")
    page.wait(lambda: page.data("answer") in ("accepted", "refused"), "the answer")
    assert page.data("answer") == "accepted", page.text("answer")
    tick = int(page.data("answer", "tick"))
    assert f"from tick {tick} on" in page.text("answer")
    page.wait(lambda: page.text("weber-value") == "20 %", "what was agreed to be shown")

    def pressed() -> Any:
        """Of the last ticks, those in contact after the change."""
        with RingReader(default_path(f"{session}-slave")) as ring:
            records = ring.read()
        force = np.linalg.norm(records["raw"], axis=1)
        return records[(force > 1.0) & (records["settings"] == 1) & (records["ramping"] == 0)]

    page.wait(lambda: len(pressed()) > 100, "a touch under the new setting")
    after = pressed()
    share = after["bound"] / np.linalg.norm(after["raw"], axis=1)
    assert np.allclose(share, 0.2, rtol=1e-4)
    page.open(address)  # a page that comes later knows as well
    page.wait(lambda: page.number("weber-value") == 0.2, "the setting")
    assert page.console() == []
