import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.realtime.stall import LEAST_STALL, LONGEST_STEP, SETTLING_TICKS, STALL_TICKS, StallDetector

TICK = 1e-3


def test_a_late_tick_is_no_stall_and_moves_ramps_on_by_little() -> None:
    pace = StallDetector(TICK)
    pace.tick(0.0)
    assert pace.tick(0.019) == pytest.approx(0.019)
    assert not pace.stalled
    assert not pace.settling
    assert pace.step == LONGEST_STEP * TICK


def test_a_stall_counts_as_no_time_and_settles_within_some_ticks() -> None:
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


@pytest.mark.parametrize("tick_period", [1e-4, 1e-3, 0.01, 0.1])
def test_a_slow_loop_stalls_later(tick_period: float) -> None:
    assert StallDetector(tick_period).limit == max(LEAST_STALL, STALL_TICKS * tick_period)


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=50))
def test_ramps_never_move_on_further_than_time_did(gaps: list[float]) -> None:
    pace, now = StallDetector(TICK), 0.0
    assert pace.tick(now) == pace.step == 0.0
    for gap in gaps:
        before, now = now, now + gap
        elapsed = pace.tick(now)
        assert pace.stalled == (now - before > pace.limit)
        assert elapsed == (0.0 if pace.stalled else now - before)
        assert 0.0 <= pace.step <= min(elapsed, LONGEST_STEP * TICK)
