"""Waiting for the calibration button."""

from time import sleep

import pytest

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.polhem.homing import await_press, zeroed


@pytest.mark.parametrize(
    ("before", "now", "pressed"),
    [
        ((300, 2, -5), (0, 0, 1), True),
        ((300, 2, -5), (8, -8, 8, 77, 77, 77), True),
        ((300, 2, -5), (290, 0, 0), False),
        ((300, 2, -5), (9, 0, 0), False),
        ((39, 0, 0), (0, 0, 0), False),  # a slow hand passes by
        ((0, 0, 0), (0, 0, 0), False),
        ((0, 0, 0, 500, 0, 0), (0, 0, 0, 0, 0, 0), False),
    ],
)
def test_a_press_is_a_jump_to_zero(before: tuple[int, ...], now: tuple[int, ...], pressed: bool) -> None:
    assert zeroed(before, now) == pressed


def test_bad_replies_are_looked_past_and_the_look_with_the_press_is_given() -> None:
    looks = iter([5, None, 5, 6, 1000])

    def look() -> int:
        number = next(looks)
        if number is None:
            raise BadReply("does not answer")
        return number

    assert await_press(look, lambda before, now: now > before + 100, 10.0) == 1000


def test_a_patience_has_an_end() -> None:
    with pytest.raises(HardwareFault, match=r"nobody pressed the calibration button in 0\.02 s"):
        await_press(lambda: 0, lambda before, now: False, 0.02)


def test_looks_that_are_far_apart_are_no_press() -> None:
    """A host that stalled has not seen how the handle got home."""
    looks = iter([1000, 0])

    def slowly() -> int:
        sleep(0.05)
        return next(looks)

    with pytest.raises(HardwareFault, match="nobody pressed"):
        await_press(slowly, lambda before, now: now == 0, 0.08)
