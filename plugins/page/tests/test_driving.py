"""Who has the handle of a session, and what reaches the device."""

import json
from pathlib import Path
from typing import Any

import pytest

from plugins.figures.tests.sources import HandSource
from weberlink.geometry.vector import Vector
from weberlink_figures.watching.session import WatchedSession
from weberlink_page import driving
from weberlink_page.driving import BURST, LEASE_S, MOST_PER_S, Driving
from weberlink_page.requests import Requests
from weberlink_page.viewer import Viewer

PID = 4711
ABOVE, BELOW = (0.0, 0.0, 0.03), (0.0, 0.01, -0.02)


class Device:
    def __init__(self, pid: int) -> None:
        assert pid == PID
        self.sent: list[tuple[Vector, bool]] = []
        self.is_closed = False

    def send(self, target: Vector, held: bool) -> bool:
        assert not self.is_closed
        self.sent.append((target, held))
        return True

    def close(self) -> None:
        self.is_closed = True


class Visit:
    """A session that pages drive, at a time that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.source = HandSource("master", ring=Path("/nonexistent"))
        assert self.source.description is not None
        self.source.description |= {"pid": PID, "system": {"master": {"device": {"driver": "pointer"}}}}
        self.pages = [Viewer(None, may_change=True) for _ in range(2)]
        self.devices: list[Device] = []
        self.driving = Driving({"7": WatchedSession("7", self.source)}, lambda _: self.pages, self._connect)
        self.requests = Requests()
        self.requests.handlers["drive"] = self.driving.drive
        self.now = 100.0
        monkeypatch.setattr(driving, "monotonic", lambda: self.now)
        for page in self.pages:
            page.watching = "7"
            self.driving.tell(page)

    def _connect(self, pid: int) -> Device:
        self.devices.append(Device(pid))
        return self.devices[-1]

    def drive(self, page: int, target: Any, held: Any) -> dict[str, Any] | None:
        request = {"type": "drive", "target": target, "held": held}
        with pytest.raises(StopIteration) as ended:  # it waits for nothing, so it needs no event loop
            self.requests.answer(self.pages[page], request).send(None)
        answer: dict[str, Any] | None = ended.value.value
        return answer

    def states(self) -> list[str]:
        return [[json.loads(text) for text in iter(page.take, None)][-1]["state"] for page in self.pages]


@pytest.fixture
def visit(monkeypatch: pytest.MonkeyPatch) -> Visit:
    return Visit(monkeypatch)


def test_first_page_that_holds_drives(visit: Visit) -> None:
    assert visit.states() == ["free", "free"]
    assert visit.drive(1, ABOVE, False) is None and visit.devices == []
    assert visit.drive(0, ABOVE, True) is None
    assert visit.states() == ["yours", "taken"]
    refused = visit.drive(1, BELOW, True)
    assert refused is not None and (refused.pop("type"), refused.pop("state")) == ("handle", "taken")
    assert list(refused) == ["why"], "as the message is declared"
    assert visit.drive(1, BELOW, False) is None
    assert [device.sent for device in visit.devices] == [[(ABOVE, True)]]


def test_released_handle_is_kept_for_a_while(visit: Visit) -> None:
    visit.drive(0, ABOVE, True)
    visit.drive(0, BELOW, False)
    assert visit.devices[0].sent[-1] == (BELOW, False)
    visit.now += LEASE_S - 0.1
    visit.driving.look(visit.now)
    assert visit.states() == ["yours", "taken"]
    visit.drive(0, BELOW, True)
    visit.now += LEASE_S - 0.1
    visit.driving.look(visit.now)
    assert visit.driving.is_any
    visit.now += 0.2
    visit.driving.look(visit.now)
    assert visit.states() == ["free", "free"] and not visit.driving.is_any
    assert visit.devices[0].is_closed
    visit.drive(1, ABOVE, True)
    assert visit.states() == ["taken", "yours"]


@pytest.mark.parametrize("held", [True, False])
def test_leaving_page_releases_once(visit: Visit, held: bool) -> None:
    visit.drive(0, ABOVE, True)
    visit.drive(0, BELOW, held)
    visit.driving.leave(visit.pages[0])
    assert visit.devices[0].sent[-1] == (BELOW, False)
    assert [state for _, state in visit.devices[0].sent].count(False) == 1
    assert visit.devices[0].is_closed and visit.states() == ["free", "free"]


def test_end_of_the_session_frees_the_handle(visit: Visit) -> None:
    visit.drive(0, ABOVE, True)
    visit.source.drained = True
    visit.driving.look(visit.now)
    assert visit.states() == ["none", "none"] and visit.devices[0].is_closed
    refused = visit.drive(0, ABOVE, True)
    assert refused is not None and refused["state"] == "none"


def test_absurd_rate_is_limited_but_releases_pass(visit: Visit) -> None:
    for _ in range(5 * 240):
        visit.now += 1.0 / 240
        visit.drive(0, ABOVE, True)
    assert len(visit.devices[0].sent) == 5 * 240, "a usual rate of a mouse passes"
    visit.devices[0].sent.clear()
    for _ in range(10_000):
        visit.now += 1e-4
        visit.drive(0, ABOVE, True)
    assert MOST_PER_S - 1 <= len(visit.devices[0].sent) <= MOST_PER_S + BURST + 1
    visit.drive(0, BELOW, False)
    assert visit.devices[0].sent[-1] == (BELOW, False)
