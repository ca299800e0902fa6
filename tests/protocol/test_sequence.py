from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.sequence import expand, expand_counter


@given(st.integers(-(2**40), 2**40), st.integers(-(2**23) + 1, 2**23 - 1))
def test_expansion_undoes_truncation_within_half_the_range(full: int, error: int) -> None:
    assert expand(full & 0xFFFFFF, 24, full + error) == full


@given(st.integers(0, 2**24 - 1), st.integers(-(2**40), 2**40))
def test_expansion_is_congruent_and_near(truncated: int, near: int) -> None:
    full = expand(truncated, 24, near)
    assert full % 2**24 == truncated
    assert abs(full - near) <= 2**23


@given(st.integers(0, 2**24 - 1), st.integers(0, 2**40))
def test_a_counter_never_becomes_negative(truncated: int, near: int) -> None:
    full = expand_counter(truncated, 24, near)
    assert full >= 0
    assert full % 2**24 == truncated


def test_a_counter_that_starts_just_below_the_wrap() -> None:
    assert expand_counter(2**24 - 5, 24, 0) == 2**24 - 5
    assert expand_counter(2, 24, 2**24 - 4) == 2**24 + 2
