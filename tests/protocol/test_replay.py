from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.replay import WINDOW, ReplayWindow


@given(st.lists(st.integers(0, 3 * WINDOW), max_size=200))
def test_each_number_is_new_once_and_old_ones_never(numbers: list[int]) -> None:
    window = ReplayWindow()
    marked: set[int] = set()
    for number in numbers:
        newest = max(marked, default=-1)
        assert window.newest == newest
        assert window.is_new(number) == (number not in marked and newest - number < WINDOW)
        if window.is_new(number):
            window.mark(number)
            marked.add(number)
            assert not window.is_new(number)


def test_a_huge_leap_forgets_but_never_admits_twice() -> None:
    window = ReplayWindow()
    window.mark(5)
    window.mark(2**60)
    assert not window.is_new(5)
    assert not window.is_new(2**60)
    assert window.is_new(2**60 - 1)
