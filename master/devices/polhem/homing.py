"""Waiting for the calibration button, which a person presses while the handle is in its home pose."""

from collections.abc import Callable
from time import monotonic, sleep
from typing import TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault

NEAR_COUNTS = 8
"""Counters that were set to zero between two looks are not farther from it."""

STEP_COUNTS = 40
"""A jump to zero from at least so far is the button: between two looks no hand is that fast."""

PAUSE_S = 0.002
"""Between two looks [s]; short against every watchdog."""

LONGEST_S = 0.02
"""Two looks farther apart than this [s] tell nothing: a hand may have gone through the home pose meanwhile."""

Look = TypeVar("Look")


def await_press(look: Callable[[], Look], pressed: Callable[[Look, Look], bool], patience: float) -> Look:
    """Look until two looks in a row show that the button was pressed between them; gives the later one.

    Raises:
        HardwareFault: nobody presses it within `patience` [s], or the device is gone.
    """
    until = monotonic() + patience
    before: tuple[Look, float] | None = None
    while (began := monotonic()) < until:
        try:
            now = look()
        except BadReply:
            continue
        if before is not None and monotonic() - before[1] <= LONGEST_S and pressed(before[0], now):
            return now
        before = (now, began)
        sleep(PAUSE_S)
    raise HardwareFault(
        f"nobody pressed the calibration button in {patience:g} s; put the handle in its home pose and press it after "
        "the start"
    )


def zeroed(before: tuple[int, ...], now: tuple[int, ...]) -> bool:
    """Whether counters were set to zero between two looks."""
    return max(map(abs, now[:3])) <= NEAR_COUNTS and max(map(abs, before[:3])) >= STEP_COUNTS
