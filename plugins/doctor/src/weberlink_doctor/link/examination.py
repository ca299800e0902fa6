"""The report on the link to a waiting slave: way out of this host, path, figures, and settings that suit them.

Every threshold is one by which a session itself decides (`weberlink.protocol.liveness`), or by which `check` warns
(`weberlink.session.advice`). What both ends must hold alike has to be set on both hosts.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from math import ceil
from pathlib import Path
from typing import Any

from weberlink.config import MASTER, Configuration, System, load
from weberlink.config.finders import finder_of
from weberlink.config.model import LinkSettings, split_address
from weberlink.protocol.aio.sockets import numeric
from weberlink.protocol.liveness import HeartbeatSchedule, Liveness
from weberlink.protocol.local_end import LONGEST_SILENCE
from weberlink.protocol.negotiation import LONGEST, in_ms, rounded_up
from weberlink.protocol.timing import LONGEST_RTT
from weberlink.session.advice import DryRun, added_delays, uncontrolled_delay
from weberlink_doctor.host.trial import nearest_rank
from weberlink_doctor.link.trial import Heard, LinkTrial, build_probe, run_link_trial
from weberlink_doctor.report import DoctorReport, Finding, Needs, advice, ok, problem

SILENCE_STEP_MS = 10
ELSEWHERE = "use another network"

WayOut = tuple[Mapping[str, Any], Sequence[Finding]]
"""What a path finder says of the way out of this host: for JSON, and in words."""


def examine(file: Path, overrides: Iterable[str], peer: str, seconds: float) -> DoctorReport:
    """Examine the way out of this host if the file has a path finder, then measure the link to the waiting slave.

    Args:
        file: of the master.
        overrides: as of `weberlink.config.load`.
        peer: a label where paths are found, else a host, perhaps with a port.
        seconds: of the measurement [s].

    Raises:
        ConfigurationError: the file is wrong, the key cannot be read, or the peer is not known.
    """
    given = load(file, overrides, [MASTER])
    if given.finds_path:
        called = f"link.finder.peer={peer}"
    else:
        try:
            address = split_address(peer)
        except ValueError:
            address = peer.strip("[]"), split_address(given.system.link.slave)[1]
        called = f"link.slave={numeric(address)}"
    configuration = load(file, [*overrides, called], [MASTER])
    finder = configuration.finder
    build_probe(configuration, 0.0, finder_of(configuration, MASTER))  # for its errors, before anything takes time
    way_out = ({}, []) if finder is None else finder.driver.examine(finder.options)
    return judge(configuration, way_out, run_link_trial(file, [*overrides, called], seconds))


def judge(configuration: Configuration, way_out: WayOut, trial: LinkTrial) -> DoctorReport:
    """The report on what was measured."""
    link, failure, measured = configuration.system.link, trial.failure, None
    if failure is None:
        try:
            measured = figures(trial)
        except ValueError as error:
            failure = str(error)
    found: dict[str, Iterable[Finding]] = {"way out": way_out[1]}
    if measured is not None:
        found["path"] = _describe_paths(trial.paths, link)
        found["link"] = _describe_link(measured, trial.priority)
        found["settings"] = recommend(measured, configuration)
    elif not (configuration.finds_path and any(each.check == "udp" for each in way_out[1])):  # it says why already
        ping = "" if configuration.finds_path else f"; from here: ping {split_address(link.slave)[0]}"
        found["link"] = [problem(failure or "", f"on the robot's host: weberlink slave FILE{ping}", "session")]
    document = {
        **way_out[0],
        "paths": trial.paths,
        "link": None if measured is None else asdict(measured),
        **({} if failure is None else {"failure": failure}),
    }
    findings = [replace(each, area=area) for area, group in found.items() for each in group]
    return DoctorReport(Needs(configuration.system, [MASTER], configuration.path), findings, document)


def _describe_paths(paths: Iterable[Mapping[str, Any]], link: LinkSettings) -> Iterator[Finding]:
    """The paths that the session used, and the class of service that arrived."""
    for path in paths:
        by = f" by {path['via']}" if path["via"] else ""
        over = f" over {path['interface']}" if path["interface"] else ""
        yield ok(f"{path['route']}{by}{over}, to {path['remote']}", f"path {path['place']}")
        if (arrived := path.get("dscp")) is not None:
            asked = ", as asked" if arrived == link.dscp else f"; the file asks for {link.dscp}"
            yield ok(f"the slave's datagrams arrive with class of service {arrived}{asked}", "dscp")


# --- figures


@dataclass(frozen=True, slots=True)
class Way:
    """One direction of a link."""

    delay_ms: float  # median; the split of the round trip takes the fastest datagrams of both ways as equally fast
    late_p99_ms: float  # by how much 1 % of the datagrams exceed the least delay
    loss: float  # share of datagrams, 0..1
    burst: float  # mean number of datagrams lost in a row; 0 without losses
    longest_burst: int

    @classmethod
    def of(cls, delays: Sequence[float], runs: Sequence[int], sent: int) -> "Way":
        """From the delays of those that came [s], and the runs of those lost of so many sent."""
        late, lost = nearest_rank(delays, 0.99) - min(delays), sum(runs)
        loss, burst = lost / sent if sent else 0.0, lost / len(runs) if runs else 0.0
        return cls(1e3 * nearest_rank(delays, 0.5), 1e3 * late, loss, burst, max(runs, default=0))


@dataclass(frozen=True, slots=True)
class Times:
    """The least, the median, the 99th percentile and the largest."""

    min: float
    p50: float
    p99: float
    max: float

    @classmethod
    def of(cls, times: Sequence[float]) -> "Times":
        """In ms, of times in s."""
        values = [1e3 * time for time in times]
        return cls(min(values), nearest_rank(values, 0.5), nearest_rank(values, 0.99), max(values))


@dataclass(frozen=True, slots=True)
class LinkFigures:
    """Figures of both directions."""

    questions: int
    answers: int
    seconds: float  # from the first question to the last
    silences: int  # how often the session fell silent
    rtt_ms: Times
    jitter_ms: Times  # as the endpoint measured it, over the time
    loop_age_ms: float  # the largest, which silence limit and round trip bound (`weberlink.protocol.liveness`)
    to_slave: Way
    to_master: Way


def figures(trial: LinkTrial) -> LinkFigures:
    """Compute the figures. Raises ValueError if no question was answered."""
    asked, heard = trial.asked, trial.heard
    answered = {each.question: each for each in heard if each.question is not None}
    timed = [(each.at - asked[question], each.delay) for question, each in answered.items() if each.delay is not None]
    if not timed:
        raise ValueError("the slave answered no question")
    trips, inward = [trip for trip, _ in timed], [delay for _, delay in timed]
    outward = [max(0.0, trip - delay) for trip, delay in timed]
    # The loop age counts from the first answer to the last; questions 5 ms apart add theirs.
    loop_age, newest = 0.0, None
    for each in heard:
        if each.question is not None:
            loop_age = loop_age if newest is None else max(loop_age, each.at - newest)
            newest = max(newest or 0.0, asked[each.question])
    return LinkFigures(
        questions=len(asked),
        answers=len(answered),
        seconds=asked[-1] - asked[0],
        silences=trial.silences,
        rtt_ms=Times.of(trips),
        jitter_ms=Times.of(trial.jitters or [0.0]),
        loop_age_ms=1e3 * loop_age,
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


def _describe_link(link: LinkFigures, priority: str) -> Iterator[Finding]:
    """The figures of the link, in words."""
    trip = link.rtt_ms
    yield ok(
        f"round trip {trip.p50:.1f} ms; at least {trip.min:.1f}, 99 % below {trip.p99:.1f}, at most {trip.max:.1f} "
        f"({link.answers} of {link.questions} questions in {link.seconds:.1f} s were answered; measured {priority})",
        "round trip",
    )
    for check, way in (("to the slave", link.to_slave), ("from the slave", link.to_master)):
        lost = "no loss"
        if way.loss > 0.0:
            lost = f"loss {100 * way.loss:.1f} %, {way.burst:.1f} in a row on average, at most {way.longest_burst}"
        yield ok(f"{check} {way.delay_ms:.1f} ms, 1 % more than {way.late_p99_ms:.1f} ms late; {lost}", check)
    yield ok("each way is given half of the least round trip; only synchronous clocks could tell more", "clocks")


# --- settings that a measured link calls for


def recommend(figures: LinkFigures, configuration: Configuration) -> Iterator[Finding]:
    """Judge the settings of a file by a measurement: its two limits, control scheme, play-out and look-ahead."""
    system = configuration.system
    link, scheme, round_trip = system.link, system.control.scheme, 1e-3 * figures.rtt_ms.p50

    check, allowed_ms = "longest round trip", link.longest_round_trip_ms
    needed_ms = in_ms(_needed_round_trip(figures, system.tick_period))
    why = f"99 % of the round trips take at most {figures.rtt_ms.p99:.1f} ms"
    if needed_ms > 1e3 * LONGEST:
        yield problem(f"no session is possible: {why}", ELSEWHERE, check)
    elif needed_ms <= allowed_ms:
        yield ok(f"longest round trip: {allowed_ms:g} ms are enough: {why}", check)
    else:
        found = f"longest round trip: {allowed_ms:g} ms are too short: {why}; on both hosts:"
        yield problem(found, f"--set link.longest_round_trip_ms={needed_ms}", check)

    yield _silence(figures, system)
    said = uncontrolled_delay(DryRun(configuration), round_trip)
    if said is None:
        yield ok(f"control scheme {scheme}: round trip {1e3 * round_trip:.1f} ms", "control scheme")
    else:
        yield advice(f"{said}; on both hosts:", "--set control.scheme=bounded", "control scheme")

    late_ms = max(figures.to_slave.late_p99_ms, figures.to_master.late_p99_ms)
    found = f"play-out {link.playout_ms:g} ms: 1 % of the datagrams are more than {late_ms:.1f} ms late"
    if link.playout_ms == 0.0:
        yield ok(found, "play-out")
    else:  # docs/anywhere/link.md
        found += "; it adds more to the error of the force than it hides"
        yield advice(found, "--set link.playout_ms=0", "play-out")

    if system.codec.joints is None:
        yield from _lookahead(configuration)


def _silence(figures: LinkFigures, system: System) -> Finding:
    """Whether the silence limit is long enough for this link, or how long it must be."""
    check, limit_ms = "silence limit", system.link.silence_ms
    losses, longest = silence_needs(figures, system.tick_period)
    needed_ms = SILENCE_STEP_MS * ceil(1e3 * max(losses, longest) / SILENCE_STEP_MS - 1e-9)
    why = (
        f"losses ask for {1e3 * losses:.0f} ms, the longest time without an answer, beside the round trip, was "
        f"{1e3 * longest:.0f} ms"
    )
    if needed_ms > 1e3 * LONGEST_SILENCE:
        return problem(f"no silence limit is long enough: {why}", ELSEWHERE, check)
    if limit_ms >= needed_ms:
        return ok(f"silence limit: {limit_ms:g} ms are enough: {why}", check)
    found = f"silence limit: {limit_ms:g} ms are too short: {why}; on both hosts:"
    grade = advice if figures.silences == 0 and longest < 1e-3 * limit_ms else problem
    return grade(found, f"--set link.silence_ms={needed_ms}", check)


def _lookahead(configuration: Configuration) -> Iterator[Finding]:
    """Whether the look-ahead of the file suits its control scheme (docs/prediction.md)."""
    uncontrolled, delays = added_delays(DryRun(configuration)), configuration.system.delays_ms
    used = {field: ms for field, ms in delays.items() if field != "link.playout_ms" and ms > 0.0}
    if not used:
        yield ok("look-ahead 0 ms", "look-ahead")
    for field, ms in used.items():
        if field in uncontrolled:
            yield advice(f"{uncontrolled[field]}; on both hosts:", f"--set {field}=0", "look-ahead")
        else:
            yield ok(f"{field} {ms:g}: it saves some updates, and adds its delay", "look-ahead")


def _needed_round_trip(figures: LinkFigures, tick_period: float) -> float:
    """The round trip that a session on this link agrees on [s]."""
    return rounded_up(1e-3 * figures.rtt_ms.p99 + 2.0 * tick_period)


def silence_needs(figures: LinkFigures, tick_period: float) -> tuple[float, float]:
    """Least silence limits [s]: that for which heartbeats can be dense enough that losses hardly ever cause a silence,
    and the largest loop age of the measurement without the round trip."""
    loss, round_trip = (figures.to_slave.loss, figures.to_master.loss), _needed_round_trip(figures, tick_period)
    longest = max(0.0, 1e-3 * figures.loop_age_ms - round_trip)
    for step in range(1, round(1e3 * LONGEST_SILENCE / SILENCE_STEP_MS) + 1):
        limit = 1e-3 * SILENCE_STEP_MS * step
        liveness = Liveness(0.0, limit, 0.0, 0.0)
        schedule = HeartbeatSchedule(liveness, 0.0, tick_period)
        schedule.adapt(*loss, LONGEST_RTT, 0.0)
        densest = schedule.max_echo_age
        liveness.agree(round_trip, 0.0)
        schedule.adapt(*loss, 1e-3 * figures.rtt_ms.p50, 1e-3 * figures.jitter_ms.p99)
        if schedule.max_echo_age > densest:  # else it would need more heartbeats than it may send
            return limit, longest
    return 2.0 * LONGEST_SILENCE, longest
