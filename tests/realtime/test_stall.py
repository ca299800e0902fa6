import pytest
from hypothesis import given, strategies as st

from weberlink.realtime.stall import LONGEST_STEP, SETTLING_TICKS, StallDetector

TICK = 1e-3


def test_stall_advances_nothing_and_settles_within_some_ticks() -> None:
    pace = StallDetector(TICK)
    pace.tick(0.0)
    assert pace.tick(2.0) == 0.0
    assert (pace.stalled, pace.step) == (True, 0.0)
    settling = [pace.settling]
    for index in range(1, 2 * SETTLING_TICKS):
        assert pace.tick(2.0 + index * TICK) == pytest.approx(TICK)
        assert not pace.stalled
        settling.append(pace.settling)
    assert settling == [True] * SETTLING_TICKS + [False] * SETTLING_TICKS


@pytest.mark.parametrize(("tick_period", "limit"), [(1e-4, 0.02), (0.01, 0.1), (0.1, 1.0)])
def test_slower_loop_has_a_longer_limit(tick_period: float, limit: float) -> None:
    assert StallDetector(tick_period).limit == pytest.approx(limit)


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=50))
def test_ramps_never_advance_by_more_than_the_elapsed_time(gaps: list[float]) -> None:
    pace, now = StallDetector(TICK), 0.0
    assert pace.step == 0.0
    assert pace.tick(now) == pace.step == 0.0
    for gap in gaps:
        before, now = now, now + gap
        elapsed = pace.tick(now)
        assert pace.stalled == (now - before > pace.limit)
        assert elapsed == (0.0 if pace.stalled else now - before)
        assert 0.0 <= pace.step <= min(elapsed, LONGEST_STEP * TICK)
