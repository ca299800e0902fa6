"""Packets a second of the last second."""

import numpy as np
import pytest

from tests.apps.monitor.feeds import records
from weberlink.apps.monitor.pace import Pace


def test_only_the_last_second_counts() -> None:
    pace = Pace()
    assert pace.packets_per_s is None and pace.reduction is None
    made = records(5000)
    # 100 a second for 3 s, then 10 a second.
    made["updates_sent"] = np.minimum(np.arange(5000) // 10, 300) + np.maximum(np.arange(5000) - 3000, 0) // 100
    for piece in np.split(made[:3000], 60):
        pace.add(piece)
    assert pace.packets_per_s == pytest.approx(100.0, rel=0.02)
    assert pace.reduction == pytest.approx(0.9, abs=0.005)
    for piece in np.split(made[3000:], 40):
        pace.add(piece)
    assert pace.packets_per_s == pytest.approx(10.0, rel=0.11)
    assert pace.reduction == pytest.approx(0.99, abs=0.002)


def test_without_a_session_there_is_nothing_to_reduce() -> None:
    pace, made = Pace(), records(100)
    made["state"] = 2
    pace.add(made)
    pace.add(records(0))
    assert (pace.packets_per_s, pace.reduction) == (0.0, None)
