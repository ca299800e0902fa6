"""What one transmission carries, as integers: the whole state of the decoder, so any one that arrives restores it."""

from typing import NamedTuple

MAX_GAP = 65_535
"""Largest distance [ticks] between the two samples of an update; an older sample predicts nothing (65 s at 1 kHz)."""


class Update(NamedTuple):
    """The newest sample, the predictor chosen for it and, where that predictor needs them, the sample before or its
    parameters.

    Args:
        tick: when the newest sample was taken, on the sender's tick clock.
        selector: index of the chosen predictor in the bank that both ends agreed on.
        newest: wire levels of the sample: the value on each axis, then (force channel) the commanded position that it
            belongs to.
        gap: ticks between the two samples, 1..`MAX_GAP`; 0 when there is no previous sample.
        previous: wire levels of the sample before, laid out like `newest`; empty when the predictor needs none.

    The parameters of a model take the place of `gap` and `previous` (see `codec.parameters`), as if they were those.
    """

    tick: int
    selector: int
    newest: tuple[int, ...]
    gap: int = 0
    previous: tuple[int, ...] = ()
