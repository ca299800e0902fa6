"""The figures of the link, each way apart: delay, loss and bursts, and the jitter of the worse of both.

A way is measured by the side that receives. Where that side's records are on another host, its delay follows from the
round trip, which is the sum of both, and its loss is what that side reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.distribution import Distribution
from weberlink.system.scoring.energy import Records

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
