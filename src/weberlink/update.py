"""An update: everything one transmission of a coded signal carries, as integers."""

from typing import NamedTuple

MAX_GAP = 65_535
"""Longest time between the two samples of an update [ticks], 65 s at 1 kHz; an older sample is not sent."""
MAX_SELECTOR = 7
"""Largest selector: it has three bits on the wire."""


class PreviousSample(NamedTuple):
    """The sample that was sent before the newest one.

    Args:
        gap: ticks from it to the newest sample, 1 to `MAX_GAP`.
        levels: its int16 levels, in the order of those of the newest sample.
    """

    gap: int
    levels: tuple[int, ...]


class ModelParameters(NamedTuple):
    """The parameters of a model that the sender estimated, packed by its predictor.

    Args:
        bits: 0 <= bits < 2**parameter_bits(n), where n is the number of levels of the newest sample.
    """

    bits: int


Payload = PreviousSample | ModelParameters | None


class Update(NamedTuple):
    """The complete state of a decoder: any update that arrives restores it.

    Args:
        tick: the sender's tick number of the newest sample.
        selector: index of the chosen predictor in the bank that both ends agreed on, 0 to `MAX_SELECTOR`.
        newest: int16 levels of the newest sample: the value on each axis, then (force channel) the commanded position.
        payload: what the chosen predictor needs in addition; None for nothing.
    """

    tick: int
    selector: int
    newest: tuple[int, ...]
    payload: Payload = None


def parameter_bits(levels: int) -> int:
    """Bits for the model parameters of a sample with this many levels: the room of a previous sample and its gap."""
    return 15 + 16 * levels
