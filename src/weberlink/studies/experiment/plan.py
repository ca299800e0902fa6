"""What a subject is going to feel: every combination of predictor and Weber factor once, in an order of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from random import Random
from typing import Any, Self

from weberlink.studies.paper.claims import WEBERS

PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")
"""The paper's."""
TRIALS = len(PREDICTORS) * len(WEBERS)
TRIAL_S = 10.0
BREAK_EVERY = 10
"""Trials between two breaks."""
VERSION = 1
"""Of the plan and of the ledger that it opens."""


@dataclass(frozen=True)
class Condition:
    """How the force is coded while a subject feels it; a Weber factor of 0 sends every sample."""

    predictor: str
    weber: float


def order(seed: int, subject: int) -> tuple[Condition, ...]:
    """All combinations, shuffled: another order for each subject, the same for the same seed."""
    conditions = [Condition(*pair) for pair in product(PREDICTORS, WEBERS)]
    Random(f"{seed}/{subject}/order").shuffle(conditions)  # noqa: S311 - must be repeatable, not secret
    return tuple(conditions)


@dataclass(frozen=True)
class Plan:
    """The first line of a subject's ledger: all that is fixed before the first trial.

    Args:
        subject: number; names are neither asked nor stored.
        simulated: whether a program rates, and no person.
        seed: of the order, and of whatever chance a simulated subject has.
        duration_s: length of a trial [s].
        digest: of the configuration as resolved.
        configuration: that configuration.
        wording: level as text to what the subject reads.
        trials: in the order in which they are felt.
        environment: where it was begun.
    """

    subject: int
    simulated: bool
    seed: int
    duration_s: float
    digest: str
    configuration: Mapping[str, Any]
    wording: Mapping[str, str]
    trials: tuple[Condition, ...]
    environment: Mapping[str, Any]

    def as_json(self) -> dict[str, Any]:
        facts = {name: getattr(self, name) for name in self.__dataclass_fields__}
        trials = [{"predictor": trial.predictor, "weber": trial.weber} for trial in self.trials]
        return {"version": VERSION} | facts | {"trials": trials}

    @classmethod
    def from_json(cls, facts: Mapping[str, Any]) -> Self:
        """Read a plan back.

        Raises:
            ValueError: if it is none, or of another version.
        """
        version = facts.get("version")
        if version != VERSION:
            raise ValueError(f"expected a plan of version {VERSION}, not {version!r}")
        try:
            trials = tuple(Condition(str(trial["predictor"]), float(trial["weber"])) for trial in facts["trials"])
            plan = cls(**{name: facts[name] for name in cls.__dataclass_fields__} | {"trials": trials})
        except (KeyError, TypeError) as error:
            raise ValueError(f"expected a plan, which has {error}") from None
        if len(set(trials)) != len(trials) or not trials:
            raise ValueError("expected trials that differ")
        return plan
