"""What codes a signal: a predictor, the paper's bank, `adaptive`, or that with a part of it off or tuned otherwise.

An ablation takes parts out of the live sender from outside, which is why it knows that sender well: the codec itself
has no switch for what nobody would switch off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from weberlink.codec import Channel, Encoder, force_channel
from weberlink.codec.adaptive import MEMORY, PRESENT, AdaptiveChoice, Shadow
from weberlink.codec.predictors import ADAPTIVE, ADAPTIVE_BANK, HYBRID, HYBRID_BANK, Model
from weberlink.codec.predictors.contract import Candidate, EncodeContext
from weberlink.codec.predictors.surface import (
    FrictionalHypothesis,
    FrictionlessHypothesis,
    MovingHypothesis,
    SurfacePatch,
)
from weberlink.codec.sample import Sample
from weberlink.codec.smoothing import Smoothing
from weberlink.studies.adaptive.shadows import Tuned

WEBER = 0.10
FLOOR_N = 0.02

SINGLES = ("zoh", "linear", "plane", "sphere")
"""The paper's."""
ALL_SINGLES = (*SINGLES, "trend", "affine", "surface")
COMPARED = (HYBRID, ADAPTIVE, *ALL_SINGLES)


@dataclass(frozen=True)
class Part:
    """What is different from `adaptive` as it is.

    Args:
        bank: of predictors.
        without: kinds of surfaces that are not supposed.
        flat: whether no surface is curved.
        memory: time constant of the record [ticks]; None for no record.
        present: weight of the present error [sends].
        doubts: whether the record of what estimates from noise must be better than that of what does not.
    """

    bank: tuple[str, ...] = ADAPTIVE_BANK
    without: tuple[type[Candidate], ...] = ()
    flat: bool = False
    memory: float | None = MEMORY
    present: float = PRESENT
    doubts: bool = True


def _bank_without(name: str) -> Part:
    return Part(bank=tuple(each for each in ADAPTIVE_BANK if each != name))


ABLATIONS: dict[str, Part] = {
    **{f"no {name}": _bank_without(name) for name in ADAPTIVE_BANK},
    "no friction": Part(without=(FrictionalHypothesis,)),
    "no motion": Part(without=(MovingHypothesis,)),
    "no still, frictionless surface": Part(without=(FrictionlessHypothesis,)),
    "no curvature": Part(flat=True),
    "no record": Part(memory=None),
    "no present error": Part(present=0.0),
    "no doubt": Part(doubts=False),
    "the paper's bank, by record": Part(bank=HYBRID_BANK),
}
"""Each part off."""

TUNINGS: dict[str, Part] = {
    **{f"memory {memory:g}": Part(memory=memory) for memory in (0.1 * MEMORY, MEMORY / 3.0, 3.0 * MEMORY)},
    **{f"present {present:g}": Part(present=present) for present in (0.5 * PRESENT, 2.0 * PRESENT)},
}
"""Neighbours of the constants that were chosen."""


def channel_of(
    predictor: str, weber: float = WEBER, floor: float = FLOOR_N, smoothing: Smoothing | None = None
) -> Channel:
    """As the daemons have it, but for the Weber factor and the floor [N]."""
    return force_channel(predictor=predictor, weber=weber, floor=floor, smoothing=smoothing)


def altered(part: Part, weber: float = WEBER, floor: float = FLOOR_N) -> Encoder:
    """The sender of `adaptive` with a part of it off or tuned otherwise."""
    channel = force_channel(predictor=ADAPTIVE, bank=part.bank, weber=weber, floor=floor)
    return AlteredEncoder(channel, AlteredChoice(channel, part))


class AlteredEncoder(Encoder):
    """One that chooses as it is told."""

    __slots__ = ()

    def __init__(self, channel: Channel, choice: AdaptiveChoice) -> None:
        super().__init__(channel)
        self._choice = choice


class AlteredChoice(AdaptiveChoice):
    """The live one but for a `Part`."""

    __slots__ = ("_part",)

    def __init__(self, channel: Channel, part: Part) -> None:
        self._part = part
        super().__init__(channel)

    def reset(self) -> None:
        super().reset()
        part, rest = self._part, self._channel.rest
        self._shadows = [
            Tuned(
                shadow.selector,
                Flat(shadow.candidate) if part.flat else shadow.candidate,
                rest,
                shadow.doubt if part.doubts else 1.0,
                part.memory,
            )
            for shadow in self._shadows
            if type(shadow.candidate) not in part.without
        ]

    def choose(
        self, selectors: Sequence[int], newest: Sample, earlier: Sample | None, bound: float
    ) -> tuple[int, Model | None]:
        present = self._part.present

        def cost(shadow: Shadow) -> float:
            whole = self._cost(shadow, newest.tick, bound)
            if present == PRESENT:
                return whole
            record = shadow.doubt * shadow.record(newest.tick)
            return record + (whole - record) * present / PRESENT

        best = min((shadow for shadow in self._shadows if shadow.selector in selectors), key=cost)
        return best.selector, best.candidate.model(EncodeContext(newest, earlier, bound, self._history))


class Flat:
    """A candidate whose surfaces have no curvature."""

    __slots__ = ("_candidate",)

    def __init__(self, candidate: Candidate) -> None:
        self._candidate = candidate

    def model(self, context: EncodeContext) -> Model | None:
        model = self._candidate.model(context)
        return replace(model, curvature=0.0) if isinstance(model, SurfacePatch) else model
