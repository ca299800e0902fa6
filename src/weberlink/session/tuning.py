"""The settings of a session that may change while it runs, and the tick at which a change takes effect.

One side proposes a change for one of its ticks, and makes it only when the other side has agreed. The other side agrees
only if its answer can be there before that tick, so both make the change at the same moment unless every answer is lost
until then. In that case the proposer follows with the first answer to a repeat: after n lost exchanges more than the
margin holds, that is n times the pace of the repeats later. If two proposals cross, that of the master is made.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

from weberlink.bounded_json import parse

MARGIN, ROUND_TRIPS, JITTERS = 0.01, 1.5, 2.0
"""Time from a proposal to the tick of the change: a constant [s], and multiples of round trip and jitter. By the pace
of `weberlink.protocol.negotiation`, five exchanges at least fit in, of which one must succeed."""
MARGIN_TICKS = 4  # ticks in addition: each message waits for the next one of its sender and of its receiver
UNMEASURED_RTT = 0.1  # round trip that is assumed while it is unknown [s]
LONGEST_CHANGE = 256  # bytes of a change, more than a datagram has room for
BUSY = "another change is on its way"
LATE = "the proposal came too late; ask again"
FIXED = {
    "weber": "control.live_changes is off",
    "predictor": "control.live_changes is off, or codec.force.predictor is no choice among several, such as hybrid",
}


class LiveSettings(NamedTuple):
    """Of the force channel: the Weber factor k, 0 <= k < 1, and the predictor, or the choice among several."""

    weber: float
    predictor: str


class ChangeResult(NamedTuple):
    """The outcome of a change that this side proposed: its tick on this side's clock, or the reason of a refusal."""

    tick: int
    refusal: str | None


def change_margin(rtt: float | None, jitter: float) -> float:
    """Time from a proposal to the tick of the change [s], beside `MARGIN_TICKS`; the round trip is None if unknown."""
    return MARGIN + ROUND_TRIPS * (UNMEASURED_RTT if rtt is None else rtt) + JITTERS * jitter


class Tuning:
    """The live settings of one side. Both sides of a session count the same changes.

    Args:
        settings: the settings of the file, with which every session begins.
        permitted: settings that may be changed, each with the names allowed; `weber` may be any number from 0 to less
            than 1.
        apply: makes a change on this side; its second argument is the tick of the peer at which the peer makes it, as
            near as the clocks are known.
        is_master: whether this is the master.
    """

    def __init__(
        self,
        settings: LiveSettings,
        permitted: Mapping[str, Sequence[str]],
        apply: Callable[[LiveSettings, float], None],
        *,
        is_master: bool = False,
    ) -> None:
        self._initial = self.settings = settings
        self.permitted = permitted
        self._apply = apply
        self._is_master = is_master
        self.generation = 0  # number of changes since the session began
        # Of the last change that this side's user proposed; None while it is open, or before the first one.
        self.result: ChangeResult | None = None
        self._proposes = False  # a proposal of this side has no answer yet
        # Changes that are not in effect yet: a tick, whether that is of the peer, and the change.
        self.agreed: list[tuple[int, bool, Mapping[str, Any]]] = []

    @property
    def pending(self) -> LiveSettings | None:
        """Settings that are agreed and not yet in effect; None if there are none."""
        return self.settings._replace(**self.agreed[-1][2]) if self.agreed else None

    def reset(self) -> None:
        """Begin a new session: return to the settings of the file and drop any open change."""
        if self._proposes or any(not of_peer for _, of_peer, _ in self.agreed):
            self.result = ChangeResult(0, "the session ended")
        self._proposes, self.agreed = False, []
        if self.settings != self._initial:
            self._apply(self._initial, -inf)
        self.settings, self.generation = self._initial, 0

    def complaint(self, change: Mapping[str, object]) -> str | None:
        """Why a change cannot be made; None if it can."""
        return self._refusal(change) or (BUSY if self._proposes or self.agreed else None)

    def _refusal(self, change: Mapping[str, object]) -> str | None:
        for name, value in change.items():
            if name not in LiveSettings._fields:
                return f"unknown setting {name}; known are {', '.join(LiveSettings._fields)}"
            if name not in self.permitted:
                return f"{name} is fixed in this session: {FIXED[name]}"
            if name != "weber":
                names = self.permitted[name]
                if value not in names:
                    return f"{name} must be one of {', '.join(names)}, not {value!r}"
            elif not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 <= value < 1.0:
                return f"weber must be a number from 0 to less than 1, not {value!r}"
        return None if change else "nothing to change; name weber or predictor"

    def propose(self, change: Mapping[str, object]) -> bytes:
        """The message that proposes a change, which must have no `complaint`; `on_answer` sets `result` later."""
        self._proposes, self.result = True, None
        return json.dumps(dict(change), separators=(",", ":")).encode()

    def on_proposal(self, tick: int, body: bytes, answered_at: float = -inf) -> str | None:
        """Take in a proposal of the peer; returns None to agree, or the reason of a refusal.

        Args:
            tick: of the peer, at which the change is to be made.
            body: of the message.
            answered_at: tick of the peer at which it has the answer.
        """
        change = parsed(body)
        refusal = "not a change" if change is None else self._refusal(change)
        if change is None or refusal is not None:
            return refusal
        if self.agreed or (self._proposes and self._is_master):  # the master refuses a proposal that crosses its own
            return BUSY
        if answered_at > tick:
            return LATE
        self.agreed.append((tick, True, change))
        return None

    def on_answer(self, tick: int, body: bytes, refusal: str | None) -> None:
        """Take in the answer of the peer to this side's proposal: the tick on this side's clock, and any refusal."""
        self._proposes = False
        change = parsed(body)
        self.result = ChangeResult(tick, refusal)
        if refusal is None and change is not None:
            self.agreed.append((tick, False, change))

    def advance(self, tick: int, peer_tick: float | None) -> None:
        """Make what is agreed for this tick, or for the tick of the peer that is nearest to it.

        Args:
            tick: of this side.
            peer_tick: the same time on the tick clock of the peer; None while unknown.
        """
        nearest = -inf if peer_tick is None else peer_tick + 0.5
        for agreed in [each for each in self.agreed if each[0] <= (nearest if each[1] else tick)]:
            self.agreed.remove(agreed)
            at, of_peer, change = agreed
            self.settings = self.settings._replace(**change)
            self.generation += 1
            # The peer makes a change of this side up to half a tick early, in the tick that was agreed or soon after.
            self._apply(self.settings, at if of_peer else nearest - 1.0 - (tick - at))


def parsed(body: bytes) -> dict[str, object] | None:
    """The change in a message: a flat JSON object; None if the message is anything else."""
    try:
        change = parse(body, LONGEST_CHANGE)
    except ValueError:
        return None
    if not isinstance(change, dict) or any(isinstance(value, dict | list) for value in change.values()):
        return None
    return change
