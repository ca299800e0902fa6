"""Plan of an experiment: the rating scale, its references, and every condition once in a random order.

The scale is Table I of Xu, Kammerl, Chaudhari, Steinbach (HAVE 2011), in its words, and so are the three references.
The ledger of a subject stores the words that were shown.
"""

from dataclasses import dataclass
from itertools import product
from random import Random
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from weberlink_studies.paper.claims import PREDICTORS, WEBERS

TRIAL_S = 10.0
BREAK_EVERY = 10  # trials between two breaks
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
Level = Annotated[int, Field(ge=LOWEST, le=HIGHEST)]


@dataclass(frozen=True)
class CodingCondition:
    """Predictor and Weber factor of a trial; a Weber factor of 0 sends every sample of every channel."""

    predictor: str
    weber: float


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


def order(seed: int, subject: int) -> tuple[CodingCondition, ...]:
    """All conditions in an order of the subject's own, the same for the same seed."""
    conditions = [CodingCondition(*pair) for pair in product(PREDICTORS, WEBERS)]
    Random(f"{seed}/{subject}/order").shuffle(conditions)  # noqa: S311 - must be repeatable, not secret
    return tuple(conditions)


class TrialPlan(BaseModel):
    """The first line of a ledger: everything that is fixed before the first trial."""

    model_config = ConfigDict(frozen=True)

    event: Literal["plan"] = "plan"
    version: Literal[1] = 1  # of the plan and of its ledger
    subject: int  # number; names are not stored
    simulated: bool  # whether a program rates
    seed: int  # of the order and of a simulated subject
    duration_s: float
    digest: str  # of the configuration as resolved
    configuration: dict[str, Any]
    wording: dict[Level, str]  # text of each level
    trials: Annotated[tuple[CodingCondition, ...], Field(min_length=1)]
    environment: dict[str, Any]

    @field_validator("trials")
    @classmethod
    def _once(cls, trials: tuple[CodingCondition, ...]) -> tuple[CodingCondition, ...]:
        if len(set(trials)) != len(trials):
            raise ValueError("expected each condition once")
        return trials
