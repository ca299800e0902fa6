"""The schedule by itself; two ends that use it are in test_endpoint_session."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.heartbeat import (
    ASK_PACE,
    CHANCE_FADES_PER_S,
    CLEAN_INTERVAL,
    FALSE_ALARMS_PER_S,
    INTRODUCTION_INTERVAL,
    INTRODUCTIONS,
    REPORT_INTERVAL,
    SHORTEST_INTERVAL,
    HeartbeatSchedule,
)
from protocol.loss import datagrams_needed

FADE, SILENCE, TICK = 0.06, 0.1, 0.001


def introduced(now: float = 0.0) -> HeartbeatSchedule:
    schedule = HeartbeatSchedule(now, fade=FADE, silence=SILENCE, tick_period=TICK)
    for _ in range(INTRODUCTIONS):
        schedule.reported(now, is_confirmed=True)
        schedule.sent(now)
    return schedule


def test_the_first_one_is_due_at_once() -> None:
    schedule = HeartbeatSchedule(5.0, fade=FADE, silence=SILENCE, tick_period=TICK)
    assert schedule.due(is_engaged=True) <= 5.0
    assert schedule.due(is_engaged=False) <= 5.0


def test_introductions_go_on_until_the_peer_was_heard() -> None:
    schedule = HeartbeatSchedule(0.0, fade=FADE, silence=SILENCE, tick_period=TICK)
    for _ in range(50):
        schedule.reported(0.0, is_confirmed=False)
        schedule.sent(0.0)
    assert schedule.due(is_engaged=True) == INTRODUCTION_INTERVAL
    assert introduced().due(is_engaged=True) == CLEAN_INTERVAL


def test_any_datagram_puts_a_heartbeat_off_but_for_the_report() -> None:
    schedule = introduced()
    for step in range(1, 100):
        schedule.heard(0.01 * step)
        schedule.sent(0.01 * step)
    assert schedule.due(is_engaged=True) == REPORT_INTERVAL
    assert schedule.due(is_engaged=False) == REPORT_INTERVAL


def test_loss_makes_them_denser_only_while_engaged() -> None:
    schedule = introduced()
    schedule.adapt(1.0, 0.0, inf, 0.0)
    assert schedule.due(is_engaged=True) == SHORTEST_INTERVAL
    assert schedule.due(is_engaged=False) == CLEAN_INTERVAL


@given(st.sampled_from([0.01, 0.1, 0.3]), st.lists(st.integers(1, 120), max_size=60), st.integers(0, 1000))
def test_every_window_holds_as_many_datagrams_as_it_takes(loss: float, gaps: list[int], start: int) -> None:
    """Updates go out whenever they like, in bursts or not; over a path too long to ask."""
    schedule = introduced()
    schedule.adapt(loss, loss, inf, 0.0)
    updates = {sum(gaps[: index + 1]) for index in range(len(gaps))}
    sent: list[int] = []
    for tick in range(1, 1500):
        if tick * TICK >= schedule.due(is_engaged=True):
            schedule.reported(tick * TICK, is_confirmed=True)
        elif tick not in updates:
            continue
        schedule.sent(tick * TICK)
        sent.append(tick)
    for length, rate in ((FADE, CHANCE_FADES_PER_S), (SILENCE, FALSE_ALARMS_PER_S)):
        ticks = round(length / TICK)
        begin = 200 + start % (1300 - ticks)
        inside = [tick for tick in sent if begin <= tick < begin + ticks]
        assert len(inside) >= datagrams_needed(loss, length, rate)


def test_a_short_path_needs_fewer_because_it_can_ask() -> None:
    counts = []
    for rtt in (0.001, 0.1):
        schedule = introduced()
        schedule.adapt(0.1, 0.1, rtt, 0.0)
        sent = 0
        for tick in range(1, 1001):
            schedule.heard(tick * TICK)
            if tick * TICK >= schedule.due(is_engaged=True):
                schedule.reported(tick * TICK, is_confirmed=True)
                schedule.sent(tick * TICK)
                sent += 1
        counts.append(sent)
    assert counts[0] < 0.6 * counts[1]


@pytest.mark.parametrize("rtt", [0.001, 0.02, 0.06, inf])
def test_asks_begin_when_the_peer_is_overdue_and_end_when_no_answer_can_come_in_time(rtt: float) -> None:
    schedule = introduced()
    schedule.heard(0.0)
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
    assert all(CLEAN_INTERVAL < at <= SILENCE - rtt for at in asked)
    assert bool(asked) is (rtt < SILENCE - CLEAN_INTERVAL - 0.005)


def test_whoever_is_heard_is_not_asked_and_whoever_is_asked_answers_once() -> None:
    schedule = introduced()
    schedule.adapt(0.0, 0.0, 0.001, 0.0)
    assert schedule.asks(0.06)
    schedule.heard(0.05)
    assert not schedule.asks(0.06)
    schedule.sent(0.05)
    schedule.asked()
    assert schedule.due(is_engaged=True) <= 0.05
    schedule.sent(0.051)
    assert schedule.due(is_engaged=True) > 0.09


def test_an_owner_that_was_away_asks_nothing_and_sends_no_storm() -> None:
    schedule = introduced()
    schedule.adapt(0.3, 0.3, 0.001, 0.0)
    schedule.heard(0.0)
    sent = 0
    while schedule.due(is_engaged=True) <= 0.5:
        assert not schedule.asks(0.5)
        schedule.reported(0.5, is_confirmed=True)
        schedule.sent(0.5)
        sent += 1
    assert sent <= 2
