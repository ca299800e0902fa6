"""The settings of a session that may change while it runs, and the tick at which a change takes effect.

One side proposes a change for one of its ticks, and makes it only when the other side has agreed. The other side agrees
only if its answer can be there before that tick, so both make the change at the same moment unless every answer is lost
until then. In that case the proposer follows with the first answer to a repeat: after n lost exchanges more than the
lead holds, that is n times the pace of the repeats later. If two proposals cross, that of the master is made.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

LEAD, ROUND_TRIPS, JITTERS = 0.01, 1.5, 2.0
"""Time from a proposal to the tick of the change: a constant [s], and multiples of round trip and jitter. By the pace
of `weberlink.protocol.negotiation`, five exchanges at least fit in, of which one must succeed."""
LEAD_TICKS = 4
"""Ticks in addition: each message waits for the next one of its sender and of its receiver."""
UNMEASURED_RTT = 0.1
"""Round trip that is assumed while it is unknown [s]."""
BUSY = "another change is on its way"
LATE = "the proposal came too late; ask again"


class LiveSettings(NamedTuple):
    """The settings that may change in a running session.

    Args:
        weber: Weber factor k of the force channel, 0 <= k < 1.
        predictor: name of the predictor of the force channel, or "hybrid" or "adaptive".
    """

    weber: float
    predictor: str


class ChangeResult(NamedTuple):
    """The outcome of a change that this side proposed: its tick on this side's clock, or the reason of a refusal."""

    tick: int
    refusal: str | None


def lead(rtt: float | None, jitter: float) -> float:
    """Time from a proposal to the tick of the change [s], beside `LEAD_TICKS`; the round trip is None while unknown."""
    return LEAD + ROUND_TRIPS * (UNMEASURED_RTT if rtt is None else rtt) + JITTERS * jitter


class Tuning:
    """The live settings of one side. Both sides of a session count the same changes.

    Args:
        settings: the settings of the file, with which every session begins.
        permitted: settings that may be changed, each with the names allowed; `weber` may be any number from 0 to less
            than 1.
        apply: makes a change on this side; its second argument is the tick of the peer at which the peer makes it, as
            near as the clocks are known.
        leads: whether this is the master.
    """

    __slots__ = (
        "_agreed",
        "_apply",
        "_asked",
        "_initial",
        "_leads",
        "generation",
        "permitted",
        "result",
        "settings",
    )

    def __init__(
        self,
        settings: LiveSettings,
        permitted: Mapping[str, Sequence[str]],
        apply: Callable[[LiveSettings, float], None],
        *,
        leads: bool = False,
    ) -> None:
        self._initial = self.settings = settings
        self.permitted = permitted
        self._apply = apply
        self._leads = leads
        self.generation = 0
        """Number of changes of `settings` since the session began."""
        self.result: ChangeResult | None = None
        """Outcome of the last change that this side's user proposed; None while it is open, or before the first one."""
        self._asked: Mapping[str, object] | None = None
        self._agreed: list[_Agreed] = []

    @property
    def pending(self) -> LiveSettings | None:
        """Settings that are agreed and not yet in effect; None if there are none."""
        return self.settings._replace(**self._agreed[-1].change) if self._agreed else None

    @property
    def is_busy(self) -> bool:
        """Whether a change is proposed by this side, or agreed and not yet in effect."""
        return self._asked is not None or bool(self._agreed)

    def reset(self) -> None:
        """Begin a new session: return to the settings of the file and drop any open change."""
        if self._asked is not None or any(not agreed.of_peer for agreed in self._agreed):
            self.result = ChangeResult(0, "the session ended")
        self._asked, self._agreed = None, []
        if self.settings != self._initial:
            self._apply(self._initial, -inf)
        self.settings, self.generation = self._initial, 0

    def complaint(self, change: Mapping[str, object]) -> str | None:
        """Why a change cannot be made; None if it can."""
        return self._content_complaint(change) or (BUSY if self.is_busy else None)

    def _content_complaint(self, change: Mapping[str, object]) -> str | None:
        if not change:
            return "nothing to change; name weber or predictor"
        for name, value in change.items():
            if name not in LiveSettings._fields:
                return f"unknown setting {name}; known are {', '.join(LiveSettings._fields)}"
            if name not in self.permitted:
                return f"{name} is fixed in this session: {_FIXED[name]}"
            if (refusal := self._value_complaint(name, value)) is not None:
                return refusal
        return None

    def _value_complaint(self, name: str, value: object) -> str | None:
        if name == "weber":
            if isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < 1.0:
                return None
            return f"weber must be a number from 0 to less than 1, not {value!r}"
        names = self.permitted[name]
        return None if value in names else f"{name} must be one of {', '.join(names)}, not {value!r}"

    def ask(self, change: Mapping[str, object]) -> bytes:
        """The message that proposes a change, which must have no `complaint`; `settle` sets `result` later."""
        self._asked, self.result = change, None
        return _body(change)

    def hear(self, tick: int, body: bytes, answered_at: float = -inf) -> str | None:
        """Take in a proposal of the peer; returns None to agree, or the reason of a refusal.

        Args:
            tick: of the peer, at which the change is to be made.
            body: of the message.
            answered_at: tick of the peer at which it has the answer.
        """
        change = _read(body)
        if change is None:
            return "not a change"
        refusal = self._content_complaint(change)
        if refusal is not None:
            return refusal
        if self._agreed or (self._asked is not None and self._leads):  # the master refuses a proposal that crosses its
            return BUSY
        if answered_at > tick:
            return LATE
        self._agreed.append(_Agreed(change, tick, of_peer=True))
        return None

    def settle(self, tick: int, body: bytes, refusal: str | None) -> None:
        """Take in the answer of the peer to this side's proposal: the tick on this side's clock, and any refusal."""
        self._asked = None
        change = _read(body)
        self.result = ChangeResult(tick, refusal)
        if refusal is None and change is not None:
            self._agreed.append(_Agreed(change, tick, of_peer=False))

    def advance(self, tick: int, peer_tick: float | None) -> None:
        """Make what is agreed for this tick, or for the tick of the peer that is nearest to it.

        Args:
            tick: of this side.
            peer_tick: the same time on the tick clock of the peer; None while unknown.
        """
        nearest = -inf if peer_tick is None else peer_tick + 0.5
        due = [agreed for agreed in self._agreed if agreed.tick <= (nearest if agreed.of_peer else tick)]
        for agreed in due:
            self._agreed.remove(agreed)
            # The peer makes a change of this side up to half a tick early, in the tick that was agreed or soon after.
            self._make(agreed.change, agreed.tick if agreed.of_peer else nearest - 1.0 - (tick - agreed.tick))

    def _make(self, change: Mapping[str, Any], peer_tick: float) -> None:
        self.settings = self.settings._replace(**change)
        self.generation += 1
        self._apply(self.settings, peer_tick)


class _Agreed(NamedTuple):
    """A change that is agreed for a tick, of this side or of the peer."""

    change: Mapping[str, Any]
    tick: int
    of_peer: bool


_FIXED = {
    "weber": "control.live_changes is off",
    "predictor": "control.live_changes is off, or codec.force.predictor is neither hybrid nor adaptive",
}


def _body(change: Mapping[str, object]) -> bytes:
    return json.dumps(dict(change), separators=(",", ":")).encode()


def _read(body: bytes) -> dict[str, object] | None:
    """The change in a message: a flat JSON object; None if the message is anything else."""
    try:
        change = json.loads(body)
    except (ValueError, RecursionError):
        return None
    if not isinstance(change, dict) or any(isinstance(value, dict | list) for value in change.values()):
        return None
    return change
