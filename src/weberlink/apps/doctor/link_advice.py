"""Settings that a measured link calls for, as findings: its two limits, control scheme, play-out and look-ahead.

Every threshold is one by which a session itself decides (`weberlink.protocol.heartbeat`, `weberlink.control.auto`).
What both ends must hold alike has to be set on both hosts.
"""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple

from weberlink.apps.doctor.findings import Finding, advice, ok, problem
from weberlink.apps.doctor.link_figures import LinkFigures
from weberlink.control.auto import MMT, NONE, ORDER, RISING, TDPA, SchemeChoice
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.round_trip import LONGEST, in_ms, rounded_up
from weberlink.protocol.session import LONGEST_SILENCE
from weberlink.protocol.timing import LONGEST_RTT
from weberlink.system.advice import allowed_schemes, fits_a_surface
from weberlink.system.composition.link import AUTO
from weberlink.system.configuration import System

SILENCE_STEP_MS = 10
LONGEST_PLAYOUT_MS = 100.0
"""Of `link.playout_ms`."""
Delays = Sequence[tuple[float, float, float]]
"""(at, round trip, jitter) [s], in order."""


def recommend(figures: LinkFigures, delays: Delays, system: System) -> Iterator[Finding]:
    """Judge the settings of a file by a measurement."""
    course = scheme_course(delays)
    yield longest_round_trip(figures, system)
    yield silence(figures, system)
    yield from scheme(figures, course, system)
    yield playout(figures, course[-1], system)
    yield from lookahead(course[-1], system)


# --- the two limits of the link


def needed_round_trip(figures: LinkFigures, tick_period: float) -> float:
    """The round trip that a session on this link agrees on [s]."""
    return rounded_up(figures.rtt_s[2] + 2.0 * tick_period)


def longest_round_trip(figures: LinkFigures, system: System) -> Finding:
    """Whether a session on this link is allowed its round trip."""
    check, allowed_ms = "longest round trip", system.link.longest_round_trip_ms
    needed_ms = in_ms(needed_round_trip(figures, system.tick_period))
    why = f"99 % of the round trips take at most {1e3 * figures.rtt_s[2]:.1f} ms"
    if needed_ms > 1e3 * LONGEST:
        return problem(f"no session is possible: {why}", "use another network", check)
    if needed_ms <= allowed_ms:
        return ok(f"longest round trip: {allowed_ms:g} ms are enough: {why}", check)
    found = f"longest round trip: {allowed_ms:g} ms are too short: {why}; on both hosts:"
    return problem(found, f"--set link.longest_round_trip_ms={needed_ms}", check)


def silence(figures: LinkFigures, system: System) -> Finding:
    """Whether the silence limit is long enough for this link, or how long it must be."""
    check, limit_ms = "silence limit", system.link.silence_ms
    needs = silence_needs(figures, system.tick_period)
    needed_ms = SILENCE_STEP_MS * ceil(1e3 * max(needs) / SILENCE_STEP_MS - 1e-9)
    why = (
        f"losses ask for {1e3 * needs.losses:.0f} ms, the longest time without an answer, beside the round trip, was "
        f"{1e3 * needs.longest:.0f} ms"
    )
    if needed_ms > 1e3 * LONGEST_SILENCE:
        return problem(f"no silence limit is long enough: {why}", "use another network", check)
    if limit_ms >= needed_ms:
        return ok(f"silence limit: {limit_ms:g} ms are enough: {why}", check)
    found = f"silence limit: {limit_ms:g} ms are too short: {why}; on both hosts:"
    is_met = figures.silences == 0 and needs.longest < 1e-3 * limit_ms
    return (advice if is_met else problem)(found, f"--set link.silence_ms={needed_ms}", check)


class SilenceNeeds(NamedTuple):
    """Least silence limits [s].

    Args:
        losses: for which heartbeats can be dense enough that losses hardly ever cause a silence.
        longest: the largest loop age of the measurement, without the round trip.
    """

    losses: float
    longest: float


def silence_needs(figures: LinkFigures, tick_period: float) -> SilenceNeeds:
    return SilenceNeeds(
        _least_silence(figures, tick_period),
        max(0.0, figures.loop_age_s - needed_round_trip(figures, tick_period)),
    )


def _least_silence(figures: LinkFigures, tick_period: float) -> float:
    """The shortest limit, in steps, for which heartbeats may be less dense than on a hopeless path [s]."""
    loss = figures.to_slave.loss, figures.to_master.loss
    round_trip = needed_round_trip(figures, tick_period)
    for step in range(1, round(1e3 * LONGEST_SILENCE / SILENCE_STEP_MS) + 1):
        limit = 1e-3 * SILENCE_STEP_MS * step
        schedule = HeartbeatSchedule(0.0, silence=limit, tick_period=tick_period)
        schedule.adapt(*loss, LONGEST_RTT, 0.0, 0.0)
        densest = schedule.reach
        schedule.adapt(*loss, figures.rtt_s[1], figures.jitter_s[1], round_trip)
        if schedule.reach > densest:  # else it would need more heartbeats than it may send
            return limit
    return 2.0 * LONGEST_SILENCE


# --- control scheme


class _Quality(NamedTuple):
    rtt: float
    jitter: float


def scheme_course(delays: Delays) -> list[int]:
    """The schemes that `auto` would go through on this link in free space, as indices of `ORDER`."""
    choice, course = SchemeChoice(), [TDPA]
    before = delays[0][0] if delays else 0.0
    for at, rtt, jitter in delays:
        chosen = choice.follow(course[-1], _Quality(rtt, jitter), at - before, touches=False, in_debt=False)
        before = at
        if chosen != course[-1]:
            course.append(chosen)
    return course


def scheme(figures: LinkFigures, course: Sequence[int], system: System) -> Iterator[Finding]:
    """Whether the control scheme suits the delay, for which `auto` went through those of `course`."""
    check, configured = "control scheme", system.control.scheme
    fitting, allowed = ORDER[course[-1]], allowed_schemes(system)
    wanted = next(name for name in reversed(ORDER[: course[-1] + 1]) if name in allowed)
    why = _why(figures, course)
    is_changing = len(course) > 2
    if wanted != fitting:
        why += f", which calls for {fitting}; but with {_what_limits(system)} there is only {' or '.join(allowed)}"
    if configured not in ORDER or (is_changing and AUTO not in allowed):
        yield ok(f"control scheme {configured}; auto would now choose {fitting}: {why}", check)
    elif is_changing:
        yield advice(
            f"control scheme {configured}, but the delay changes: {why}; on both hosts:",
            "--set control.scheme=auto",
            check,
        )
    elif configured == wanted:
        yield ok(f"control scheme {configured}: {why}", check)
    else:
        found = f"control scheme {configured}, but {wanted} suits: {why}; on both hosts:"
        yield advice(found, f"--set control.scheme={wanted}", check)
    if wanted == ORDER[MMT] and not fits_a_surface(system):
        found = f"{system.codec.force.predictor} fits no surface, which mmt needs; on both hosts:"
        yield advice(found, "--set codec.force.predictor=hybrid", "predictor")


def _what_limits(system: System) -> str:
    return "codec.joints" if system.codec.joints is not None else "codec.rotation"


def _why(figures: LinkFigures, course: Sequence[int]) -> str:
    trip, jitter = 1e3 * figures.rtt_s[1], 1e3 * figures.jitter_s[0]
    limits = f"{1e3 * RISING[NONE]:g} ms (none) and {1e3 * RISING[TDPA]:g} ms (tdpa)"
    text = f"round trip {trip:.1f} ms, jitter {jitter:.1f} ms; the limits are {limits}"
    return text if len(course) <= 2 else f"{text}; auto went {', '.join(ORDER[each] for each in course)}"


# --- play-out and look-ahead


def playout(figures: LinkFigures, fitting: int, system: System) -> Finding:
    """How long samples must wait so that 99 % of the jitter is not felt, and whether that pays.

    Args:
        fitting: the scheme for this link, as an index of `ORDER`.
    """
    check, configured = "play-out", system.link.playout_ms
    late_ms = 1e3 * max(figures.to_slave.late_s, figures.to_master.late_s)
    found = f"play-out {configured:g} ms: 1 % of the datagrams are more than {late_ms:.1f} ms late"
    needed = float(ceil(late_ms))
    if late_ms < 1e3 * system.tick_period:
        found += ", less than a tick"
        return advice(found, "--set link.playout_ms=0", check) if configured > 0.0 else ok(found, check)
    if configured >= needed:
        return ok(found, check)
    delay = figures.rtt_s[0] + 2e-3 * needed
    after = sum(delay > limit for limit in RISING)
    if fitting == NONE:
        return ok(f"{found}; with none, play-out is one more delay, and nothing controls it", check)
    if fitting == MMT:
        return ok(f"{found}; the local model of mmt hides that", check)
    if needed > LONGEST_PLAYOUT_MS or after > fitting:
        return ok(f"{found}; to hide that would make a delay of {1e3 * delay:.0f} ms, for {ORDER[after]}", check)
    found += f"; hidden, the delay is {1e3 * delay:.0f} ms, still for {ORDER[fitting]}"
    return advice(found, f"--set link.playout_ms={needed:g}", check)


def lookahead(fitting: int, system: System) -> Iterator[Finding]:
    """Whether the look-ahead of the file suits the scheme for this link (docs/prediction.md)."""
    check = "look-ahead"
    if system.codec.joints is not None:
        return
    used = {name: getattr(system.codec, name).lookahead_ms for name in ("force", "position")}
    needless = [
        name for name, ms in used.items() if ms > 0.0 and (fitting == NONE or (fitting, name) == (MMT, "force"))
    ]
    for name in needless:
        found = f"look-ahead of {name} {used[name]:g} ms: {_LOOKAHEAD_NOTES[fitting]}; on both hosts:"
        yield advice(found, f"--set codec.{name}.lookahead_ms=0", check)
    if not needless:
        text = ", ".join(f"{name} {ms:g} ms" for name, ms in used.items() if ms > 0.0) or "0 ms"
        yield ok(f"look-ahead {text}: {_LOOKAHEAD_NOTES[fitting]}", check)


_LOOKAHEAD_NOTES = (
    "with none it is one more delay, and nothing controls it",
    "with tdpa, 10 ms save about a third of the few updates of predictor adaptive",
    "with mmt it saves no updates",
)
"""By scheme, in the order of `ORDER`."""
