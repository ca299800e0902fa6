"""The figures of each way of the link apart: delay, loss, bursts, and jitter.

A way is measured by the side that receives. Where that side's records are on another host, its delay follows from the
round trip, which is the sum of both, and its loss is what that side reported.
"""

from dataclasses import dataclass, field

import numpy as np

from weberlink.telemetry.reader import Records
from weberlink_figures.channel import engaged
from weberlink_figures.distribution import Distribution
from weberlink_figures.tree import Way, Ways


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
