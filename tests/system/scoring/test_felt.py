"""The felt error in JNDs, against a sum over ticks."""

import numpy as np
import pytest

from weberlink.protocol.states import State
from weberlink.system.scoring.perception import FeltError, Threshold
from weberlink.telemetry.reader import DTYPE


def ticks(count, **values):
    records = np.zeros(count, DTYPE)
    records["state"] = State.ENGAGED.value
    for name, value in values.items():
        records[name] = value
    return records


def test_errors_are_counted_in_thresholds_of_the_measured_force():
    felt = FeltError(Threshold(0.10, 0.02))
    master = ticks(2, output=[[0.0, 0.0, 2.2], [0.0, 0.0, 0.01]])
    slave = ticks(2, raw=[[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    felt.add(master, slave)
    assert felt.rms_jnd == pytest.approx(((1.0**2 + 0.5**2) / 2) ** 0.5)


def test_ticks_out_of_session_or_in_a_ramp_do_not_count():
    felt = FeltError(Threshold(0.10, 0.02))
    assert felt.rms_jnd is None
    wrong = {"output": [[0.0, 0.0, 9.0]]}
    felt.add(ticks(1, **wrong, ramping=1), ticks(1))
    felt.add(ticks(1, **wrong), ticks(1, ramping=1))
    felt.add(ticks(1, **wrong), ticks(1, state=State.SILENT.value))
    assert felt.rms_jnd is None
    felt.add(ticks(1, **wrong), ticks(1))
    assert felt.rms_jnd == pytest.approx(450.0)
