"""The verdict of a session: one word, and the causes in words, each from a figure of its report.

`good`: the operator felt what the robot touched. `degraded`: the session ended in order, but something disturbed it.
`failed`: it did not do what was asked of it; the exit status is then 1. docs/glossary.md lists the causes.
"""

from collections.abc import Iterator

from weberlink.config.model import is_placeholder, split_address
from weberlink.figures.tree import DEGRADED, FAILURE, GOOD, Cause, Figures, Verdict
from weberlink.order import EMERGENCY, MASTER, SLAVE
from weberlink.protocol.paths import finding

FAILED_OUTCOME = "failed: "  # how the outcome of a failed run begins; the reason follows

WAIT_S = 1.0
"""A run without a session that ends later than this has failed [s]: a slave that is there answers within 0.1 s."""
CALL_S = 3.0  # the same while it runs [s]: the slave may be about to start
LOST_S = 1.0
"""A peer that was not heard for so long at the end was lost [s]; a goodbye may be lost too, and that shows earlier."""
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

_ENDINGS = (
    ("device", "device fault"),
    ("device", "leader arm fault"),
    ("robot", "robot fault"),
    ("robot", "follower arm fault"),
    ("refused", "refused"),
    ("taken_over", "taken over"),
    ("no_answer", "the slave did not answer"),
    ("killed", "killed by"),
)
"""Name of the cause and the words that tell it, in the reason of a failed run."""
PLACEHOLDER = "a placeholder of the file, which no host has"
_QUESTIONS = "is it running there, is the address right, are the keys the same on both hosts?"
_PEERS = {MASTER: SLAVE, SLAVE: MASTER}


def verdict(figures: Figures) -> Verdict:
    """Judge a session by its figures, of a running one too."""
    found: dict[str, Cause] = {}
    for judge in (_connection, _ending, _recording, _ticks, _faults, _force, _energy_and_loss):
        for cause in judge(figures):
            found.setdefault(cause.name, cause)
    causes = tuple(sorted(found.values(), key=lambda cause: cause.level != FAILURE))
    return Verdict(causes[0].level if causes else GOOD, causes)


def _connection(figures: Figures) -> Iterator[Cause]:
    """Whether the two sides found, heard and kept each other."""
    sides = {side: each for side, each in figures.connection.items() if each is not None}
    # Where the peer of the slave ended in order, only its farewell was lost; that is known of the master alone.
    has_left = figures.outcome is not None and not figures.outcome.startswith(FAILED_OUTCOME) and MASTER in sides
    for side, each in sides.items():
        if each.ended == "waiting":
            yield from _never(figures, side, each.waited_s)
        elif each.ended == "unconnected" and each.last_s >= LOST_S and not (side == SLAVE and has_left):
            yield Cause(FAILURE, "lost", f"the {_PEERS[side]} was lost: not heard for the last {each.last_s:.1f} s")
    longest = max(sides.values(), key=lambda each: each.unconnected_s, default=None)
    if longest is not None and longest.unconnected_s > longest.last_s * (longest.ended == "unconnected"):
        times = longest.interruptions
        text = f"unconnected for {longest.unconnected_s:.1f} s" + (f" in {times} interruptions" * (times > 1))
        yield Cause(DEGRADED, "unconnected", text)
    away = sides[MASTER].away_s if MASTER in sides else 0.0
    if away >= AWAY_S:
        farewell = figures.known_of_peer(MASTER, "farewell")
        why = f" ({farewell})" if farewell else ""
        yield Cause(DEGRADED, "away", f"the slave left{why}, {away:.1f} s without it")


def _never(figures: Figures, side: str, waited: float) -> Iterator[Cause]:
    """A side that had no session at all."""
    faults, drops = ((counts or {}).get(side, {}) for counts in (figures.faults, figures.drops))
    limit = CALL_S if figures.outcome is None else WAIT_S
    refusal = figures.known_of_peer(side, "refusal")
    note = finding((figures.paths or {}).get(MASTER, ()))
    is_told = bool(note) and note in str(figures.outcome)  # why there was no path
    if faults.get("unproven") or drops.get("unproven"):
        caller = "a call" if side == SLAVE else "the answer"
        yield Cause(FAILURE, "key", f"{caller} did not prove the key: are the keys the same on both hosts?")
    elif refusal or faults.get("refused"):
        yield Cause(FAILURE, "refused", f"refused: {refusal}" if refusal else "a call was refused")
    elif waited > limit and side == MASTER and not is_told:
        yield Cause(FAILURE, "no_answer", _unanswered(figures, f"the slave did not answer in {waited:.1f} s"))
    elif waited > limit and figures.connection.get(MASTER) is None:
        yield Cause(DEGRADED, "no_call", f"no master called in {waited:.1f} s")


def _unanswered(figures: Figures, text: str) -> str:
    """With the address, and what a person can look at: a slave does not answer a call that proves no key.

    Without a path to the slave, what is known of that instead.
    """
    if note := finding((figures.paths or {}).get(MASTER, ())):
        return f"{text}: {note}"
    at = (figures.addresses or {}).get("slave")
    if at and is_placeholder(split_address(at)[0]):
        return f"{text} at {at}, {PLACEHOLDER}: set link.slave to the robot's address"
    return f"{text}{f' at {at}' if at else ''}: {_QUESTIONS}"


def _ending(figures: Figures) -> Iterator[Cause]:
    """The reason of a run that failed; its own words."""
    outcome = figures.outcome or ""
    reason = outcome.removeprefix(FAILED_OUTCOME)
    if EMERGENCY in outcome:
        whose = outcome.partition(EMERGENCY)[2]  # " by NAME" where a name is known
        yield Cause(FAILURE, "emergency_stop", f"of an emergency stop{whose}")
    elif reason != outcome:
        name = next((name for name, words in _ENDINGS if words in reason), "ended")
        yield Cause(FAILURE, name, _unanswered(figures, reason) if name == "no_answer" else reason)


def _recording(figures: Figures) -> Iterator[Cause]:
    facts = figures.recording or {}
    outcome = facts.get("outcome", "complete" if facts.get("running", True) else "the recorder has ended")
    if outcome != "complete":
        kept = f"; {facts['bytes'] / 1e3:.0f} kB kept" if facts.get("bytes") else ""
        yield Cause(FAILURE, "recording", f"the recording failed: {outcome}{kept}")
    elif lost := sum(facts.get("lost", {}).values()):
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
        who = " and ".join(f"the {side} {_times(count)}" for side, count in stalled.items())
        yield Cause(DEGRADED, "stalled", f"a process stood still: {who}, for up to {longest:.2f} s")
    if unfounded := faults.get(MASTER, {}).get("unfounded"):
        yield Cause(FAILURE, "unfounded", f"force without a contact was faded out {_times(unfounded)}")
    if tripped := faults.get(SLAVE, {}).get("tripped"):
        limit = "joints.trip_nm" if figures.is_arm else "trip_n"
        text = f"the robot backed off from a contact {_times(tripped)} (slave.limits.{limit})"
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


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def percent(share: float | None, digits: int = 1) -> str:
    return "-" if share is None else f"{100.0 * share:.{digits}f} %"
