"""Figures of a link, from the questions and answers of `weberlink.protocol.probing`."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

from weberlink.cli.doctor.trial import nearest_rank
from weberlink.protocol.probing import Heard


@dataclass(frozen=True, slots=True)
class LinkTrial:
    """What a measurement recorded; times on the clock of the master [s].

    Args:
        asked: departure of each question.
        heard: every datagram of the slave; those before the first question tell only how the numbers go on.
        jitters: as the endpoint measured it, in order.
        silences: how often the session fell silent, at the limit of the file.
        paths: in use at the end.
        priority: what came of real-time rights.
        failure: why there is no result.
    """

    asked: Sequence[float] = ()
    heard: Sequence[Heard] = ()
    jitters: Sequence[float] = ()
    silences: int = 0
    paths: list[dict[str, Any]] = field(default_factory=list)
    priority: str = ""
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class Way:
    """One direction of a link.

    Args:
        delay_s: median [s]; the split of the round trip takes the fastest datagrams of both ways as equally fast.
        late_s: by how much 1 % of the datagrams exceed the least delay [s].
        loss: share of datagrams lost, 0..1.
        burst: mean number of datagrams lost in a row; 0 without losses.
        longest_burst: the longest such run.
    """

    delay_s: float
    late_s: float
    loss: float
    burst: float
    longest_burst: int

    @classmethod
    def of(cls, delays: Sequence[float], runs: Sequence[int], sent: int) -> "Way":
        median, late = nearest_rank(delays, 0.5), nearest_rank(delays, 0.99) - min(delays)
        lost = sum(runs)
        return cls(median, late, lost / sent if sent else 0.0, lost / len(runs) if runs else 0.0, max(runs, default=0))

    @property
    def document(self) -> dict[str, float]:
        """For JSON."""
        figures = asdict(self)
        return {"delay_ms": 1e3 * figures.pop("delay_s"), "late_p99_ms": 1e3 * figures.pop("late_s"), **figures}


@dataclass(frozen=True, slots=True)
class LinkFigures:
    """Figures of both directions.

    Args:
        questions, answers: how many were sent, and how many were answered.
        seconds: from the first question to the last.
        silences: how often the session fell silent.
        rtt_s: round trip [s]: its least, 50 %, 99 %, largest.
        jitter_s: as the endpoint measured it [s]: 50 % and 99 % of the time at most this.
        loop_age_s: largest loop age [s], which silence limit and round trip bound (`weberlink.protocol.liveness`).
        to_slave, to_master: each direction.
    """

    questions: int
    answers: int
    seconds: float
    silences: int
    rtt_s: tuple[float, float, float, float]
    jitter_s: tuple[float, float]
    loop_age_s: float
    to_slave: Way
    to_master: Way

    @property
    def document(self) -> dict[str, Any]:
        """For JSON, in ms and shares."""
        return {
            **{name: getattr(self, name) for name in ("questions", "answers", "seconds", "silences")},
            "rtt_ms": dict(zip(("min", "p50", "p99", "max"), (1e3 * value for value in self.rtt_s), strict=True)),
            "jitter_ms": dict(zip(("p50", "p99"), (1e3 * value for value in self.jitter_s), strict=True)),
            "loop_age_ms": 1e3 * self.loop_age_s,
            "to_slave": self.to_slave.document,
            "to_master": self.to_master.document,
        }


def figures(trial: LinkTrial) -> LinkFigures:
    """Compute the figures.

    Raises:
        ValueError: no question was answered.
    """
    asked, heard = trial.asked, trial.heard
    answered = {each.question: each for each in heard if each.question is not None}
    timed = [(each.at - asked[question], each.delay) for question, each in answered.items() if each.delay is not None]
    if not timed:
        raise ValueError("the slave answered no question")
    jitters = trial.jitters or [0.0]
    trips, inward = [trip for trip, _ in timed], [delay for _, delay in timed]
    outward = [max(0.0, trip - delay) for trip, delay in timed]
    return LinkFigures(
        questions=len(asked),
        answers=len(answered),
        seconds=asked[-1] - asked[0],
        silences=trial.silences,
        rtt_s=(min(trips), nearest_rank(trips, 0.5), nearest_rank(trips, 0.99), max(trips)),
        jitter_s=(nearest_rank(jitters, 0.5), nearest_rank(jitters, 0.99)),
        loop_age_s=loop_age(asked, heard),
        to_slave=Way.of(outward, lost_questions(len(asked), heard), len(asked)),
        to_master=Way.of(inward, *lost_answers(heard)),
    )


def lost_answers(heard: Iterable[Heard]) -> tuple[list[int], int]:
    """Runs of the slave's datagrams that never came, and how many of its datagrams count."""
    sessions = [sorted(numbers) for numbers in _numbers(heard).values()]
    runs = [after - before - 1 for each in sessions for before, after in pairwise(each) if after - before > 1]
    return runs, sum(each[-1] - each[0] + 1 for each in sessions)


def lost_questions(count: int, heard: Sequence[Heard]) -> list[int]:
    """Runs of questions that never arrived.

    Of a run without answers, those answers may be lost which the gap in the numbers of the slave's datagrams can hold.
    A datagram in such a gap was an answer with the probability that holds for those that came.

    Args:
        count: of all questions.
        heard: as of `LinkTrial`.
    """
    answers = {each.question: each for each in heard if each.question is not None}
    numbers = _numbers(heard)
    share = len(answers) / max(1, sum(map(len, numbers.values())))
    runs = []
    for before, after in pairwise([-1, *sorted(answers), count]):
        missing, unheard = after - before - 1, 0
        first, last = answers.get(before), answers.get(after)
        if first is not None and last is not None and first.session == last.session:
            between = range(first.sequence + 1, last.sequence)
            unheard = sum(number not in numbers[first.session] for number in between)
        runs.append(missing - min(missing, round(unheard * share)))
    return [run for run in runs if run > 0]


def _numbers(heard: Iterable[Heard]) -> dict[int, set[int]]:
    """Numbers of the datagrams that came, by session."""
    numbers: dict[int, set[int]] = {}
    for each in heard:
        numbers.setdefault(each.session, set()).add(each.sequence)
    return numbers


def loop_age(asked: Sequence[float], heard: Iterable[Heard]) -> float:
    """Largest time since the newest question that is known to have arrived left [s]; questions 5 ms apart add theirs.

    It counts from the first answer on, to the last one.
    """
    largest, newest = 0.0, None
    for each in heard:
        if each.question is not None:
            left = asked[each.question]
            largest = largest if newest is None else max(largest, each.at - newest)
            newest = left if newest is None else max(newest, left)
    return largest
