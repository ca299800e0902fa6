"""The verdict of a session: one word, and the causes in words, each from a figure of its report.

`good`: the operator felt what the robot touched. `degraded`: the session ended in order, but something disturbed it.
`failed`: it did not do what was asked of it; the exit status is then 1. docs/glossary.md lists the causes.
"""

from collections.abc import Iterator
from typing import Any

from weberlink.config import MASTER, SLAVE
from weberlink.session.ending import UNCONNECTED, WAITING, failures, longest_wait, times
from weberlink.session.report import Facts
from weberlink_figures.tree import DEGRADED, FAILURE, GOOD, Cause, Figures, Verdict

AWAY_S = 1.0  # a master without the slave for so long after its goodbye is degraded [s]; less is an orderly end of both
MISSED_SHARE = 0.01
"""Share of missed ticks. Each holds the force for one period more; 1 % lies below the updates of a quiet session."""
FORCE_SHARE = 0.01
"""Share of the engaged ticks at the force limit, in which the operator feels less than the robot touches."""
FELT_SHARE = 0.05
"""Share of ticks outside the deadband, beyond the delay's; without delay and loss the shipped scenes stay below."""
DELAY_SHARE = 0.05  # share of ticks outside the deadband that the delay alone explains
LOSS_SHARE = 0.05  # share of lost datagrams; updates are repeated, so that single losses are not felt
LOSS_COUNT = 20  # fewer lost datagrams say nothing about a share


def verdict(figures: Figures) -> Verdict:
    """Judge a session by its figures, of a running one too."""
    failed = failures(_facts(figures), figures.connection)
    found = {name: Cause(FAILURE, name, text) for name, text in failed.items()}
    for judge in (_connection, _recording, _ticks, _faults, _force, _energy_and_loss):
        for cause in judge(figures):
            found.setdefault(cause.name, cause)
    causes = tuple(found.values())
    return Verdict(causes[0].level if causes else GOOD, causes)


def _facts(figures: Figures) -> Any:
    """As `Facts`; None where unknown."""
    return {name: getattr(figures, name, None) for name in Facts.__annotations__}


def _connection(figures: Figures) -> Iterator[Cause]:
    """How well the two sides kept each other."""
    sides = {side: each for side, each in figures.connection.items() if each is not None}
    alone = sides.get(SLAVE) if MASTER not in sides else None
    if alone is not None and alone.ended == WAITING and alone.waited_s > longest_wait(_facts(figures)):
        yield Cause(DEGRADED, "no_call", f"no master called in {alone.waited_s:.1f} s")
    longest = max(sides.values(), key=lambda each: each.unconnected_s, default=None)
    if longest is not None and longest.unconnected_s > longest.last_s * (longest.ended == UNCONNECTED):
        count = longest.interruptions
        text = f"unconnected for {longest.unconnected_s:.1f} s" + (f" in {count} interruptions" * (count > 1))
        yield Cause(DEGRADED, "unconnected", text)
    away = sides[MASTER].away_s if MASTER in sides else 0.0
    if away >= AWAY_S:
        farewell = figures.known_of_peer(MASTER, "farewell")
        why = f" ({farewell})" if farewell else ""
        yield Cause(DEGRADED, "away", f"the slave left{why}, {away:.1f} s without it")


def _recording(figures: Figures) -> Iterator[Cause]:
    if lost := sum((figures.recording or {}).get("lost", {}).values()):
        yield Cause(DEGRADED, "recording", f"the recording lacks {lost} records")


def _ticks(figures: Figures) -> Iterator[Cause]:
    """Missed ticks, and which of them the host took."""
    for side, ticks in figures.ticks.items():
        if not ticks.count and figures.known_of_peer(side, "name"):
            yield Cause(
                DEGRADED, "no_figures", f"the figures of the {side} are missing: its telemetry was read too late"
            )
    missed = sum(ticks.missed for ticks in figures.ticks.values())
    due = missed + sum(ticks.count for ticks in figures.ticks.values())
    if not due or missed < MISSED_SHARE * due:
        return
    text = f"{percent(missed / due)} of ticks missed"
    host = figures.host
    if host is not None:
        if host["missed"] is None:
            text += f" (host not watched: {host['unknown']})"
        else:
            text += f", of which the host took {percent(sum(host['missed'].values()) / missed, 0)}"
        text += "" if host["steal"] is None else f", steal {percent(host['steal'])}"
    yield Cause(DEGRADED, "missed_ticks", text)


def _faults(figures: Figures) -> Iterator[Cause]:
    faults = figures.faults
    stalled = {side: counts["stalled"] for side, counts in faults.items() if counts.get("stalled")}
    if stalled:
        longest = max(figures.ticks[side].missed_longest_s for side in stalled)
        who = " and ".join(f"the {side} {times(count)}" for side, count in stalled.items())
        yield Cause(DEGRADED, "stalled", f"a process stood still: {who}, for up to {longest:.2f} s")
    if tripped := faults.get(SLAVE, {}).get("tripped"):
        limit = "joints.trip_nm" if figures.is_arm else "trip_n"
        text = f"the robot backed off from a contact {times(tripped)} (slave.limits.{limit})"
        yield Cause(DEGRADED, "tripped", text)
    if wrong := sum(counts.get("update", 0) for counts in faults.values()):
        yield Cause(DEGRADED, "update", f"{wrong} updates did not fit their channel")


def _force(figures: Figures) -> Iterator[Cause]:
    """What the limit of force, delay and codec did to the force that the operator felt."""
    limited, moved = figures.limited.force_ticks, "joint_angle" if figures.is_arm else "position"
    engaged = figures.channels[moved].samples
    if engaged and limited >= FORCE_SHARE * engaged:
        what, where = ("torque", "joints.torque_nm") if figures.is_arm else ("force", "force_n")
        text = f"{what} limited in {percent(limited / engaged)} of ticks (master.limits.{where})"
        yield Cause(DEGRADED, "force_limited", text)
    outside, felt = figures.felt.errors.violation_fraction, figures.felt.felt
    explained = (felt and felt.violation_floor) or 0.0
    if outside is None:
        return
    if outside - explained > FELT_SHARE:
        text = f"felt error outside the deadband in {percent(outside)} of ticks"
        yield Cause(DEGRADED, "felt", f"{text} ({percent(explained)} explained by delay)")
    elif min(outside, explained) > DELAY_SHARE:
        text = f"delay put the felt error outside the deadband in {percent(outside)} of ticks"
        yield Cause(DEGRADED, "delay", text)


def _energy_and_loss(figures: Figures) -> Iterator[Cause]:
    """Whether the accounts held, and the datagrams arrived."""
    share, link = figures.energy.bound_share, figures.link
    if share is not None and share > 1.0:
        yield Cause(DEGRADED, "bound", f"{percent(share, 0)} of the energy that may come out at the hand came out")
    due = link.lost + link.received
    if link.lost >= LOSS_COUNT and link.lost >= LOSS_SHARE * due:
        yield Cause(DEGRADED, "loss", f"{percent(link.lost / due)} of datagrams lost")


def percent(share: float | None, digits: int = 1) -> str:
    return "-" if share is None else f"{100.0 * share:.{digits}f} %"
