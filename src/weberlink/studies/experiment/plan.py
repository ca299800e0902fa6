"""Plan of an experiment: the rating scale, its references, and every condition once in a random order.

The scale is Table I of Xu, Kammerl, Chaudhari, Steinbach (HAVE 2011), in its words, and so are the three references.
The ledger of a subject stores the words that were shown.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from random import Random
from typing import Any, Self

from weberlink.studies.paper.claims import PREDICTORS, WEBERS

TRIAL_S = 10.0
BREAK_EVERY = 10
"""Trials between two breaks."""
VERSION = 1
"""Version of the plan and of its ledger."""


@dataclass(frozen=True)
class CodingCondition:
    """Predictor and Weber factor of a trial; a Weber factor of 0 sends every sample of every channel."""

    predictor: str
    weber: float


def order(seed: int, subject: int) -> tuple[CodingCondition, ...]:
    """All conditions in an order of the subject's own, the same for the same seed."""
    conditions = [CodingCondition(*pair) for pair in product(PREDICTORS, WEBERS)]
    Random(f"{seed}/{subject}/order").shuffle(conditions)  # noqa: S311 - must be repeatable, not secret
    return tuple(conditions)


@dataclass(frozen=True)
class TrialPlan:
    """The first line of a ledger: everything that is fixed before the first trial.

    Args:
        subject: number; names are not stored.
        simulated: whether a program rates.
        seed: of the order and of a simulated subject.
        duration_s: length of a trial [s].
        digest: of the configuration as resolved.
        configuration: that configuration.
        wording: text of each level, by the level as text.
        trials: in order.
        environment: at the start.
    """

    subject: int
    simulated: bool
    seed: int
    duration_s: float
    digest: str
    configuration: Mapping[str, Any]
    wording: Mapping[str, str]
    trials: tuple[CodingCondition, ...]
    environment: Mapping[str, Any]

    def as_json(self) -> dict[str, Any]:
        facts = {name: getattr(self, name) for name in self.__dataclass_fields__}
        trials = [{"predictor": trial.predictor, "weber": trial.weber} for trial in self.trials]
        return {"version": VERSION} | facts | {"trials": trials}

    @classmethod
    def from_json(cls, facts: Mapping[str, Any]) -> Self:
        """Read a plan back.

        Raises:
            ValueError: if it is not a plan, or of another version.
        """
        version = facts.get("version")
        if version != VERSION:
            raise ValueError(f"expected a plan of version {VERSION}, not {version!r}")
        try:
            trials = tuple(CodingCondition(str(trial["predictor"]), float(trial["weber"])) for trial in facts["trials"])
            plan = cls(**{name: facts[name] for name in cls.__dataclass_fields__} | {"trials": trials})
        except (KeyError, TypeError) as error:
            raise ValueError(f"not a plan: {error} is missing or wrong") from None
        if len(set(trials)) != len(trials) or not trials:
            raise ValueError("expected trials without repetition")
        if not set(plan.wording) <= {str(level) for level in SCALE}:
            raise ValueError(f"wording: expected levels {LOWEST} to {HIGHEST}, not {', '.join(map(str, plan.wording))}")
        return plan


SCALE: dict[int, str] = {
    5: "no difference",
    4: "perceptible, but not disturbing",
    3: "slightly disturbing",
    2: "disturbing",
    1: "strongly disturbing",
    0: "completely distorted",
}
"""Words of each level, the best first: Table I of the paper."""
LOWEST, HIGHEST = min(SCALE), max(SCALE)


@dataclass(frozen=True)
class TrainingReference:
    """A signal of the training, and the level that the subject is told."""

    level: int
    condition: CodingCondition


REFERENCES = (
    TrainingReference(5, CodingCondition("zoh", 0.0)),
    TrainingReference(3, CodingCondition("zoh", 0.125)),
    TrainingReference(1, CodingCondition("linear", 0.25)),
)


def rating_of(text: str) -> int | None:
    """The level that was typed; None if it is not one."""
    stripped = text.strip()
    if not (stripped.isascii() and stripped.isdigit()) or len(stripped) > 1:
        return None
    return level if (level := int(stripped)) in SCALE else None
