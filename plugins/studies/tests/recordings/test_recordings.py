"""The shipped recordings: their archives, names and licences."""

import numpy as np
import pytest

from weberlink_studies import recordings


@pytest.mark.parametrize("name", recordings.names())
def test_a_recording_is_a_signal_in_si_units(name: str) -> None:
    trace = recordings.load(name)
    assert 4.0 < trace.duration_s < 25.0
    assert 0.99e-3 < trace.period_s < 5.1e-3
    assert np.ptp(trace.position_m, axis=0).max() < 1.0
    assert 0.05 < np.abs(trace.force_n).max() < 100.0
