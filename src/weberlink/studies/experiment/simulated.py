"""A program in the place of a subject, to try out the study and its analysis. No model of a person.

It rates by one documented rule: the root mean square of the felt error in just noticeable differences (JND), on a
scale that it learns in the training, as a person does. The references it felt there had a felt error each, and are
told to be of level 5, 3 and 1; between them, and beyond the last one, levels lie on straight lines. Chance, seeded per
subject and trial, is added, and the nearest level is the rating. Whatever it gives is marked as simulated everywhere.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from random import Random

from weberlink.studies.experiment.conduct import ConductError, Felt
from weberlink.studies.experiment.ledger import Progress
from weberlink.studies.experiment.plan import Plan
from weberlink.studies.experiment.scale import HIGHEST, LOWEST, REFERENCES, Reference
from weberlink.system.scoring.perception import Threshold

THRESHOLD = Threshold(jnd=0.10, floor_n=0.10)
"""What the rule counts in. Weber's law fails below about 1 N; the JND is taken as constant there."""
FELT = "felt_error_rms_jnd"
"""Name of the figure that is rated."""
SPREAD = 0.5
"""Standard deviation of what is added to a level before it is rounded."""


class SimulatedSubject:
    """Rates by the rule above.

    Args:
        plan: of a simulated subject.
        report: told how many trials are rated.
    """

    def __init__(self, plan: Plan, report: Callable[[int, int], None]) -> None:
        assert plan.simulated
        self._plan = plan
        self._report = report
        self._anchors: dict[int, float] = {}

    def welcome(self, progress: Progress) -> None:
        for place, figures in progress.references.items():
            self._anchors[REFERENCES[place].level] = float(figures[FELT])
        self._report(len(progress.rated), len(progress.plan.trials))

    def prepare_reference(self, place: int, reference: Reference) -> None:
        pass

    def learn(self, reference: Reference, felt: Felt) -> bool:
        self._anchors[reference.level] = float(felt.figures[FELT])
        return False

    def prepare(self, number: int, of: int) -> None:
        if number == 1:
            self._check_anchors()
        self._report(number - 1, of)

    def elapsed(self, seconds: float) -> None:
        pass

    def rate(self, number: int, felt: Felt) -> int:
        """The nearest level to that of the felt error and some chance."""
        chance = Random(f"{self._plan.seed}/{self._plan.subject}/rating/{number}")  # noqa: S311 - must be repeatable
        anchors = [(self._anchors[reference.level], reference.level) for reference in REFERENCES]
        level = level_of(float(felt.figures[FELT]), anchors) + chance.gauss(0.0, SPREAD)
        return min(HIGHEST, max(LOWEST, round(level)))

    def repeat(self, what: str, problem: str) -> None:
        """In virtual time the same happens again.

        Raises:
            ConductError: always.
        """
        raise ConductError(f"a simulated {what} cannot be rated: {problem}")

    def rest(self, after: int, of: int) -> None:
        pass

    def farewell(self) -> None:
        of = len(self._plan.trials)
        self._report(of, of)

    def leave(self) -> None:
        pass

    def _check_anchors(self) -> None:
        errors = [self._anchors[reference.level] for reference in REFERENCES]
        if any(better >= worse for better, worse in pairwise(errors)):
            told = ", ".join(f"{error:.3f}" for error in errors)
            raise ConductError(
                f"the references cannot be told apart: felt errors of {told} JND, expected rising ones; "
                "use a file whose operator touches something, or longer trials"
            )


def level_of(error: float, anchors: Sequence[tuple[float, int]]) -> float:
    """The level of a felt error, monotone in it, within the scale.

    Args:
        error: RMS felt error [JND].
        anchors: felt error and level of each reference, by rising error and falling level.
    """
    for (least, best), (most, worst) in pairwise(anchors):
        level = best + (worst - best) * (error - least) / (most - least)
        if error <= most:
            break
    return min(float(HIGHEST), max(float(LOWEST), level))
