"""Encoders of the study: single predictors, the hybrid, `adaptive`, and `adaptive` with a part removed or retuned.

An ablation changes the live encoder from outside, because the codec has no switches for its parts.
"""

from dataclasses import dataclass, replace
from math import exp

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
from weberlink.codec.smoothing import Smoothing
from weberlink.geometry.vector import Vector

WEBER = 0.10
FLOOR_N = 0.02

SINGLES = HYBRID_BANK
"""The single predictors of the paper."""
ALL_SINGLES = (*SINGLES, "trend", "affine", "surface")
COMPARED = (HYBRID, ADAPTIVE, *ALL_SINGLES)


@dataclass(frozen=True)
class Alteration:
    """How an encoder differs from `adaptive`.

    Args:
        bank: of predictors.
        without: surface hypotheses that are left out.
        flat: whether surfaces have no curvature.
        memory: time constant of the record of sends [ticks]; None for no record.
        present: weight of the present error [sends].
        doubts: whether noise-sensitive candidates need a better record than the others.
    """

    bank: tuple[str, ...] = ADAPTIVE_BANK
    without: tuple[type[Candidate], ...] = ()
    flat: bool = False
    memory: float | None = MEMORY
    present: float = PRESENT
    doubts: bool = True


ABLATIONS: dict[str, Alteration] = {
    **{f"no {name}": Alteration(bank=tuple(each for each in ADAPTIVE_BANK if each != name)) for name in ADAPTIVE_BANK},
    "no friction": Alteration(without=(FrictionalHypothesis,)),
    "no motion": Alteration(without=(MovingHypothesis,)),
    "no still, frictionless surface": Alteration(without=(FrictionlessHypothesis,)),
    "no curvature": Alteration(flat=True),
    "no record": Alteration(memory=None),
    "no present error": Alteration(present=0.0),
    "no doubt": Alteration(doubts=False),
    "the paper's bank, by record": Alteration(bank=HYBRID_BANK),
}
"""`adaptive` with one part removed."""

TUNINGS: dict[str, Alteration] = {
    **{f"memory {memory:g}": Alteration(memory=memory) for memory in (0.1 * MEMORY, MEMORY / 3.0, 3.0 * MEMORY)},
    **{f"present {present:g}": Alteration(present=present) for present in (0.5 * PRESENT, 2.0 * PRESENT)},
}
"""Neighbours of the chosen constants."""


def channel_of(
    predictor: str, weber: float = WEBER, floor: float = FLOOR_N, smoothing: Smoothing | None = None
) -> Channel:
    """The force channel of the daemons with another Weber factor, floor [N] and smoothing."""
    return force_channel(predictor=predictor, weber=weber, floor=floor, smoothing=smoothing)


def altered_channel(alteration: Alteration) -> Channel:
    """The channel of an altered encoder."""
    return force_channel(predictor=ADAPTIVE, bank=alteration.bank, weber=WEBER, floor=FLOOR_N)


def altered(alteration: Alteration) -> Encoder:
    """An `adaptive` encoder with a part removed or retuned."""
    channel = altered_channel(alteration)
    return AlteredEncoder(channel, AlteredChoice(channel, alteration))


class AlteredEncoder(Encoder):
    """An encoder with a given choice of predictors."""

    __slots__ = ()

    def __init__(self, channel: Channel, choice: AdaptiveChoice) -> None:
        super().__init__(channel)
        self._choice = choice


class AlteredChoice(AdaptiveChoice):
    """The choice of the live encoder, altered."""

    __slots__ = ("_alteration",)

    def __init__(self, channel: Channel, alteration: Alteration) -> None:
        self._alteration = alteration
        super().__init__(channel)

    def reset(self) -> None:
        super().reset()
        part, rest = self._alteration, self._channel.rest
        self._shadows = [
            TunedShadow(
                shadow.selector,
                Flat(shadow.candidate) if part.flat else shadow.candidate,
                rest,
                shadow.doubt if part.doubts else 1.0,
                part.memory,
            )
            for shadow in self._shadows
            if type(shadow.candidate) not in part.without
        ]

    def _cost(self, shadow: Shadow, tick: int, bound: float) -> float:
        whole, present = super()._cost(shadow, tick, bound), self._alteration.present
        record = shadow.doubt * shadow.record(tick)
        return whole if present == PRESENT else record + (whole - record) * present / PRESENT


class Flat:
    """A candidate whose surfaces have no curvature."""

    __slots__ = ("_candidate",)

    def __init__(self, candidate: Candidate) -> None:
        self._candidate = candidate

    def model(self, context: EncodeContext) -> Model | None:
        model = self._candidate.model(context)
        return replace(model, curvature=0.0) if isinstance(model, SurfacePatch) else model


class TunedShadow(Shadow):
    """A shadow encoder with another memory.

    Args:
        selector: of the candidate; this, candidate, rest and doubt are those of `Shadow`.
        candidate: that the shadow runs.
        rest: value without contact [N].
        doubt: factor of its record.
        memory: time constant of the record [ticks]; its counts are scaled to those of `MEMORY`. None for no record.
    """

    __slots__ = ("_memory",)

    def __init__(
        self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float, memory: float | None
    ) -> None:
        super().__init__(selector, candidate, rest, doubt)
        self._memory = memory

    def record(self, tick: int) -> float:
        sends = super().record(tick)
        return 0.0 if self._memory is None else sends * (MEMORY / self._memory)

    def _forget(self, tick: int) -> None:
        passed = max(0, tick - self._at)
        self._at = tick
        self._sends *= exp(-passed / (self._memory or MEMORY))
