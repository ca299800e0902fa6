"""Loop age from an echo, for any clocks and delays."""

from math import floor, inf, nextafter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.liveness import DEAF, UNITS, Liveness

SILENCE = 0.1
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
    end.hear_encoder(1, 0.01, runs=True)
    assert end.encodes_until == 0.01 + SILENCE
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    end.hear_encoder(2, 0.03, runs=False)
    end.hear_encoder(1, 0.04, runs=True)
    assert end.encodes_until == end.encoder_heard_at == -inf
    end.hear_encoder(4, 0.07, runs=True)
    assert end.encoder_heard_at == 0.07
    assert end.encodes_until == 0.07 + SILENCE


def test_an_opening_session_drives_nothing_until_something_was_confirmed() -> None:
    end = Liveness(0.0, 0.1, 0.0, 0.0)
    end.agree(0.2, 0.0)
    end.hear_encoder(1, 0.0, runs=True)
    assert end.is_opening
    end.hear(0.05, floor(0.05 / (end.limit / UNITS)), 0, 0.05)  # the echo of what left now
    assert not end.is_opening


def test_age_counts_against_the_smaller_of_the_two_round_trips() -> None:
    end = Liveness(0.0, 0.1, 0.0, 0.0)
    end.agree(0.2, 0.0)
    end.expect(0.1)
    assert end.is_fresh(0.2, 0) and not end.is_fresh(0.201, 0)
    assert end.is_fresh(0.15, 1) and not end.is_fresh(0.16, 1)
