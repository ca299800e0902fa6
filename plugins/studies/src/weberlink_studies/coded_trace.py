"""One signal through the codec tick by tick: displayed forces and sends, and a window worth drawing."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.replay import code
from weberlink.master.trace import Trace
from weberlink_studies.evaluate.replay import signal_of

CONTACT_SHARE = 0.05  # of the largest force of the signal; smaller forces do not count as contact
CONTACT_TIME = 0.75
FEWEST_SENDS = 3

Array = NDArray[np.float64]


class TickWindow(NamedTuple):
    """Ticks first <= tick < until."""

    first: int
    until: int


class CodedTrace:
    """A trace coded by a fresh encoder and decoder on a lossless link, sample by sample as in a daemon; n ticks.

    `displayed_n` is the decoded force after the update of the tick if there was one, `predicted_n` that before, both of
    shape (n, 3); `bound_n` the radius of the deadband about the measured force; `selected` the place in the bank of the
    predictor in use after the update.
    """

    def __init__(self, trace: Trace, channel: Channel) -> None:
        self.trace, self.channel = trace, channel
        coded = code(channel, signal_of(trace).samples)
        self.displayed_n: Array = np.array(coded.displayed)
        self.predicted_n: Array = np.array(coded.predicted)
        self.bound_n: Array = np.array(coded.bounds)
        self.sent = np.array([update is not None for update in coded.updates])
        self.selected = np.array(coded.selected)

    @property
    def bank(self) -> tuple[str, ...]:
        return self.channel.bank

    @property
    def predictor(self) -> str:
        return self.bank[0] if len(self.bank) == 1 else self.channel.choice


def interesting_window(coded: CodedTrace, seconds: float) -> TickWindow:
    """The window in which |force| varies most; the earliest of equals.

    Only windows count that are in contact (|force| above `CONTACT_SHARE` of the largest of the signal) for at least
    `CONTACT_TIME` of their ticks and have at least `FEWEST_SENDS` sends. If there is none, those with most sends count.
    """
    if not seconds > 0.0:
        raise ValueError(f"seconds: expected more than 0, got {seconds!r}")
    count = len(coded.trace.time_s)
    length = min(count, max(1, round(seconds / float(np.median(np.diff(coded.trace.time_s))))))
    force = np.linalg.norm(coded.trace.force_n, axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(force, length)
    contact = _sums(force > CONTACT_SHARE * force.max(), length)
    sends = _sums(coded.sent, length)
    allowed = (contact >= CONTACT_TIME * length) & (sends >= FEWEST_SENDS)
    if not allowed.any():
        allowed = sends == sends.max()
    spread = np.where(allowed, windows.max(axis=1) - windows.min(axis=1), -1.0)
    first = int(np.argmax(spread))
    return TickWindow(first, first + length)


def _sums(flags: NDArray[np.bool_], length: int) -> NDArray[np.int64]:
    """The number of set flags in each window of a length."""
    before = np.concatenate(([0], np.cumsum(flags, dtype=np.int64)))
    return before[length:] - before[:-length]
