"""What every candidate is: a way to make the model of a send from all that the sender knows."""

from typing import NamedTuple, Protocol

from weberlink.codec.adaptive.history import History
from weberlink.codec.predictors import Model
from weberlink.codec.sample import Sample


class Occasion(NamedTuple):
    """A send.

    Args:
        newest: the sample to send, as the wire says it.
        earlier: the sample sent before, as the wire said it; None where there was none, or too long ago.
        bound: the deadband at the newest sample, in the unit of the values.
        history: the samples as measured, up to this one.
    """

    newest: Sample
    earlier: Sample | None
    bound: float
    history: History


class Candidate(Protocol):
    """One way; several may serve the same predictor."""

    def model(self, occasion: Occasion) -> Model | None:
        """The model to send, finite; None where this candidate knows none, and the sample is held."""
        ...
