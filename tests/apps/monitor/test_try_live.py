"""`weberlink try` in a real browser: a mouse on the dome, a second page, and a page that goes away."""

import json
import signal
from collections.abc import Iterator
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from tests.apps.monitor.browser import Browser, browser
from tests.apps.monitor.visits import visit
from tests.system.processes import Telemetry
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.ring import default_path

pytestmark = [pytest.mark.realtime(alone=True), pytest.mark.hunt]

CENTER, RADIUS, STIFFNESS = np.array((0.0, 0.0, -0.025)), 0.04, 1500.0
"""The dome of configs/try.yaml."""
RAMP_S = 0.05
"""Time in which the force fades in and out."""
REGRIPS = 3
"""Times that the visitor lets go of the handle within the dome and takes it again."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as one:
        one.size(1400, 900)
        yield one


@pytest.fixture(scope="module")
def seen(page: Browser, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What is left of a visit."""
    folder = tmp_path_factory.mktemp("visit")
    out = folder / "report.json"
    with visit(page, folder, "--json", out) as visitor:
        master, slave = (Telemetry(default_path(f"{visitor.session}-{side}")) for side in ("master", "slave"))
        visitor.grab()
        visitor.rub(3.5)
        records = master.records
        for _ in range(REGRIPS):
            visitor.release()
            sleep(0.3)
            visitor.grab()
            for down in range(0, 60, 3):
                visitor.move(0.0, float(down))
                sleep(0.03)
            packets = int(slave.last["updates_sent"])
        regripped = master.records[len(records) :]
        own = page.driver.current_window_handle
        page.driver.switch_to.new_window("tab")
        page.driver.get(visitor.monitor.address)
        page.wait(lambda: page.data("handle-state") not in ("", "none"), "who drives")
        second = page.data("handle-state")
        page.driver.switch_to.window(own)
        visitor.grab()
        visitor.rub(1.8)
        left = monotonic()
        page.driver.close()  # the page goes away while it holds
        page.driver.switch_to.window(page.driver.window_handles[0])
        closed = monotonic()
        sleep(0.5)
        after = master.records
        for telemetry in (master, slave):
            telemetry.close()
        visitor.monitor.send(signal.SIGINT)
        status, said = visitor.monitor.finish()
    return {
        "records": records, "regripped": regripped, "packets": packets, "second": second, "left": (left, closed),
        "after": after, "status": status, "said": said, "report": json.loads(out.read_text()),
    }  # fmt: skip


def force(records: Any) -> Any:
    return np.linalg.norm(records["output"], axis=1)


def depth(records: Any) -> Any:
    return RADIUS - np.linalg.norm(records["position"] - CENTER, axis=1)


@pytest.mark.parametrize("part", ["records", "regripped"])
def test_handle_is_no_deeper_than_its_force(part: str, seen: dict[str, Any]) -> None:
    records = seen[part]
    pressed = records[(records["ramping"] == 0) & (records["buttons"] == 1) & (depth(records) > 0.0)]
    assert len(pressed) > 1000
    assert force(pressed).max() > 1.0
    # Half a millimetre: what the deadbands of force and position and the delay of a busy machine allow.
    assert np.percentile(depth(pressed) - force(pressed) / STIFFNESS, 99) < 0.0005
    assert depth(records).max() < 0.006  # the pointer was 20 mm deep


def test_force_agrees_and_packets_are_counted(seen: dict[str, Any]) -> None:
    report = seen["report"]
    assert seen["status"] == 0, seen["said"]
    fades = 2.0 * RAMP_S * (REGRIPS + 2) / report["duration_s"]
    assert report["force"]["violation_fraction"] < 0.05 + fades
    assert 0 < seen["packets"] <= report["force"]["packets"] < 0.2 * report["force"]["samples"]


def test_second_page_is_told_that_somebody_drives(seen: dict[str, Any]) -> None:
    assert seen["second"] == "taken"


def test_closed_page_fades_the_force(seen: dict[str, Any]) -> None:
    left, closed = seen["left"]
    after = seen["after"]
    before = force(after[(after["at"] > left - 0.3) & (after["at"] < left)])
    assert before.max() > 0.5
    assert after["ramping"][-1] == RELEASED
    pulled = after["at"][(after["at"] > left) & (force(after) > 0.01 * before.max())]
    assert pulled.max(initial=left) < closed + 0.1
