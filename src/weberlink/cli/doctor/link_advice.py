"""Settings that a measured link calls for, as findings: its two limits, control scheme, play-out and look-ahead.

Every threshold is one by which a session itself decides (`weberlink.protocol.liveness`), or by which `check` warns
(`weberlink.session.advice`). What both ends must hold alike has to be set on both hosts.
"""

from collections.abc import Iterator
from math import ceil

from weberlink.cli.doctor.link_figures import LinkFigures
from weberlink.cli.doctor.report import Finding, advice, ok, problem
from weberlink.config import Configuration, System
from weberlink.protocol.liveness import HeartbeatSchedule
from weberlink.protocol.negotiation import LONGEST, in_ms, rounded_up
from weberlink.protocol.session import LONGEST_SILENCE
from weberlink.protocol.timing import LONGEST_RTT
from weberlink.session.advice import Parts, uncontrolled_delay

SILENCE_STEP_MS = 10


def recommend(figures: LinkFigures, configuration: Configuration) -> Iterator[Finding]:
    """Judge the settings of a file by a measurement."""
    system = configuration.system
    yield longest_round_trip(figures, system)
    yield silence(figures, system)
    scheme, round_trip = system.control.scheme, figures.rtt_s[1]
    said = uncontrolled_delay(Parts(configuration), round_trip)
    if said is None:
        yield ok(f"control scheme {scheme}: round trip {1e3 * round_trip:.1f} ms", "control scheme")
    else:
        yield advice(f"{said}; on both hosts:", "--set control.scheme=bounded", "control scheme")
    playout_ms = system.link.playout_ms
    late_ms = 1e3 * max(figures.to_slave.late_s, figures.to_master.late_s)
    found = f"play-out {playout_ms:g} ms: 1 % of the datagrams are more than {late_ms:.1f} ms late"
    if playout_ms == 0.0:
        yield ok(found, "play-out")
    else:  # docs/anywhere/link.md
        found += "; it adds more to the error of the force than it hides"
        yield advice(found, "--set link.playout_ms=0", "play-out")
    if system.codec.joints is None:
        yield from lookahead(system)


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
    losses, longest = silence_needs(figures, system.tick_period)
    needed_ms = SILENCE_STEP_MS * ceil(1e3 * max(losses, longest) / SILENCE_STEP_MS - 1e-9)
    why = (
        f"losses ask for {1e3 * losses:.0f} ms, the longest time without an answer, beside the round trip, was "
        f"{1e3 * longest:.0f} ms"
    )
    if needed_ms > 1e3 * LONGEST_SILENCE:
        return problem(f"no silence limit is long enough: {why}", "use another network", check)
    if limit_ms >= needed_ms:
        return ok(f"silence limit: {limit_ms:g} ms are enough: {why}", check)
    found = f"silence limit: {limit_ms:g} ms are too short: {why}; on both hosts:"
    grade = advice if figures.silences == 0 and longest < 1e-3 * limit_ms else problem
    return grade(found, f"--set link.silence_ms={needed_ms}", check)


def silence_needs(figures: LinkFigures, tick_period: float) -> tuple[float, float]:
    """Least silence limits [s].

    Returns:
        That for which heartbeats can be dense enough that losses hardly ever cause a silence, and the largest loop age
        of the measurement without the round trip.
    """
    loss, round_trip = (figures.to_slave.loss, figures.to_master.loss), needed_round_trip(figures, tick_period)
    longest = max(0.0, figures.loop_age_s - round_trip)
    for step in range(1, round(1e3 * LONGEST_SILENCE / SILENCE_STEP_MS) + 1):
        limit = 1e-3 * SILENCE_STEP_MS * step
        schedule = HeartbeatSchedule(0.0, silence=limit, tick_period=tick_period)
        schedule.adapt(*loss, LONGEST_RTT, 0.0, 0.0)
        densest = schedule.max_echo_age
        schedule.adapt(*loss, figures.rtt_s[1], figures.jitter_s[1], round_trip)
        if schedule.max_echo_age > densest:  # else it would need more heartbeats than it may send
            return limit, longest
    return 2.0 * LONGEST_SILENCE, longest


def lookahead(system: System) -> Iterator[Finding]:
    """Whether the look-ahead of the file suits its control scheme (docs/prediction.md)."""
    used = {name: getattr(system.codec, name).lookahead_ms for name in ("force", "position")}
    used = {name: ms for name, ms in used.items() if ms > 0.0}
    if not used:
        yield ok("look-ahead 0 ms", "look-ahead")
    elif system.control.scheme != "none":
        text = ", ".join(f"{name} {ms:g} ms" for name, ms in used.items())
        yield ok(f"look-ahead {text}; it saves some updates, and adds its delay", "look-ahead")
    else:
        for name, ms in used.items():
            found = f"look-ahead of {name} {ms:g} ms: one more delay, and nothing controls it; on both hosts:"
            yield advice(found, f"--set codec.{name}.lookahead_ms=0", "look-ahead")
