"""The limit's own misses."""

import numpy as np
import pytest

from benchmarks.lateness import Limit


@pytest.mark.parametrize(
    ("rate_hz", "lateness_us", "share"),
    [
        (1000.0, [10.0, 999.0], 0.0),
        (1000.0, [10.0, 1000.0], 1 / 3),
        (1000.0, [0.0] * 998 + [7440.0, 2001.0], 9 / 1009),
        (4000.0, [10.0, 740.0], 2 / 4),
    ],
)
def test_a_wake_up_late_by_whole_periods_has_missed_as_many(
    rate_hz: float, lateness_us: list[float], share: float
) -> None:
    assert Limit("", np.array(lateness_us)).missed_share(rate_hz) == pytest.approx(share)
