"""The verdict of a session: one word, and the causes in words, each from a figure of its report.

`good`: the operator felt what the robot touched. `degraded`: the session ended in order, but something disturbed it.
`failed`: it did not do what was asked of it; the exit status is then 1. docs/glossary.md lists the causes.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from weberlink.config.model import is_placeholder, split_address
from weberlink.figures.paths import finding
from weberlink.order import COMPLETED, EMERGENCY, FAILED, MASTER, SLAVE

GOOD, DEGRADED, FAILURE = "good", "degraded", "failed"
FAILED_OUTCOME = "failed: "
"""How the outcome of a failed run begins; the reason follows."""

WAIT_S = 1.0
"""A run without a session that ends later than this has failed [s]: a slave that is there answers within 0.1 s."""
CALL_S = 3.0
"""The same while it runs [s]: the slave may be about to start."""
LOST_S = 1.0
"""A peer that was not heard for so long at the end was lost [s]; a goodbye may be lost too, and that shows earlier."""
AWAY_S = 1.0
"""A master without the slave for so long after its goodbye is degraded [s]; less is an orderly end of both."""
MISSED_SHARE = 0.01
"""Share of missed ticks. Each holds the force for one period more; 1 % lies below the updates of a quiet session."""
FORCE_SHARE = 0.01
"""Share of the engaged ticks at the force limit, in which the operator feels less than the robot touches."""
FELT_SHARE = 0.05
"""Share of ticks outside the deadband, beyond the delay's; without delay and loss the shipped scenes stay below."""
DELAY_SHARE = 0.05
"""Share of ticks outside the deadband that the delay alone explains."""
LOSS_SHARE = 0.05
"""Share of lost datagrams; updates are repeated, so that single losses are not felt."""
LOSS_COUNT = 20
"""Fewer lost datagrams say nothing about a share."""

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


class Cause(NamedTuple):
    """Why a session is not good.

    Args:
        level: `degraded` or `failed`.
        name: short identifier; no two causes of a verdict share one.
        text: words, with the figure.
    """

    level: str
    name: str
    text: str


class Verdict(NamedTuple):
    """The word, and the causes, those that failed first."""

    word: str
    causes: tuple[Cause, ...]

    @property
    def line(self) -> str:
        """In one line."""
        return f"{self.word} because {'; '.join(cause.text for cause in self.causes)}" if self.causes else self.word

    @property
    def status(self) -> int:
        """Exit status of the command that ran the session."""
        return FAILED if self.word == FAILURE else COMPLETED

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {"word": self.word, "causes": [cause._asdict() for cause in self.causes]}


def verdict(summary: Mapping[str, Any]) -> Verdict:
    """Judge a session by its figures.

    Args:
        summary: the report of a session, or the figures of a running one; every key except those of
            `SessionScore.summary()` may be missing.
    """
    found: dict[str, Cause] = {}
    for cause in _causes(summary):
        found.setdefault(cause.name, cause)
    causes = tuple(sorted(found.values(), key=lambda cause: cause.level != FAILURE))
    return Verdict(causes[0].level if causes else GOOD, causes)


def _causes(summary: Mapping[str, Any]) -> Iterator[Cause]:
    yield from _connection(summary)
    yield from _ending(summary)
    yield from _recording(summary)
    yield from _ticks(summary)
    yield from _faults(summary)
    yield from _force(summary)
    yield from _energy(summary.get("energy", {}))
    yield from _loss(summary["link"])


def _ending(summary: Mapping[str, Any]) -> Iterator[Cause]:
    """The reason of a run that failed; its own words."""
    outcome = str(summary.get("outcome") or "")
    reason = outcome.removeprefix(FAILED_OUTCOME)
    if EMERGENCY in outcome:
        yield Cause(FAILURE, "emergency_stop", "of an emergency stop")
    elif reason != outcome:
        name = next((name for name, words in _ENDINGS if words in reason), "ended")
        yield Cause(FAILURE, name, _unanswered(summary, reason) if name == "no_answer" else reason)


def _connection(summary: Mapping[str, Any]) -> Iterator[Cause]:
    """Whether the two sides found, heard and kept each other."""
    sides = {side: figures for side, figures in summary.get("connection", {}).items() if figures is not None}
    for side, figures in sides.items():
        if figures["ended"] == "waiting":
            yield from _never(summary, side, figures["waited_s"])
        elif figures["ended"] == "unconnected" and figures["last_s"] >= LOST_S and not _has_left(summary, side):
            text = f"the {_PEERS[side]} was lost: not heard for the last {figures['last_s']:.1f} s"
            yield Cause(FAILURE, "lost", text)
    longest = max(sides.values(), key=lambda figures: figures["unconnected_s"], default=None)
    if longest is not None and longest["unconnected_s"] > longest["last_s"] * (longest["ended"] == "unconnected"):
        times = longest["interruptions"]
        text = f"unconnected for {longest['unconnected_s']:.1f} s" + (f" in {times} interruptions" * (times > 1))
        yield Cause(DEGRADED, "unconnected", text)
    away = sides[MASTER]["away_s"] if MASTER in sides else 0.0
    if away >= AWAY_S:
        farewell = _peer(summary, MASTER).get("farewell")
        why = f" ({farewell})" if farewell else ""
        yield Cause(DEGRADED, "away", f"the slave left{why}, {away:.1f} s without it")


def _has_left(summary: Mapping[str, Any], side: str) -> bool:
    """Whether the peer of a side ended in order, so that only its farewell was lost: known of the master alone."""
    ended = "outcome" in summary and not str(summary["outcome"]).startswith(FAILED_OUTCOME)
    return ended and side == SLAVE and summary["connection"].get(MASTER) is not None


def _peer(summary: Mapping[str, Any], side: str) -> Mapping[str, str]:
    """What a side knew of its peer."""
    return summary.get("peers", {}).get(side) or {}


def _never(summary: Mapping[str, Any], side: str, waited: float) -> Iterator[Cause]:
    """A side that had no session at all."""
    faults, drops = (summary.get(key, {}).get(side, {}) for key in ("faults", "drops"))
    limit = WAIT_S if "outcome" in summary else CALL_S
    refusal = _peer(summary, side).get("refusal")
    if faults.get("unproven") or drops.get("unproven"):
        caller = "a call" if side == SLAVE else "the answer"
        yield Cause(FAILURE, "key", f"{caller} did not prove the key: are the keys the same on both hosts?")
    elif refusal or faults.get("refused"):
        yield Cause(FAILURE, "refused", f"refused: {refusal}" if refusal else "a call was refused")
    elif waited > limit and side == MASTER and not _is_told(summary):
        yield Cause(FAILURE, "no_answer", _unanswered(summary, f"the slave did not answer in {waited:.1f} s"))
    elif waited > limit and summary["connection"].get(MASTER) is None:
        yield Cause(DEGRADED, "no_call", f"no master called in {waited:.1f} s")


def _is_told(summary: Mapping[str, Any]) -> bool:
    """Whether the outcome itself says why there was no path."""
    note = finding(summary.get("paths", {}).get(MASTER, ()))
    return bool(note) and note in str(summary.get("outcome"))


def _unanswered(summary: Mapping[str, Any], text: str) -> str:
    """With the address, and what a person can look at: a slave does not answer a call that proves no key.

    Without a path to the slave, what is known of that instead.
    """
    if note := finding(summary.get("paths", {}).get(MASTER, ())):
        return f"{text}: {note}"
    at = summary.get("addresses", {}).get("slave")
    if at and is_placeholder(split_address(at)[0]):
        return f"{text} at {at}, {PLACEHOLDER}: set link.slave to the robot's address"
    return f"{text}{f' at {at}' if at else ''}: {_QUESTIONS}"


def _recording(summary: Mapping[str, Any]) -> Iterator[Cause]:
    facts = summary.get("recording", {})
    outcome = facts.get("outcome", "complete" if facts.get("running", True) else "the recorder has ended")
    if outcome != "complete":
        kept = f"; {facts['bytes'] / 1e3:.0f} kB kept" if facts.get("bytes") else ""
        yield Cause(FAILURE, "recording", f"the recording failed: {outcome}{kept}")
    elif lost := sum(facts.get("lost", {}).values()):
        yield Cause(DEGRADED, "recording", f"the recording lacks {lost} records")


def _ticks(summary: Mapping[str, Any]) -> Iterator[Cause]:
    """Missed ticks, and which of them the host took."""
    for side, figures in summary["ticks"].items():
        if not figures["count"] and _peer(summary, side).get("name"):
            yield Cause(
                DEGRADED, "no_figures", f"the figures of the {side} are missing: its telemetry was read too late"
            )
    ticks = summary["ticks"].values()
    missed = sum(side["missed"] for side in ticks)
    due = missed + sum(side["count"] for side in ticks)
    if not due or missed < MISSED_SHARE * due:
        return
    text = f"{_percent(missed / due)} of ticks missed"
    host = summary.get("host")
    if host is not None and host["missed"] is not None:
        text += f", of which the host took {_percent(sum(host['missed'].values()) / missed, 0)}"
    elif host is not None:
        text += f" (host not watched: {host['unknown']})"
    if host is not None and host["steal"] is not None:
        text += f", steal {_percent(host['steal'])}"
    yield Cause(DEGRADED, "missed_ticks", text)


def _faults(summary: Mapping[str, Any]) -> Iterator[Cause]:
    faults = summary.get("faults", {})
    stalled = {side: counts["stalled"] for side, counts in faults.items() if counts.get("stalled")}
    if stalled:
        longest = max(summary["ticks"][side]["missed_longest_s"] for side in stalled)
        who = " and ".join(f"the {side} {_times(count)}" for side, count in stalled.items())
        yield Cause(DEGRADED, "stalled", f"a process stood still: {who}, for up to {longest:.2f} s")
    if unfounded := faults.get(MASTER, {}).get("unfounded"):
        text = f"force without a contact was faded out {_times(unfounded)}"
        yield Cause(FAILURE, "unfounded", text)
    if tripped := faults.get(SLAVE, {}).get("tripped"):
        limit = "trip_n" if "force" in summary else "joints.trip_nm"
        text = f"the robot backed off from a contact {_times(tripped)} (slave.limits.{limit})"
        yield Cause(DEGRADED, "tripped", text)
    if wrong := sum(counts.get("update", 0) for counts in faults.values()):
        yield Cause(DEGRADED, "update", f"{wrong} updates did not fit their channel")


def _force(summary: Mapping[str, Any]) -> Iterator[Cause]:
    """What the limit of force, delay and codec did to the force that the operator felt."""
    is_arm = "force" not in summary
    force, limited = felt_channel(summary), summary["limited"]["force_ticks"]
    engaged = summary["joint_angle" if is_arm else "position"].get("samples", 0)
    if engaged and limited >= FORCE_SHARE * engaged:
        what, where = ("torque", "joints.torque_nm") if is_arm else ("force", "force_n")
        text = f"{what} limited in {_percent(limited / engaged)} of ticks (master.limits.{where})"
        yield Cause(DEGRADED, "force_limited", text)
    outside, explained = force["violation_fraction"], force["violation_floor"] or 0.0
    if outside is None:
        return
    if outside - explained > FELT_SHARE:
        text = f"felt error outside the deadband in {_percent(outside)} of ticks"
        yield Cause(DEGRADED, "felt", f"{text} ({_percent(explained)} explained by delay)")
    elif min(outside, explained) > DELAY_SHARE:
        text = f"delay put the felt error outside the deadband in {_percent(outside)} of ticks"
        yield Cause(DEGRADED, "delay", text)


def _energy(energy: Mapping[str, Any]) -> Iterator[Cause]:
    """Whether the accounts held."""
    share = energy.get("bound_share")
    if share is not None and share > 1.0:
        text = f"{_percent(share, 0)} of the energy that may come out at the hand came out"
        yield Cause(DEGRADED, "bound", text)


def _loss(link: Mapping[str, Any]) -> Iterator[Cause]:
    lost = link["lost"]
    due = lost + link["received"]
    if lost >= LOSS_COUNT and lost >= LOSS_SHARE * due:
        yield Cause(DEGRADED, "loss", f"{_percent(lost / due)} of datagrams lost")


def felt_channel(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of the channel that the operator feels: the force or, of an arm, the torques of its joints."""
    felt: dict[str, Any] = summary["force"] if "force" in summary else summary["joint_torque"]
    return felt


def millijoules(energy: float) -> str:
    return f"{energy * 1e3:.{0 if energy >= 0.1 else 1}f} mJ"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _percent(share: float, digits: int = 1) -> str:
    return f"{100.0 * share:.{digits}f} %"
