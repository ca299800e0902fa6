"""The pedal: which events stop sessions, and what happens when it is lost."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

import pytest

from plugins.devices.tests.pads.test_gamepad import EV_ABS, EV_KEY, EV_SYN, Pad, codes
from tests.program import weberlink
from tests.wait import PATIENCE, until
from weberlink_devices.pedal import Pedal

PRESS, OTHER = (EV_KEY, codes.KEY_B, 1), (EV_KEY, codes.KEY_C, 1)


class Stop:
    """What the pedal uses of `EmergencyStop`: acknowledged at the look after `looks` of them."""

    def __init__(self, looks: float) -> None:
        self.looks = looks
        self.closed = False

    def advance(self, now: float) -> bool:
        self.looks -= 1
        return self.looks < 0

    def answer(self) -> dict[str, Any]:
        return (
            {"accepted": True, "sessions": ["7"]} if self.looks < 0 else {"accepted": False, "why": "7-slave: silent"}
        )

    def close(self) -> None:
        self.closed = True


class Watched:
    """A pedal that runs in a thread."""

    def __init__(self, keys: list[int] | None, looks: float) -> None:
        self.pad, self.stops, self.said, self._looks = Pad(), [], [], looks
        self._thread = Thread(target=Pedal(self.pad, keys, self._stop, self.said.append).run)
        self._thread.start()

    def _stop(self) -> Any:
        self.stops.append(Stop(self._looks))
        return self.stops[-1]

    def finish(self) -> None:
        self._looks = 0.0
        self.pad.unplug()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()
        self.pad.close()


@contextmanager
def watched(keys: list[int] | None = None, looks: float = 0.0) -> Iterator[Watched]:
    one = Watched(keys, looks)
    yield one
    one.finish()


@pytest.mark.parametrize(
    ("keys", "event", "stops"),
    [
        (None, PRESS, 1),
        (None, (EV_KEY, codes.KEY_B, 0), 0),
        (None, (EV_KEY, codes.KEY_B, 2), 0),
        (None, (EV_ABS, codes.ABS_X, 1), 0),
        (None, (EV_SYN, codes.SYN_DROPPED, 0), 1),
        ([codes.KEY_B], PRESS, 1),
        ([codes.KEY_B], OTHER, 0),
        ([codes.KEY_B], (EV_SYN, codes.SYN_DROPPED, 0), 1),
    ],
)
def test_a_press_and_lost_events_stop_and_nothing_else(
    keys: list[int] | None, event: tuple[int, int, int], stops: int
) -> None:
    with watched(keys) as pedal:
        pedal.pad.report(event)
        until(lambda: len(pedal.said) == stops, "the stop")
        pedal.pad.report(PRESS)
        until(lambda: len(pedal.said) > stops, "the press after it")
        assert (len(pedal.stops), pedal.said) == (stops + 1, ["stopped: 7"] * (stops + 1))
    assert len(pedal.stops) == stops + 2, "the loss"


def test_a_stop_that_is_not_acknowledged_is_told_and_a_new_press_takes_its_place() -> None:
    with watched(looks=float("inf")) as pedal:
        pedal.pad.report(PRESS)
        until(lambda: pedal.said == ["not stopped yet: 7-slave: silent; asked again"], "the line")
        pedal.pad.report(PRESS)
        until(lambda: len(pedal.stops) == 2, "the second press")
        until(lambda: pedal.stops[0].closed, "the end of the first stop")
        pedal.stops[1].looks = 0.0
        until(lambda: pedal.said[-1] == "stopped: 7", "the answer")


@pytest.mark.parametrize(
    ("arguments", "why"), [(["--key", "KEY_NONE"], "no such key"), ([], "No such file or directory")]
)
def test_a_pedal_that_cannot_be_used_is_one_line(arguments: list[str], why: str) -> None:
    status, output, errors = weberlink("pedal", "/dev/input/event-none", *arguments)
    assert (status, output, why in errors, len(errors.splitlines())) == (1, "", True, 1)
