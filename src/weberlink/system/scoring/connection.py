"""How long one side was in session with its peer, from the states in its records."""

from typing import Any

import numpy as np

from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State
from weberlink.system.scoring.energy import Records

WAITING, CONNECTED, UNCONNECTED, AWAY = "waiting", "connected", "unconnected", "away"
"""No session yet; in session and hearing each other; silent, or lost by silence; left by the peer in order."""
LEAVE_S = 0.8 * EXPIRY
"""A session that ends sooner after a tick in which it was heard was left by the peer; silence ends it later [s]."""

_ENGAGED, _SILENT, _CLOSED = State.ENGAGED.value, State.SILENT.value, State.CLOSED.value


class ConnectionScore:
    """Running figures of one side; a few numbers, whatever the length of the session.

    A state counts until the next record. Nothing counts from the tick on in which the side closed its end.

    Attributes:
        phase: the present one, or that before the end.
    """

    def __init__(self) -> None:
        self.phase = WAITING
        self._seconds = dict.fromkeys((WAITING, CONNECTED, UNCONNECTED, AWAY), 0.0)
        self._last: tuple[float, int] | None = None
        self._heard_at = -np.inf
        self._since = 0.0
        """Duration of the present phase [s]."""
        self._longest = 0.0
        self._interruptions = 0

    def add(self, records: Records) -> None:
        """Take the next records, in order."""
        if not len(records):
            return
        at, states = records["at"], records["state"]
        starts = np.flatnonzero(states[1:] != states[:-1]) + 1
        ends_of_runs = sorted({0, *(starts - 1).tolist(), *starts.tolist(), len(records) - 1})
        for index in ends_of_runs:
            self._enter(float(at[index]), int(states[index]))

    def summary(self) -> dict[str, Any]:
        """Seconds by phase, and how the side ended; keys as the commands document them."""
        return {
            "waited_s": self._seconds[WAITING],
            "connected_s": self._seconds[CONNECTED],
            "unconnected_s": self._seconds[UNCONNECTED],
            "unconnected_longest_s": self._longest,
            "interruptions": self._interruptions,
            "away_s": self._seconds[AWAY],
            "ended": self.phase,
            "last_s": self._since,
        }

    def _enter(self, at: float, state: int) -> None:
        """Count up to a record, and take its state."""
        if self._last is not None:
            before, last = self._last
            if last == _CLOSED:
                return
            self._count(at - before)
            if last == _ENGAGED:
                self._heard_at = before
        self._last = (at, state)
        phase = self._next(at, state)
        if phase != self.phase:
            self._interruptions += phase == UNCONNECTED
            self.phase, self._since = phase, 0.0

    def _count(self, seconds: float) -> None:
        self._seconds[self.phase] += seconds
        self._since += seconds
        if self.phase == UNCONNECTED:
            self._longest = max(self._longest, self._since)

    def _next(self, at: float, state: int) -> str:
        if state == _ENGAGED:
            return CONNECTED
        if state == _SILENT:
            return UNCONNECTED
        if state == _CLOSED or self.phase in (WAITING, AWAY):
            return self.phase
        return AWAY if at - self._heard_at < LEAVE_S else UNCONNECTED
