"""The figures of the link: how long each side was in session, and each way apart: delay, loss, bursts, and jitter.

A way is measured by the side that receives. Where that side's records are on another host, its delay follows from the
round trip, which is the sum of both, and its loss is what that side reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from weberlink.config import MASTER, SLAVE
from weberlink.figures.distribution import Distribution
from weberlink.figures.energy import Records
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State

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


WAYS = {"to_slave": (SLAVE, MASTER), "to_master": (MASTER, SLAVE)}
"""Name of each way to the side that receives and the side that sends."""


@dataclass
class _Mean:
    """Running mean; None before the first value."""

    total: float = 0.0
    count: int = 0

    def add(self, values: Records) -> None:
        self.total += float(values.sum(dtype=np.float64))
        self.count += len(values)

    @property
    def value(self) -> float | None:
        return self.total / self.count if self.count else None


@dataclass
class _SideOfLink:
    """What the records of one side say of both ways."""

    inward: Distribution = field(default_factory=Distribution)
    outward: Distribution = field(default_factory=Distribution)
    jitter: Distribution = field(default_factory=Distribution)
    reported_loss: _Mean = field(default_factory=_Mean)
    burst: _Mean = field(default_factory=_Mean)
    received: int = 0
    lost: int = 0
    ticks: int = 0

    def add(self, records: Records) -> None:
        if not len(records):
            return
        engaged = records[records["state"] == State.ENGAGED.value]
        self.ticks += len(records)
        self.inward.add(engaged["one_way_us"])
        self.outward.add(engaged["rtt_us"] - engaged["one_way_us"])
        self.jitter.add(engaged["jitter_us"])
        reported = engaged["outgoing_loss"]
        self.reported_loss.add(reported[np.isfinite(reported)])
        self.burst.add(engaged["peer_burst"][engaged["peer_burst"] > 0.0])
        self.received, self.lost = (int(records[-1][f"datagrams_{name}"]) for name in ("received", "lost"))


class WaysScore:
    """Running figures of both ways, in bounded memory."""

    def __init__(self) -> None:
        self._sides = {MASTER: _SideOfLink(), SLAVE: _SideOfLink()}

    def add(self, side: str, records: Records) -> None:
        """Take the next records of a side, in order."""
        self._sides[side].add(records)

    def summary(self) -> dict[str, Any]:
        """Percentiles [us] and shares (0..1) by way; None where nothing is known.

        `is_reported` says that the loss is the mean of what the receiving side reported while engaged, which is a
        recent share; else it counts every datagram.
        """
        here = self._sides[MASTER] if self._sides[MASTER].ticks else self._sides[SLAVE]
        ways = {name: self._way(*sides) for name, sides in WAYS.items()}
        return {"jitter_us": here.jitter.p50_p99(), **ways}

    def _way(self, receiver: str, sender: str) -> dict[str, Any]:
        there, other = self._sides[receiver], self._sides[sender]
        if there.ticks:
            total = there.received + there.lost
            return {
                "one_way_us": there.inward.p50_p99(),
                "received": there.received,
                "lost": there.lost,
                "loss": there.lost / total if total else None,
                "is_reported": False,
                "burst": there.burst.value,
            }
        return {
            "one_way_us": other.outward.p50_p99(),
            "received": None,
            "lost": None,
            "loss": other.reported_loss.value,
            "is_reported": True,
            "burst": None,
        }


def ways_now(last: Mapping[str, Any]) -> dict[str, Any]:
    """The same of the newest records.

    Args:
        last: the newest record of each side that has one.
    """
    here = last.get(MASTER) if MASTER in last else last.get(SLAVE)
    ways = {name: _way_now(last.get(receiver), last.get(sender)) for name, (receiver, sender) in WAYS.items()}
    return {"jitter_us": None if here is None else _known(here["jitter_us"]), **ways}


def _way_now(there: Any, other: Any) -> dict[str, Any]:
    if there is not None:
        return {
            "one_way_us": _known(there["one_way_us"]),
            "loss": _known(there["incoming_loss"]),
            "burst": float(there["peer_burst"]) or None,
        }
    if other is None:
        return {"one_way_us": None, "loss": None, "burst": None}
    outward = float(other["rtt_us"]) - float(other["one_way_us"])
    return {"one_way_us": _known(outward), "loss": _known(other["outgoing_loss"]), "burst": None}


def _known(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
