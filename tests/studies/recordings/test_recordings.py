"""The shipped recordings: their archives, names and licences."""

import numpy as np
import pytest

from weberlink.studies import recordings


@pytest.mark.parametrize("name", recordings.names())
def test_a_recording_is_a_signal_in_si_units(name: str) -> None:
    trace = recordings.load(name)
    assert 4.0 < trace.duration_s < 25.0
    assert 0.99e-3 < trace.period_s < 5.1e-3
    assert np.ptp(trace.position_m, axis=0).max() < 1.0
    assert 0.05 < np.abs(trace.force_n).max() < 100.0


def test_the_catalogue_says_which_recordings_touch_a_surface() -> None:
    """17 of 21 of the robot that taps, none in a guidance field or of a hand that leads the arm."""
    touching = [name for name in recordings.names() if recordings.has_surface(name)]
    counts = {source: sum(name in touching for name in recordings.names(source)) for source in recordings.SOURCES}
    assert counts == {"tue": 17, "omega3": 0, "ochoa_polish": 2, "panda_comanip": 0, "stroke_iiwa_teleop": 2}
