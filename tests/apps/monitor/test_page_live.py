"""The page on a live session: figures of the report, a live change, and a picture."""

from collections.abc import Iterator
from math import nan
from pathlib import Path
from typing import Any

import pytest

from tests.apps.monitor.browser import Browser, browser
from tests.apps.monitor.monitors import Monitor
from tests.program import PATIENT, Program, document
from tests.system.systems import CONFIGS

pytestmark = pytest.mark.realtime


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
