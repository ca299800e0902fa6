"""Answers that all come too late, the guardian's too; the driver waits longer than a force may stand."""

from functools import partial
from pathlib import Path
from time import monotonic

import pytest

from tests.master.devices.benches import Bench, inverse3, on_a_pty
from weberlink.hardware.worker import LOST_S
from weberlink.master.devices.contract import DeviceFault

REPLY_MS = 100.0
PUSH = (0.0, 1.0, 0.0)
LEFT_S = 8.0


def drive(bench: Bench) -> float:
    """Time of the reading after a tick that pushes."""
    (now,) = bench.hold(PUSH, 1)
    return bench.device.latest(now).at


@pytest.mark.parametrize("late_s", [0.11, 0.15, 0.3])
@pytest.mark.parametrize("name", ["haply_2diy", "inverse3"])
def test_no_late_answer_is_taken_and_the_session_ends(name: str, late_s: float, tmp_path: Path) -> None:
    make = inverse3 if name == "inverse3" else partial(on_a_pty, name)
    with make(tmp_path, reply_ms=REPLY_MS) as bench:
        bench.device.open(bench.tick())
        while bench.displayed is not None and bench.displayed() < 0.5:
            drive(bench)
        bench.faults["late"](late_s)
        began = monotonic()
        newest = began
        with pytest.raises(DeviceFault):
            while monotonic() < began + LOST_S + LEFT_S:
                newest = max(newest, drive(bench))
        assert newest < began + 0.1, "an answer that was on its way"
