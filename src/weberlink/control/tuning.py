"""The settings of a session that may change while it runs, and the tick at which a change takes effect."""

import json
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import NamedTuple

LEAD = 0.1
"""Time from a proposal to the tick of the change [s], plus `ROUND_TRIPS` round trips to leave time for repeats."""
ROUND_TRIPS = 6.0
BUSY = "another change is on its way"


class LiveSettings(NamedTuple):
    """The settings that may change in a running session.

    Args:
        weber: Weber factor k of the force channel, 0 to 1.
        predictor: name of the predictor of the force channel, or "hybrid" or "adaptive".
        scheme: name of the control scheme.
    """

    weber: float
    predictor: str
    scheme: str


class ChangeResult(NamedTuple):
    """The outcome of a change that this side proposed: its tick on this side's clock, or the reason of a refusal."""

    tick: int
    refusal: str | None


class Tuning:
    """The live settings of one side. Both sides of a session count the same changes.

    Args:
        settings: the settings of the file, with which every session begins.
        permitted: settings that may be changed, each with the names allowed; `weber` may be any number from 0 to 1.
        apply: makes a change on this side.
    """

    __slots__ = (
        "_apply",
        "_asked",
        "_at",
        "_initial",
        "_of_peer",
        "generation",
        "pending",
        "permitted",
        "result",
        "settings",
    )

    def __init__(
        self, settings: LiveSettings, permitted: Mapping[str, Sequence[str]], apply: Callable[[LiveSettings], None]
    ) -> None:
        self._initial = self.settings = settings
        self.permitted = permitted
        self._apply = apply
        self.generation = 0
        """Number of changes since the session began."""
        self.result: ChangeResult | None = None
        """Outcome of the last change that this side proposed; None while it is open, or before the first one."""
        self._asked = False
        self.pending: LiveSettings | None = None
        """Settings that are agreed and not yet in effect; None if there are none."""
        self._at = inf
        self._of_peer = False

    def reset(self) -> None:
        """Begin a new session: return to the settings of the file and drop any open change."""
        if self._asked or (self.pending is not None and not self._of_peer):
            self.result = ChangeResult(0, "the session ended")
        self._asked, self.pending, self._at = False, None, inf
        if self.settings != self._initial:
            self._apply(self._initial)
        self.settings, self.generation = self._initial, 0

    def complaint(self, change: Mapping[str, object]) -> str | None:
        """Why a change cannot be made; None if it can."""
        if not change:
            return "nothing to change; name weber, predictor or scheme"
        for name, value in change.items():
            if name not in LiveSettings._fields:
                return f"unknown setting {name}; known are {', '.join(LiveSettings._fields)}"
            if name not in self.permitted:
                return f"{name} is fixed in this session: {_FIXED[name]}"
            if (refusal := self._value_complaint(name, value)) is not None:
                return refusal
        return BUSY if self._asked or self.pending is not None else None

    def _value_complaint(self, name: str, value: object) -> str | None:
        if name == "weber":
            if isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 1.0:
                return None
            return f"weber must be a number from 0 to 1, not {value!r}"
        names = self.permitted[name]
        return None if value in names else f"{name} must be one of {', '.join(names)}, not {value!r}"

    def lead(self, rtt: float | None) -> float:
        """Time from a proposal to the tick of the change [s], at this round-trip time [s]; None if it is unknown."""
        return LEAD if rtt is None else LEAD + ROUND_TRIPS * rtt

    def ask(self, change: Mapping[str, object]) -> bytes:
        """The message that proposes a change, which must have no `complaint`; `settle` sets `result` later."""
        self._asked, self.result = True, None
        return json.dumps(dict(change), separators=(",", ":")).encode()

    def hear(self, tick: int, body: bytes) -> str | None:
        """Take in a proposal of the peer for a tick of its clock; returns None to agree, or the reason of a refusal."""
        change = _read(body)
        refusal = "not a change" if change is None else self.complaint(change)
        if refusal is None and change is not None:
            self._agree(change, tick, of_peer=True)
        return refusal

    def settle(self, tick: int, body: bytes, refusal: str | None) -> None:
        """Take in the answer of the peer to this side's proposal: the tick on this side's clock, and any refusal."""
        self._asked = False
        self.result = ChangeResult(tick, refusal)
        change = _read(body)
        if refusal is None and change is not None:
            self._agree(change, tick, of_peer=False)

    def advance(self, tick: int, peer_tick: float | None) -> None:
        """Make the pending change if it is due at this tick; `peer_tick` is the same time on the peer's tick clock."""
        now = peer_tick if self._of_peer else tick
        if self.pending is None or now is None or now < self._at:
            return
        self.settings, self.pending = self.pending, None
        self.generation += 1
        self._apply(self.settings)

    def _agree(self, change: Mapping[str, object], tick: int, *, of_peer: bool) -> None:
        self.pending = self.settings._replace(**change)  # type: ignore[arg-type]
        self._at, self._of_peer = tick, of_peer


_FIXED = {
    "weber": "control.live_changes is off",
    "predictor": "control.live_changes is off, or codec.force.predictor is neither hybrid nor adaptive",
    "scheme": "control.live_changes is off, or control.scheme is not auto",
}


def _read(body: bytes) -> dict[str, object] | None:
    """The change in a message: a flat JSON object; None if the message is anything else."""
    try:
        change = json.loads(body)
    except (ValueError, RecursionError):
        return None
    if not isinstance(change, dict) or any(isinstance(value, dict | list) for value in change.values()):
        return None
    return change
