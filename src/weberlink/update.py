"""An update: everything one transmission of a coded signal carries, as integers."""

from typing import NamedTuple

MAX_GAP = 65_535
"""Longest time between the two samples of an update [ticks]; an older sample is not sent along (65 s at 1 kHz)."""
MAX_SELECTOR = 7
"""A selector travels in three bits."""


class PreviousSample(NamedTuple):
    """The sample that was sent before.

    Args:
        gap: ticks from it to the newest sample, 1..`MAX_GAP`.
        levels: its int16 levels, laid out like those of the newest sample.
    """

    gap: int
    levels: tuple[int, ...]


class ModelParameters(NamedTuple):
    """The parameters of a model that the sender estimated; the predictor says how they are packed.

    Args:
        bits: 0 <= bits < 2**parameter_bits(n), n levels in the newest sample.
    """

    bits: int


Payload = PreviousSample | ModelParameters | None


class Update(NamedTuple):
    """The whole state of a decoder: whichever update arrives restores it.

    Args:
        tick: when the newest sample was taken, on the sender's tick clock.
        selector: index of the chosen predictor in the bank that both ends agreed on, 0..7.
        newest: int16 levels of the sample: the value on each axis, then (force channel) the position it belongs to.
        payload: what the chosen predictor needs beside the newest sample.
    """

    tick: int
    selector: int
    newest: tuple[int, ...]
    payload: Payload = None


def parameter_bits(levels: int) -> int:
    """Size of the model parameters beside a sample of so many levels: the room of a previous sample and its gap."""
    return 15 + 16 * levels
