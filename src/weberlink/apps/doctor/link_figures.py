"""Figures of a link, from the questions and answers of `weberlink.protocol.probing`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from weberlink.apps.doctor.trial import nearest_rank
from weberlink.protocol.probing import Heard


@dataclass(frozen=True, slots=True)
class LinkSamples:
    """What a measurement recorded; times on the clock of the master.

    Args:
        asked: departure of each question [s].
        heard: every datagram of the slave; those before the first question tell only how the numbers go on.
        delays: (at, round trip, jitter) [s] as the endpoint measured them, in order.
        silences: how often the session fell silent, at the limit of the file.
    """

    asked: Sequence[float]
    heard: Sequence[Heard]
    delays: Sequence[tuple[float, float, float]]
    silences: int = 0


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


@dataclass(frozen=True, slots=True)
class LinkFigures:
    """Figures of both directions.

    Args:
        questions, answers: how many were sent, and how many were answered.
        seconds: from the first question to the last.
        rtt_s: round trip [s]: its least, 50 %, 99 %, largest.
        to_slave, to_master: each direction.
        jitter_s: as the endpoint measured it [s]: 50 % and 99 % of the time at most this.
        loop_age_s: largest loop age [s], which silence limit and round trip bound (`weberlink.protocol.liveness`).
        silences: how often the session fell silent.
    """

    questions: int
    answers: int
    seconds: float
    rtt_s: tuple[float, float, float, float]
    to_slave: Way
    to_master: Way
    jitter_s: tuple[float, float]
    loop_age_s: float
    silences: int

    @property
    def document(self) -> dict[str, Any]:
        """For JSON, in ms and shares."""
        least, median, late, most = (1e3 * value for value in self.rtt_s)
        return {
            "questions": self.questions,
            "answers": self.answers,
            "seconds": self.seconds,
            "rtt_ms": {"min": least, "p50": median, "p99": late, "max": most},
            "jitter_ms": {"p50": 1e3 * self.jitter_s[0], "p99": 1e3 * self.jitter_s[1]},
            "loop_age_ms": 1e3 * self.loop_age_s,
            "silences": self.silences,
            "to_slave": _way_document(self.to_slave),
            "to_master": _way_document(self.to_master),
        }


def _way_document(way: Way) -> dict[str, float]:
    return {
        "delay_ms": 1e3 * way.delay_s,
        "late_p99_ms": 1e3 * way.late_s,
        "loss": way.loss,
        "burst": way.burst,
        "longest_burst": way.longest_burst,
    }


def figures(samples: LinkSamples) -> LinkFigures:
    """Compute the figures.

    Raises:
        ValueError: no question was answered.
    """
    asked = samples.asked
    answers = sorted((each for each in samples.heard if each.question is not None), key=lambda each: each.question or 0)
    timed = [
        (each.at - asked[each.question], each.delay)
        for each in answers
        if each.question is not None and each.delay is not None
    ]
    if not timed:
        raise ValueError("the slave answered no question")
    jitters = [jitter for _, _, jitter in samples.delays] or [0.0]
    trips = [trip for trip, _ in timed]
    inward = [delay for _, delay in timed]
    outward = [max(0.0, trip - delay) for trip, delay in timed]
    return LinkFigures(
        questions=len(asked),
        answers=len(answers),
        seconds=asked[-1] - asked[0],
        rtt_s=(min(trips), nearest_rank(trips, 0.5), nearest_rank(trips, 0.99), max(trips)),
        to_slave=_way(outward, lost_questions(len(asked), samples.heard), len(asked)),
        to_master=_way(inward, *lost_answers(samples.heard)),
        jitter_s=(nearest_rank(jitters, 0.5), nearest_rank(jitters, 0.99)),
        loop_age_s=loop_age(asked, samples.heard),
        silences=samples.silences,
    )


def _way(delays: Sequence[float], runs: Sequence[int], sent: int) -> Way:
    return Way(
        delay_s=nearest_rank(list(delays), 0.5),
        late_s=nearest_rank(list(delays), 0.99) - min(delays),
        loss=sum(runs) / sent if sent else 0.0,
        burst=sum(runs) / len(runs) if runs else 0.0,
        longest_burst=max(runs, default=0),
    )


def lost_answers(heard: Iterable[Heard]) -> tuple[list[int], int]:
    """Runs of the slave's datagrams that never came, and how many of its datagrams count."""
    runs: list[int] = []
    sent = 0
    for numbers in _numbers(heard).values():
        ordered = sorted(numbers)
        runs += [after - before - 1 for before, after in pairwise(ordered) if after - before > 1]
        sent += ordered[-1] - ordered[0] + 1
    return runs, sent


def lost_questions(count: int, heard: Sequence[Heard]) -> list[int]:
    """Runs of questions that never arrived.

    Of a run without answers, those answers may be lost which the gap in the numbers of the slave's datagrams can hold.
    A datagram in such a gap was an answer with the probability that holds for those that came.

    Args:
        count: of all questions.
        heard: as of `LinkSamples`.
    """
    answers = {each.question: each for each in heard if each.question is not None}
    numbers = _numbers(heard)
    share = len(answers) / max(1, sum(map(len, numbers.values())))
    runs = []
    bounds = [-1, *sorted(answers), count]
    for before, after in pairwise(bounds):
        missing = after - before - 1
        if missing == 0:
            continue
        first, last = answers.get(before), answers.get(after)
        unheard = 0
        if first is not None and last is not None and first.session == last.session:
            between = range(first.sequence + 1, last.sequence)
            unheard = sum(number not in numbers[first.session] for number in between)
        lost = missing - min(missing, round(unheard * share))
        if lost > 0:
            runs.append(lost)
    return runs


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
        if each.question is None:
            continue
        if newest is not None:
            largest = max(largest, each.at - newest)
        left = asked[each.question]
        newest = left if newest is None else max(newest, left)
    return largest
