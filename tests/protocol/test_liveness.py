"""Loop age from an echo, for any clocks and delays; and the schedule of heartbeats by itself."""

from math import floor, inf, nextafter

import pytest
from hypothesis import example, given, strategies as st

from weberlink.protocol.liveness import (
    ASK_PACE,
    DEAF,
    DENSEST,
    FADE_SHARE,
    HORIZON_SHARE,
    INTRODUCTION_INTERVAL,
    INTRODUCTIONS,
    LATE_TICKS,
    LEAST_QUESTIONS,
    LEAST_SHARE,
    LONGEST_ECHO_AGE,
    MOST_QUESTIONS,
    REPORT_INTERVAL,
    UNITS,
    HeartbeatSchedule,
    Liveness,
    questions_needed,
)

SILENCE, TICK = 0.1, 0.001
FADE, HORIZON, LATE = FADE_SHARE * SILENCE, HORIZON_SHARE * SILENCE, LATE_TICKS * TICK
OFFSETS = st.floats(-1e6, 1e6)
DELAYS = st.floats(0.0, SILENCE)


@given(OFFSETS, OFFSETS, DELAYS, st.floats(0.0, 0.9 * SILENCE), DELAYS)
def test_echo_tells_departure_on_own_clock(own: float, other: float, there: float, wait: float, back: float) -> None:
    """One end sends 3 s after the start, the other answers after a while; both clocks have any offset."""
    peer = Liveness(0.0, SILENCE, 3.0 + own, 3.0 + there + other)
    echo = peer.echo(3.0 + there + wait + other)
    end = Liveness(0.0, SILENCE, 0.0, own)
    now = 3.0 + there + wait + back + own
    end.hear(3.0 + there + wait, echo, 0, now)
    age = now - end.confirmed_at
    true = there + wait + back
    rounding = 1e-9 * (1.0 + abs(own))
    assert true - rounding <= age <= true + SILENCE / UNITS + rounding
    if age <= SILENCE:
        assert back <= SILENCE + rounding, "an update with this echo left no longer ago"


@given(st.integers(0, 10**7))
def test_echo_of_just_now_is_current(ticks: int) -> None:
    """Over a path without delay, where clocks and stamps round differently."""
    now = ticks * 1e-3
    peer = Liveness(0.0, SILENCE, floor(now * 1e5) * 1e-5, now)
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    for arrival in (now, nextafter(now, -inf), nextafter(now, inf)):
        assert end.hear(now, peer.echo(now), 0, arrival)


@pytest.mark.parametrize("units", [0, 1, 200, 253])
def test_an_echo_is_unambiguous_for_almost_four_limits(units: int) -> None:
    unit = SILENCE / UNITS
    now = 1000.5 * unit
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    end.hear(now, (1000 - units) % 255, 0, now)
    assert end.confirmed_at == pytest.approx((1000 - units) * unit)


def test_nothing_heard_within_limit_echoes_deaf() -> None:
    peer = Liveness(0.0, SILENCE, 5.0, 5.0)
    assert peer.echo(5.0 + SILENCE) != DEAF
    assert peer.echo(5.0 + SILENCE + 1e-6) == DEAF
    assert not peer.hear(5.0, DEAF, 0, 5.0) and peer.confirmed_at == -inf


def test_overtaken_datagram_does_not_say_that_the_encoder_runs() -> None:
    """The dead-man button was released; an update that left before it comes later."""
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    assert end.in_touch_at == end.encodes_until == -inf
    end.hear_encoder(1, 0.01, runs=True, streams=(0,))
    assert end.encodes_until == 0.01 + SILENCE
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    end.hear_encoder(2, 0.03, runs=False)
    end.hear_encoder(1, 0.04, runs=True, streams=(0,))
    assert end.encodes_until == end.encoder_heard_at == -inf
    end.hear_encoder(4, 0.07, runs=True, streams=(0,))
    assert end.encoder_heard_at == 0.07
    assert end.encodes_until == 0.07 + SILENCE


def encoder_of(end: Liveness, sequence: int, now: float, *, runs: bool, streams: tuple[int, ...] = ()) -> None:
    """Take what a datagram says of the peer's encoder, as a session does, while the peer holds all our updates."""
    end.hear_encoder(sequence, now, runs=runs, streams=streams)
    end.hold(inf, is_proven=True)


def test_each_stream_must_be_proven_and_what_lacks_for_too_long_is_undelivered() -> None:
    end = Liveness(0.0, SILENCE, 0.0, 0.0, streams=2)
    end.agree(0.2, 0.0)
    assert end.undelivered_at == inf and end.held_until == inf
    encoder_of(end, 1, 0.01, runs=True, streams=(0,))
    assert end.encodes_until == -inf, "nothing is known of the second stream"
    assert end.undelivered_at == pytest.approx(0.01 + 0.2 + end.limit)
    encoder_of(end, 2, 0.02, runs=True, streams=(0, 1))
    encoder_of(end, 3, 0.05, runs=True, streams=(1,))
    encoder_of(end, 4, 0.06, runs=True)
    assert (end.encoder_heard_at, end.encodes_until) == (0.05, 0.05 + SILENCE), "it may lag by the round trip"
    encoder_of(end, 5, 0.3, runs=True, streams=(1,))
    assert (end.encoder_heard_at, end.encodes_until) == (pytest.approx(0.22), pytest.approx(0.22 + SILENCE))
    assert end.undelivered_at == pytest.approx(0.22 + 0.2 + end.limit)
    end.resume(0.5)
    assert end.undelivered_at == pytest.approx(0.5 + 0.2 + end.limit)
    encoder_of(end, 6, 0.6, runs=False)
    assert (end.encodes_until, end.undelivered_at) == (-inf, inf), "who does not encode owes nothing"
    encoder_of(end, 7, 0.7, runs=True, streams=(0,))
    assert end.encodes_until == -inf


def test_what_the_peer_lacks_ends_what_is_followed_and_fades_before() -> None:
    end = Liveness(0.0, SILENCE, 0.0, 0.0, confirmed_at=1.0)
    end.agree(0.04, 0.0)
    end.hear_encoder(1, 1.0, runs=True, streams=(0,))
    end.hold(0.7, is_proven=True)
    assert (end.held_until, end.undelivered_at) == (pytest.approx(0.84), pytest.approx(0.88))
    assert end.in_touch_at == pytest.approx(0.74)
    end.hold(inf, is_proven=False)
    assert end.held_until == -inf and end.undelivered_at == pytest.approx(1.0 + 0.04 + end.limit)


def test_age_counts_against_the_smaller_of_the_two_round_trips() -> None:
    end = Liveness(0.0, 0.1, 0.0, 0.0)
    end.agree(0.2, 0.0)
    assert end.is_opening and end.silent_at == end.limit, "it has time for one round trip"
    end.expect(0.1)
    assert end.is_fresh(0.2, 0) and not end.is_fresh(0.201, 0)
    assert end.is_fresh(0.15, 1) and not end.is_fresh(0.16, 1)


# --- heartbeats


def introduced(silence: float = SILENCE, round_trip: float = 0.0, beats: int = INTRODUCTIONS) -> HeartbeatSchedule:
    end = Liveness(0.0, silence, 0.0, 0.0, confirmed_at=0.0)
    end.agree(round_trip, 0.0)
    schedule = HeartbeatSchedule(end, 0.0, TICK)
    for _ in range(beats):
        pulse(schedule, 0.0)
    return schedule


def hear(schedule: HeartbeatSchedule, now: float, confirmed_at: float) -> None:
    schedule._liveness.heard_at, schedule._liveness.confirmed_at = now, confirmed_at


def pulse(schedule: HeartbeatSchedule, now: float, *, is_confirmed: bool = True) -> None:
    """Send a heartbeat, which reports if it must."""
    schedule.sent_heartbeat(now, has_reported=schedule.reports(now), is_confirmed=is_confirmed)
    schedule.sent(now)


def test_introductions_go_on_until_the_peer_was_heard() -> None:
    schedule = introduced(beats=0)
    for _ in range(50):
        pulse(schedule, 0.0, is_confirmed=False)
    assert schedule.due(is_engaged=True) == INTRODUCTION_INTERVAL and schedule.reports(0.0)
    schedule = introduced()
    assert schedule.due(is_engaged=True) == schedule.max_gap and not schedule.reports(0.5 * REPORT_INTERVAL)


def test_a_heartbeat_is_due_after_a_gap_or_for_an_old_echo_or_credit_or_an_answer_or_a_report() -> None:
    """An echo is too old when the loop age of the peer is; if nothing new has come, only the gap counts."""
    schedule = introduced()
    schedule.adapt(0.0, 0.0, 0.001, 0.0)
    hear(schedule, 0.519, 0.51)
    schedule.sent(0.52)
    assert (idle := schedule.due(is_engaged=True)) == 0.52 + schedule.max_gap
    schedule.is_credit_wanted = True
    assert schedule.due(is_engaged=True) == 0.52 + schedule.credit_interval < idle
    hear(schedule, 0.5, 0.5)
    schedule.sent(0.52)
    hear(schedule, 0.54, 0.52)
    assert schedule.due(is_engaged=True) == 0.5 + schedule.max_echo_age < idle
    schedule.is_answer_wanted = True
    assert schedule.due(is_engaged=True) <= 0.54
    for step in range(54, 100):  # any datagram postpones it, except for a report
        hear(schedule, 0.01 * step, 0.01 * step)
        schedule.sent(0.01 * step)
    assert schedule.due(is_engaged=True) == schedule.due(is_engaged=False) == REPORT_INTERVAL
    assert schedule.reports(REPORT_INTERVAL)


@given(st.floats(0.0, 0.99), st.floats(1e-9, 0.5))
def test_questions_are_as_few_as_possible(unanswered: float, rate: float) -> None:
    count = questions_needed(unanswered, rate)
    assert count == MOST_QUESTIONS or unanswered ** (count + 1) <= rate * (1.0 + 1e-9)
    assert count == 0 or unanswered**count > rate * (1.0 - 1e-9)


@given(st.floats(0.0, 0.4), st.floats(0.0, 0.01), st.floats(0.0, 0.3), st.floats(0.0, 0.4))
@example(0.0, 0.0, 1.0, 0.0)
@example(0.3, 0.0, 0.0, 0.3)
@example(0.05, 0.01, 0.02, 0.05)
def test_reach_and_gap_leave_room_for_the_path_and_for_losses(
    rtt: float, jitter: float, loss: float, round_trip: float
) -> None:
    schedule = introduced(round_trip=round_trip)
    schedule.adapt(loss, loss, rtt, jitter)
    shortest = LEAST_SHARE * SILENCE
    unanswered = 1.0 - (1.0 - loss) ** 2
    alone = rtt + jitter + LATE + (SILENCE + round_trip) / UNITS  # the loop age without any wait
    questions = max(LEAST_QUESTIONS, questions_needed(unanswered, shortest / 3600.0))
    answered = questions * (ASK_PACE + TICK) + rtt + jitter
    for pause, limit, passed, share in (
        (schedule.max_echo_age, round_trip, alone, unanswered),
        (schedule.max_gap, 0.0, jitter + LATE, loss),
    ):
        least = max(LEAST_QUESTIONS, questions_needed(share, shortest / 3600.0))
        fits = passed + pause + answered <= SILENCE + limit + 1e-9
        is_dense = passed + (1 + least) * pause <= SILENCE + limit + 1e-9
        is_densest = pause <= max(DENSEST if unanswered > 0.0 else 2.0 * shortest, shortest) + 1e-9
        assert is_densest or (passed + pause <= FADE + limit + 1e-9 and (fits or is_dense))
    assert (
        schedule.max_gap == min(shortest, schedule.max_echo_age) or schedule.max_gap + jitter + LATE <= HORIZON + 1e-9
    )
    assert DENSEST <= schedule.max_gap <= schedule.max_echo_age <= LONGEST_ECHO_AGE


@given(st.floats(0.001, 0.3), st.sampled_from([0.1, 0.4, 1.0]))
def test_a_false_alarm_is_rarer_than_one_an_hour(loss: float, silence: float) -> None:
    """It needs the loss of a datagram or of what it echoes, and then of all questions that fit, or of their answers."""
    schedule = introduced(silence=silence)
    schedule.adapt(loss, loss, 0.001, 0.0)
    unanswered = 1.0 - (1.0 - loss) ** 2
    room = silence - schedule.max_echo_age - 2 * 0.001 - LATE - silence / UNITS
    questions = room / (ASK_PACE + TICK)
    per_hour = 3600.0 * 2.0 / schedule.max_echo_age * unanswered ** (1 + int(questions + 1e-6))
    # Reaches below twice the shortest gap leave more chances for one.
    assert schedule.max_echo_age == DENSEST or per_hour <= max(1.0, 2.0 * LEAST_SHARE * silence / schedule.max_echo_age)


@pytest.mark.parametrize("rtt", [0.001, 0.02, 0.06, inf])
def test_asks_only_while_an_answer_can_be_in_time(rtt: float) -> None:
    schedule = introduced()
    schedule.adapt(0.0, 0.0, rtt, 0.0)
    asked = []
    for tick in range(1, 200):
        now = tick * TICK
        asks = schedule.asks(now)
        if now >= schedule.due(is_engaged=True):
            pulse(schedule, now)
            if asks:
                asked.append(now)
    assert len(asked) <= SILENCE / ASK_PACE
    assert all(min(schedule.max_gap, schedule.max_echo_age) < at <= SILENCE - rtt for at in asked)
    assert bool(asked) is (rtt < inf)


def test_a_confirmed_peer_is_not_asked_and_an_absent_owner_causes_no_storm() -> None:
    schedule = introduced()
    schedule.adapt(0.0, 0.0, 0.001, 0.0)
    assert schedule.asks(0.085)
    hear(schedule, 0.05, 0.05)
    assert not schedule.asks(0.085)
    hear(schedule, 0.0, 0.0)
    for _ in range(2):
        assert not schedule.asks(0.5)
        pulse(schedule, 0.5)
    assert schedule.due(is_engaged=True) > 0.5


@pytest.mark.parametrize(("heard_at", "now"), [(0.205, 0.242), (0.16, 0.245)])
def test_questions_of_the_loop_age_count_with_the_agreed_round_trip(heard_at: float, now: float) -> None:
    schedule = introduced(round_trip=0.2)
    schedule.adapt(0.0, 0.0, 0.05, 0.0)
    hear(schedule, heard_at, 0.0)
    assert schedule.asks(now)
