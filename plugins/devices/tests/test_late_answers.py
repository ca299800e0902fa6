"""Answers that all come too late, the guardian's too; the driver waits longer than a force may stand."""

from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from plugins.devices.tests.test_contract import Haply, Inverse3
from weberlink.hardware.worker import LOST_S
from weberlink.master.devices.contract import DeviceFault
from weberlink.testing.devices import PUSH

REPLY_MS = 100.0
LEFT_S = 8.0


@pytest.mark.realtime
@pytest.mark.parametrize("late_s", [0.11, 0.15, 0.3])
@pytest.mark.parametrize("driver", [Haply, Inverse3])
def test_no_late_answer_is_taken_and_the_session_ends(driver: Any, late_s: float, tmp_path: Path) -> None:
    with driver().make_bench(tmp_path, reply_ms=REPLY_MS) as bench:
        bench.open()
        bench.push(PUSH, lambda: bench.displayed > 0.5)
        bench.faults["late"](late_s)
        began = newest = monotonic()
        with pytest.raises(DeviceFault):
            while monotonic() < began + LOST_S + LEFT_S:
                for now in bench.hold(PUSH, 1):
                    newest = max(newest, bench.device.latest(now).at)
        assert newest < began + 0.1, "an answer that was on its way"
