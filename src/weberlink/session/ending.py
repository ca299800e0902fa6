"""How long each side of a session was connected, and why a session failed: what decides the exit status."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from weberlink.config.model import is_placeholder, split_address
from weberlink.order import EMERGENCY, MASTER, SLAVE
from weberlink.protocol.paths import finding
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State
from weberlink.session.report import Facts

if TYPE_CHECKING:
    from weberlink.telemetry.reader import Records

WAITING, CONNECTED, UNCONNECTED, AWAY = "waiting", "connected", "unconnected", "away"
"""No session yet; in session and hearing each other; silent, or lost by silence; left by the peer in order."""
_SECONDS = {WAITING: "waited_s", CONNECTED: "connected_s", UNCONNECTED: "unconnected_s", AWAY: "away_s"}
LEAVE_S = 0.8 * EXPIRY
"""A session that ends sooner after a tick in which it was heard was left by the peer; silence ends it later [s]."""

FAILED_OUTCOME = "failed: "  # how the outcome of a failed run begins; the reason follows
WAIT_S = 1.0
"""A run without a session that ends later than this has failed [s]: a slave that is there answers within 0.1 s."""
CALL_S = 3.0  # the same while it runs [s]: the slave may be about to start
LOST_S = 1.0
"""A peer that was not heard for so long at the end was lost [s]; a goodbye may be lost too, and that shows earlier."""
URGENT = ("key", "refused", "no_answer", "lost")
"""Causes that a person can remove while the session runs; a recording that ends is told with its path."""
PLACEHOLDER = "a placeholder of the file, which no host has"

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
_QUESTIONS = "is it running there, is the address right, are the keys the same on both hosts?"
PEERS = {MASTER: SLAVE, SLAVE: MASTER}
_ENGAGED, _SILENT, _CLOSED = State.ENGAGED.value, State.SILENT.value, State.CLOSED.value


@dataclass
class Connection:
    """How long a side waited for its first session, was connected, unconnected, and away (left by the peer in order).

    A state counts until the next record. Nothing counts from the tick on in which the side closed its end.
    """

    waited_s: float = 0.0
    connected_s: float = 0.0
    unconnected_s: float = 0.0
    interruptions: int = 0
    away_s: float = 0.0
    ended: str = WAITING  # the present one of these, or that before the end
    last_s: float = 0.0  # for how long

    def __post_init__(self) -> None:
        self._last: tuple[float, int] | None = None  # moment and state of the newest record
        self._heard_at = -inf

    def add(self, records: "Records") -> None:
        """Take the next records, one or more, in order."""
        at, states = records["at"], records["state"]
        starts = (states[1:] != states[:-1]).nonzero()[0] + 1
        for index in sorted({0, *(starts - 1).tolist(), *starts.tolist(), len(records) - 1}):
            self._enter(float(at[index]), int(states[index]))

    def _enter(self, at: float, state: int) -> None:
        """Count up to a record, and take its state."""
        if self._last is not None:
            before, last = self._last
            if last == _CLOSED:
                return
            seconds = _SECONDS[self.ended]
            setattr(self, seconds, getattr(self, seconds) + (at - before))
            self.last_s += at - before
            if last == _ENGAGED:
                self._heard_at = before
        self._last = (at, state)
        phase = self.ended
        if state in (_ENGAGED, _SILENT):
            phase = CONNECTED if state == _ENGAGED else UNCONNECTED
        elif state != _CLOSED and phase not in (WAITING, AWAY):
            phase = AWAY if at - self._heard_at < LEAVE_S else UNCONNECTED
        if phase != self.ended:
            self.interruptions += phase == UNCONNECTED
            self.ended, self.last_s = phase, 0.0


def known_of_peer(facts: Facts, side: str, fact: str) -> str:
    """What a side knew of its peer (`weberlink.session.side.PeerFacts`); "" for nothing."""
    return ((facts.get("peers") or {}).get(side) or {}).get(fact, "")


def failures(facts: Facts, connections: Mapping[str, Connection | None]) -> dict[str, str]:
    """Why a session is failed, of a running one too: words by cause, each in a short identifier; empty if it is not.

    `faults` of the facts are those so far.
    """
    found: dict[str, str] = {}
    for name, text in _causes(facts, {side: each for side, each in connections.items() if each is not None}):
        found.setdefault(name, text)
    return found


def _causes(facts: Facts, sides: Mapping[str, Connection]) -> Iterator[tuple[str, str]]:
    outcome = facts.get("outcome") or ""
    # Where the peer of the slave ended in order, only its farewell was lost; that is known of the master alone.
    has_left = bool(outcome) and not outcome.startswith(FAILED_OUTCOME) and MASTER in sides
    for side, each in sides.items():
        if each.ended == WAITING:
            yield from _never(facts, side, each.waited_s)
        elif each.ended == UNCONNECTED and each.last_s >= LOST_S and not (side == SLAVE and has_left):
            yield "lost", f"the {PEERS[side]} was lost: not heard for the last {each.last_s:.1f} s"
    reason = outcome.removeprefix(FAILED_OUTCOME)
    if EMERGENCY in outcome:
        whose = outcome.partition(EMERGENCY)[2]  # " by NAME" where a name is known
        yield "emergency_stop", f"of an emergency stop{whose}"
    elif reason != outcome:
        name = next((name for name, words in _ENDINGS if words in reason), "ended")
        yield name, _unanswered(facts, reason) if name == "no_answer" else reason
    recording = facts.get("recording") or {}
    ended = recording.get("outcome", "complete" if recording.get("running", True) else "the recorder has ended")
    if ended != "complete":
        kept = f"; {recording['bytes'] / 1e3:.0f} kB kept" if recording.get("bytes") else ""
        yield "recording", f"the recording failed: {ended}{kept}"
    if unfounded := (facts.get("faults") or {}).get(MASTER, {}).get("unfounded"):
        yield "unfounded", f"force without a contact was faded out {times(unfounded)}"


def _never(facts: Facts, side: str, waited: float) -> Iterator[tuple[str, str]]:
    """A side that had no session at all."""
    faults, drops = ((counts or {}).get(side, {}) for counts in (facts.get("faults"), facts.get("drops")))
    refusal = known_of_peer(facts, side, "refusal")
    note = finding((facts.get("paths") or {}).get(MASTER, ()))
    is_told = bool(note) and note in str(facts.get("outcome"))  # why there was no path
    if faults.get("unproven") or drops.get("unproven"):
        caller = "a call" if side == SLAVE else "the answer"
        yield "key", f"{caller} did not prove the key: are the keys the same on both hosts?"
    elif refusal or faults.get("refused"):
        yield "refused", f"refused: {refusal}" if refusal else "a call was refused"
    elif waited > longest_wait(facts) and side == MASTER and not is_told:
        yield "no_answer", _unanswered(facts, f"the slave did not answer in {waited:.1f} s")


def longest_wait(facts: Facts) -> float:
    """Time without a session that is long [s]."""
    return CALL_S if facts.get("outcome") is None else WAIT_S


def _unanswered(facts: Facts, text: str) -> str:
    """With the address, and what a person can look at: a slave does not answer a call that proves no key.

    Without a path to the slave, what is known of that instead.
    """
    if note := finding((facts.get("paths") or {}).get(MASTER, ())):
        return f"{text}: {note}"
    at = (facts.get("addresses") or {}).get("slave")
    if at and is_placeholder(split_address(at)[0]):
        return f"{text} at {at}, {PLACEHOLDER}: set link.slave to the robot's address"
    return f"{text}{f' at {at}' if at else ''}: {_QUESTIONS}"


def times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
