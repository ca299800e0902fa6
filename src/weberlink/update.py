"""An update: everything one transmission of a coded signal carries, as integers."""

from typing import Final, NamedTuple

MAX_GAP: Final = 65_535
"""Longest time between the two samples of an update [ticks], 65 s at 1 kHz; an older sample is not sent."""
MAX_SELECTOR: Final = 7  # largest selector: it has three bits on the wire
MOST_PARAMETER_BYTES: Final = 48  # largest size of the parameters of a model [bytes]


class UpdateForm(NamedTuple):
    """What the updates of one selector carry, in groups of levels: the value on each axis, then (where the update
    carries it) the commanded position.
    """

    newest: tuple[int, ...]  # number of levels in each group of the newest sample
    previous: tuple[int, ...] | None  # likewise, for the first groups; None where the payload is model parameters
    most_bytes: int = MOST_PARAMETER_BYTES  # of model parameters; more than a model has are for pictures and the like


class PreviousSample(NamedTuple):
    """The sample that was sent before the newest one: ticks from it to the newest one, 1 to `MAX_GAP`, and its int16
    levels, as far as the fit reads them, in the order of those of the newest sample.
    """

    gap: int
    levels: tuple[int, ...]


class ModelParameters(NamedTuple):
    """Those of a model that the sender estimated, packed by its predictor: 0 to `UpdateForm.most_bytes` bytes."""

    data: bytes


Payload = PreviousSample | ModelParameters | None


class Update(NamedTuple):
    """The complete state of a decoder: any update that arrives restores it."""

    tick: int  # the sender's tick number of the newest sample
    selector: int  # index of the chosen predictor in the bank that both ends agreed on, 0 to `MAX_SELECTOR`
    # Int16 levels of the newest sample: the value on each axis, then the commanded position, where the channel says
    # that updates of this selector carry it (`Channel.forms`).
    newest: tuple[int, ...]
    payload: Payload = None  # what the chosen predictor needs in addition
