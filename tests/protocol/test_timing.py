from random import Random

import pytest
from hypothesis import given, strategies as st

from weberlink.protocol.timing import EARLY_LIMIT, LONGEST_RTT, WINDOW, Clock, SlidingMinimum


def mapped(offset: float = 100.0, delay: float = 0.01) -> Clock:
    """A clock whose peer is `offset` ahead, over a symmetric link, at 0."""
    clock = Clock(0.0, offset - delay, 0.0)
    assert clock.learn(delay + offset, 0.0, 0.0) is not None
    return clock


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-1e6, 1e6)), min_size=1, max_size=60))
def test_minimum_covers_its_window_within_a_bucket(steps: list[tuple[float, float]]) -> None:
    minimum = SlidingMinimum()
    now, samples = 1e6, []
    assert minimum.is_expired(0.0)
    for step, value in steps:
        now += step
        minimum.record(value, now)
        samples.append((now, value))
        surely = min(sample for at, sample in samples if now - at <= WINDOW * 7 / 8)
        possibly = min(sample for at, sample in samples if now - at <= WINDOW)
        assert possibly <= minimum.value <= surely
    assert not minimum.is_expired(now + WINDOW)
    assert minimum.is_expired(now + WINDOW + 0.1)


@pytest.mark.parametrize("offset", [-5000.0, 0.0, 12.5])
def test_offset_and_delay_of_a_link(offset: float) -> None:
    clock = mapped(offset, 0.01)
    assert clock.peer_time(0.0) == pytest.approx(offset)
    assert clock.rtt == pytest.approx(0.02)
    assert clock.one_way == pytest.approx(0.01)
    assert clock.peer_time(3.0) == pytest.approx(3.0 + offset)
    clock.record(offset + 3.0 - 0.025, 3.0)
    assert (clock.one_way, clock.rtt) == (pytest.approx(0.025), pytest.approx(0.035))
    clock.record(offset + 3.0 + 0.03, 3.0)
    assert clock.one_way == 0.0, "never negative"
    asymmetric = Clock(0.0, offset - 0.03, 0.0)
    assert asymmetric.rtt is asymmetric.one_way is None
    assert asymmetric.peer_time(1.0) is asymmetric.arrival_bound(1.0) is None
    assert asymmetric.learn(0.01 + offset, 0.0, 0.005) == pytest.approx(0.045)
    assert asymmetric.peer_time(0.0) == pytest.approx(offset - 0.01), "the offset is wrong by half the asymmetry"
    assert asymmetric.arrival_bound(12.0) == pytest.approx(12.015 + offset)


@given(st.floats(0.0, 1e5), st.floats(-1e5, 1e5), st.floats(0.0, 40.0))
def test_a_stamp_is_expanded_near_the_mapped_clock(now: float, offset: float, delay: float) -> None:
    ours, theirs = mapped(offset), Clock(-offset, 0.0, 0.0)
    stamp, _ = theirs.stamp(now - delay)
    departure = ours.departure(stamp, now)
    assert departure is not None and departure == pytest.approx(now - delay + offset, abs=2e-5)
    assert departure <= now - delay + offset + 1e-9, "cut off, so that no delay is ever too short"


def stamped(departure: float, now: float) -> tuple[int, float]:
    """The stamp of a datagram that left and arrived then, and its arrival."""
    return Clock(0.0, 0.0, 0.0).stamp(departure)[0], now


def test_departure_after_arrival_is_implausible_within_the_window() -> None:
    clock = mapped(0.0, 0.01)
    for at, now in ((0.99, 1.0), (-40.0, 1.0), (1.0 + EARLY_LIMIT, 1.0), (40.0, 1.0 + WINDOW)):  # late, but possible
        assert clock.departure(*stamped(at, now)) == pytest.approx(at)
    assert clock.departure(*stamped(1.1, 1.0)) is clock.departure(*stamped(40.0, 1.0)) is None


@pytest.mark.parametrize("minimum", [-1e12, -1.0, LONGEST_RTT + 1.0, 1e12])
def test_a_report_that_no_link_can_give_changes_nothing(minimum: float) -> None:
    clock = mapped(0.0, 0.01)
    assert clock.learn(minimum, 1.0, 1.0) is None
    assert clock.peer_time(0.0) == pytest.approx(0.0)
    assert clock.rtt == pytest.approx(0.02)
    assert clock.outgoing_jitter == 0.0


def test_step_of_the_peers_clock_removes_the_mapping() -> None:
    clock = mapped(0.0, 0.01)
    clock.record(1.0 + 30.0 + WINDOW, 1.0 + WINDOW)
    assert clock.peer_time(5.0) is None
    assert clock.learn(30.02, 0.0, 0.0) is not None
    assert clock.peer_time(5.0) == pytest.approx(35.01)


def test_the_report_bounds_nearly_all_delays() -> None:
    random = Random(3)
    clock = Clock(0.0, -0.01, 0.0)
    delays = [0.01 + 0.01 * random.random() for _ in range(2000)]
    exceeded = 0
    for step, delay in enumerate(delays):
        now = 0.01 * step
        minimum, _, late = clock.report()
        exceeded += step > 100 and delay > minimum + late
        clock.record(now - delay, now)
    assert exceeded < 20
    assert clock.report()[1] == pytest.approx(delays[-1] - clock.report()[0])
