"""The figures of the link: how long each side was in session, and each way apart: delay, loss, bursts, and jitter.

A way is measured by the side that receives. Where that side's records are on another host, its delay follows from the
round trip, which is the sum of both, and its loss is what that side reported.
"""

from dataclasses import dataclass, field

import numpy as np

from weberlink.figures.channel import Records, engaged
from weberlink.figures.distribution import Distribution
from weberlink.figures.tree import Connection, Way, Ways
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
    """

    def __init__(self) -> None:
        self._phase = WAITING  # the present one, or that before the end
        self._seconds = dict.fromkeys((WAITING, CONNECTED, UNCONNECTED, AWAY), 0.0)
        self._last: tuple[float, int] | None = None
        self._heard_at = -np.inf
        self._since = 0.0  # duration of the present phase [s]
        self._interruptions = 0

    def add(self, records: Records) -> None:
        """Take the next records, in order."""
        if not len(records):
            return
        at, states = records["at"], records["state"]
        starts = np.flatnonzero(states[1:] != states[:-1]) + 1
        for index in sorted({0, *(starts - 1).tolist(), *starts.tolist(), len(records) - 1}):
            self._enter(float(at[index]), int(states[index]))

    def figures(self) -> Connection:
        return Connection(
            waited_s=self._seconds[WAITING],
            connected_s=self._seconds[CONNECTED],
            unconnected_s=self._seconds[UNCONNECTED],
            interruptions=self._interruptions,
            away_s=self._seconds[AWAY],
            ended=self._phase,
            last_s=self._since,
        )

    def _enter(self, at: float, state: int) -> None:
        """Count up to a record, and take its state."""
        if self._last is not None:
            before, last = self._last
            if last == _CLOSED:
                return
            self._seconds[self._phase] += at - before
            self._since += at - before
            if last == _ENGAGED:
                self._heard_at = before
        self._last = (at, state)
        phase = self._phase
        if state in (_ENGAGED, _SILENT):
            phase = CONNECTED if state == _ENGAGED else UNCONNECTED
        elif state != _CLOSED and phase not in (WAITING, AWAY):
            phase = AWAY if at - self._heard_at < LEAVE_S else UNCONNECTED
        if phase != self._phase:
            self._interruptions += phase == UNCONNECTED
            self._phase, self._since = phase, 0.0


@dataclass
class WayScore:
    """What the records of one side say of both ways, in bounded memory."""

    inward: Distribution = field(default_factory=Distribution)
    outward: Distribution = field(default_factory=Distribution)
    jitter: Distribution = field(default_factory=Distribution)
    reported: tuple[float, int] = (0.0, 0)
    bursts: tuple[float, int] = (0.0, 0)  # sum and number of reported losses, and of runs of lost datagrams
    received: int = 0
    lost: int = 0
    ticks: int = 0

    def add(self, records: Records) -> None:
        """Take the next records of the side, in order."""
        if not len(records):
            return
        counted = records[engaged(records)]
        self.ticks += len(records)
        self.inward.add(counted["one_way_us"])
        self.outward.add(counted["rtt_us"] - counted["one_way_us"])
        self.jitter.add(counted["jitter_us"])
        losses, bursts = counted["outgoing_loss"], counted["peer_burst"]
        self.reported = _added(self.reported, losses[np.isfinite(losses)])
        self.bursts = _added(self.bursts, bursts[bursts > 0.0])
        self.received, self.lost = (int(records[-1][f"datagrams_{name}"]) for name in ("received", "lost"))


def _added(sums: tuple[float, int], values: Records) -> tuple[float, int]:
    return sums[0] + float(values.sum(dtype=np.float64)), sums[1] + len(values)


def ways_of(master: WayScore, slave: WayScore) -> Ways:
    """Both ways, from what was read of either side.

    A reported loss is the mean of what the receiving side reported while engaged, which is a recent share; else it
    counts every datagram.
    """

    def mean(total: float, count: int) -> float | None:
        return total / count if count else None

    def way(receiver: WayScore, sender: WayScore) -> Way:
        if not receiver.ticks:
            return Way(sender.outward.median(), mean(*sender.reported), is_reported=True, burst=None)
        total = receiver.received + receiver.lost
        loss = mean(receiver.lost, total)
        return Way(receiver.inward.median(), loss, is_reported=False, burst=mean(*receiver.bursts))

    here = master if master.ticks else slave
    return Ways(here.jitter.median(), to_slave=way(slave, master), to_master=way(master, slave))
