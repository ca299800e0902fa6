"""Which candidate makes the model of a send: the one whose shadow has the best record, and is least wrong now."""

from collections.abc import Sequence

from weberlink.codec.adaptive.affine import LocalAffine
from weberlink.codec.adaptive.candidate import Candidate, Occasion
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.adaptive.fitted import Fitted
from weberlink.codec.adaptive.history import History
from weberlink.codec.adaptive.shadow import Measure, Shadow
from weberlink.codec.adaptive.surface import Moving, Rough, Smooth
from weberlink.codec.adaptive.trend import HOLD_20, LINE_40
from weberlink.codec.channel import Channel
from weberlink.codec.predictors import FITTED, Model
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector

PRESENT = 12.0
"""What an error of one deadband or more at this moment counts for, in sends."""
DOUBT = {"trend": 1.1, "affine": 1.1}
"""By so much the record of these must be better than that of what assumes less: between equals it is noise that
decides.
"""
LEAST_FORCE_STEPS = 10.0
"""A contact is a force of so many wire steps at least, and twice the deadband at rest."""


class Choice:
    """The shadows of all candidates of a bank, and the choice among them.

    A contact is followed if, and only if, one of them makes surfaces.
    """

    __slots__ = ("_channel", "_contact", "_history", "_measure", "_shadows")

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._measure: Measure = channel.deadband.error
        self.reset()

    def reset(self) -> None:
        """Forget the signal."""
        channel = self._channel
        self._history = History()
        self._contact: Contact | None = None
        if "surface" in channel.bank:
            at_rest = channel.deadband.bound(ZERO, ZERO, ZERO, 0.0)
            self._contact = Contact(max(2.0 * at_rest, LEAST_FORCE_STEPS * channel.value_quantizer.step))
        self._shadows = [
            Shadow(selector, candidate, channel.rest, DOUBT.get(name, 1.0))
            for selector, name in enumerate(channel.bank)
            for candidate in self._candidates(name)
        ]

    def measure_with(self, measure: Measure) -> None:
        """Compare errors as another deadband does, from now on."""
        self._measure = measure

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float) -> None:
        """Take in the sample of a tick.

        Args:
            tick: of the sender.
            actual: as measured, within the range of the wire.
            place: where models are evaluated.
            bound: the deadband now.
        """
        measure, history, channel = self._measure, self._history, self._channel
        follows = history.add(tick, actual, place)
        if self._contact is not None:
            self._contact.follow(history, follows)
        sample: Sample | None = None
        for shadow in self._shadows:
            if shadow.follow(tick, actual, place, bound, measure):
                if sample is None:
                    sample = channel.sample(tick, channel.levels(actual, place))
                shadow.send(sample, bound, history)

    def choose(
        self, selectors: Sequence[int], newest: Sample, earlier: Sample | None, bound: float
    ) -> tuple[int, Model | None]:
        """The predictor to send now, of those that may be, and its model; None for the sample held.

        Args:
            selectors: that may be chosen.
            newest: the sample to send.
            earlier: the one sent before; None where it may not be used.
            bound: the deadband now.
        """
        best = min(
            (shadow for shadow in self._shadows if shadow.selector in selectors),
            key=lambda shadow: self._cost(shadow, newest.tick, bound),
        )
        return best.selector, best.candidate.model(Occasion(newest, earlier, bound, self._history))

    @staticmethod
    def _cost(shadow: Shadow, tick: int, bound: float) -> float:
        wrong = min(1.0, shadow.error / bound) if bound > 0.0 else 1.0
        return shadow.doubt * shadow.record(tick) + PRESENT * wrong

    def _candidates(self, name: str) -> list[Candidate]:
        """Those that serve a predictor, the simplest first."""
        if name in FITTED:
            return [Fitted(FITTED[name], self._channel.trust)]
        if name == "trend":
            return [HOLD_20, LINE_40]
        if name == "affine":
            return [LocalAffine()]
        assert self._contact is not None
        trust = self._channel.trust
        return [Smooth(self._contact, trust), Rough(self._contact, trust), Moving(self._contact, trust)]
