"""The settings of a session that may change while it runs, and the tick from which a change holds."""

import json
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import NamedTuple

LEAD = 0.1
"""A change is proposed for this much later [s], and for so many round trips more, which leaves time for repeats."""
ROUND_TRIPS = 6.0
BUSY = "another change is on its way"


class LiveSettings(NamedTuple):
    """What may change in a running session.

    Args:
        weber: Weber factor k of the force channel, 0 to 1.
        predictor: name of the predictor of the force channel, or "hybrid" or "adaptive".
        scheme: name of the control scheme.
    """

    weber: float
    predictor: str
    scheme: str


class ChangeResult(NamedTuple):
    """The outcome of a change that this side proposed: its tick on this side, or why it was refused."""

    tick: int
    refusal: str | None


class Tuning:
    """The settings of one side. Both sides of a session count the same changes.

    Args:
        settings: those of the file, to which every session returns when it begins.
        permitted: settings that may be changed, and to which names; k to any number from 0 to 1.
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
        """Changes made since the session began."""
        self.result: ChangeResult | None = None
        """Of the change that this side proposed last; None while it waits, or has never proposed one."""
        self._asked = False
        self.pending: LiveSettings | None = None
        """Agreed, and not yet in force."""
        self._at = inf
        self._of_peer = False

    def reset(self) -> None:
        """A new session: the settings of the file hold, and what was under way is void."""
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
                return f"{name} is no setting; there are {', '.join(LiveSettings._fields)}"
            if name not in self.permitted:
                return f"{name} is fixed in this session: {_FIXED[name]}"
            if (refusal := self._doubt(name, value)) is not None:
                return refusal
        return BUSY if self._asked or self.pending is not None else None

    def _doubt(self, name: str, value: object) -> str | None:
        if name == "weber":
            if isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 1.0:
                return None
            return f"weber must be a number from 0 to 1, not {value!r}"
        names = self.permitted[name]
        return None if value in names else f"{name} must be one of {', '.join(names)}, not {value!r}"

    def lead(self, rtt: float | None) -> float:
        """How far ahead a change is to be proposed over a link of this round trip [s]."""
        return LEAD if rtt is None else LEAD + ROUND_TRIPS * rtt

    def ask(self, change: Mapping[str, object]) -> bytes:
        """The message that proposes a change without complaint; `result` follows."""
        self._asked, self.result = True, None
        return json.dumps(dict(change), separators=(",", ":")).encode()

    def hear(self, tick: int, body: bytes) -> str | None:
        """Take a proposal of the peer for a tick of its clock: None to agree, or why not."""
        change = _read(body)
        refusal = "not a change" if change is None else self.complaint(change)
        if refusal is None and change is not None:
            self._agree(change, tick, of_peer=True)
        return refusal

    def settle(self, tick: int, body: bytes, refusal: str | None) -> None:
        """Take the answer of the peer to the own proposal."""
        self._asked = False
        self.result = ChangeResult(tick, refusal)
        change = _read(body)
        if refusal is None and change is not None:
            self._agree(change, tick, of_peer=False)

    def advance(self, tick: int, peer_tick: float | None) -> None:
        """Make the change that is due at this tick; `peer_tick` is the same moment in ticks of the peer."""
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
    """A change as the peer wrote it: names with numbers or texts, nothing nested."""
    try:
        change = json.loads(body)
    except (ValueError, RecursionError):
        return None
    if not isinstance(change, dict) or any(isinstance(value, dict | list) for value in change.values()):
        return None
    return change
