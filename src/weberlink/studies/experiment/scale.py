"""The scale that a subject rates on, and the references that anchor it. The only place with its wording.

Certain of the study of Xu, Kammerl, Chaudhari, Steinbach (HAVE 2011) are the levels 0 to 5 and the three references.
The wording of its Table I is not at hand: `WORDING` is our own. Whoever has that table changes it here; what was shown
is stored with every subject.
"""

from dataclasses import dataclass

from weberlink.studies.experiment.plan import Condition

WORDING: dict[int, str] = {
    5: "no difference to the undisturbed signal",
    4: "a difference that can just be noticed",
    3: "a clear difference that hardly disturbs",
    2: "disturbing",
    1: "strongly disturbing",
    0: "unusable",
}
LOWEST, HIGHEST = min(WORDING), max(WORDING)


@dataclass(frozen=True)
class Reference:
    """A signal that is felt in the training, and the level that the subject is told it has."""

    level: int
    condition: Condition


REFERENCES = (
    Reference(5, Condition("zoh", 0.0)),
    Reference(3, Condition("zoh", 0.125)),
    Reference(1, Condition("linear", 0.25)),
)


def rating_of(text: str) -> int | None:
    """A level as typed; None for what is none."""
    stripped = text.strip()
    if not (stripped.isascii() and stripped.isdigit()) or len(stripped) > 1:
        return None
    return level if (level := int(stripped)) in WORDING else None
