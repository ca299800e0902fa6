"""The schedule by itself. Two ends that use it are in test_endpoint_session."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.heartbeat import (
    ASK_PACE,
    INTRODUCTION_INTERVAL,
    INTRODUCTIONS,
    LATE_TICKS,
    LEAST_QUESTIONS,
    LEAST_SHARE,
    MOST_QUESTIONS,
    REPORT_INTERVAL,
    HeartbeatSchedule,
    questions_needed,
)

FADE, SILENCE, TICK = 0.08, 0.1, 0.001


def introduced(now: float = 0.0) -> HeartbeatSchedule:
    schedule = HeartbeatSchedule(now, silence=SILENCE, tick_period=TICK)
    for _ in range(INTRODUCTIONS):
        schedule.reported(now, is_confirmed=True)
        schedule.sent(now)
    return schedule


def test_introductions_go_on_until_the_peer_was_heard() -> None:
    schedule = HeartbeatSchedule(0.0, silence=SILENCE, tick_period=TICK)
    for _ in range(50):
        schedule.reported(0.0, is_confirmed=False)
        schedule.sent(0.0)
    assert schedule.due(is_engaged=True) == INTRODUCTION_INTERVAL
    schedule = introduced()
    assert schedule.due(is_engaged=True) == schedule.interval


def test_any_datagram_postpones_heartbeats_except_reports() -> None:
    schedule = introduced()
    for step in range(1, 100):
        schedule.confirmed(0.01 * step)
        schedule.sent(0.01 * step)
    assert schedule.due(is_engaged=True) == REPORT_INTERVAL
    assert schedule.due(is_engaged=False) == REPORT_INTERVAL


def test_loss_shortens_the_interval_down_to_a_limit() -> None:
    schedule = introduced()
    intervals = []
    for loss in (0.0, 0.01, 0.1, 0.3, 1.0):
        schedule.adapt(loss, loss, 0.001, 0.0)
        intervals.append(schedule.interval)
    assert intervals == sorted(intervals, reverse=True)
    assert intervals[-1] == LEAST_SHARE * SILENCE


@given(st.floats(0.0, 0.99), st.floats(1e-9, 0.5))
def test_questions_are_as_few_as_possible(unanswered: float, rate: float) -> None:
    count = questions_needed(unanswered, rate)
    assert count == MOST_QUESTIONS or unanswered ** (count + 1) <= rate * (1.0 + 1e-9)
    assert count == 0 or unanswered**count > rate * (1.0 - 1e-9)


@given(st.floats(0.0, 0.05), st.floats(0.0, 0.01), st.floats(0.0, 0.3))
def test_interval_leaves_room_for_path_and_questions(rtt: float, jitter: float, loss: float) -> None:
    schedule = introduced()
    schedule.adapt(loss, loss, rtt, jitter)
    worst = 2.0 * schedule.interval + rtt + jitter + LATE_TICKS * TICK
    answered = LEAST_QUESTIONS * ASK_PACE + rtt + jitter
    assert schedule.interval == LEAST_SHARE * SILENCE or (worst <= FADE and worst + answered <= SILENCE)


@pytest.mark.parametrize("rtt", [0.001, 0.02, 0.06, inf])
def test_asks_only_while_an_answer_can_be_in_time(rtt: float) -> None:
    schedule = introduced()
    schedule.confirmed(0.0)
    schedule.adapt(0.0, 0.0, rtt, 0.0)
    asked = []
    for tick in range(1, 200):
        now = tick * TICK
        asks = schedule.asks(now)
        if now >= schedule.due(is_engaged=True):
            schedule.reported(now, is_confirmed=True)
            schedule.sent(now)
            if asks:
                asked.append(now)
    assert len(asked) <= SILENCE / ASK_PACE
    assert all(2.0 * schedule.interval < at <= SILENCE - rtt for at in asked)
    assert bool(asked) is (rtt < 0.05)


def test_confirmed_peer_is_not_asked_and_question_answered_once() -> None:
    schedule = introduced()
    schedule.adapt(0.0, 0.0, 0.001, 0.0)
    assert schedule.asks(0.085)
    schedule.confirmed(0.05)
    assert not schedule.asks(0.085)
    schedule.sent(0.05)
    schedule.asked()
    assert schedule.due(is_engaged=True) <= 0.05
    schedule.sent(0.051)
    assert schedule.due(is_engaged=True) == 0.051 + schedule.interval


def test_absent_owner_causes_no_storm() -> None:
    schedule = introduced()
    schedule.adapt(0.3, 0.3, 0.001, 0.0)
    schedule.confirmed(0.0)
    sent = 0
    while schedule.due(is_engaged=True) <= 0.5:
        assert not schedule.asks(0.5)
        schedule.reported(0.5, is_confirmed=True)
        schedule.sent(0.5)
        sent += 1
    assert sent <= 2
