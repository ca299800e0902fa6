"""The figures of a session, from the telemetry of its two sides on one clock.

Owns the join of the two records and every number that needs both: what the operator felt against what the robot
measured. Fed in pieces, it keeps sums and histograms, so a session may last as long as it likes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from weberlink.control.table import SCHEMES
from weberlink.geometry.vector import Vector
from weberlink.protocol.states import State
from weberlink.system.scoring.distribution import Distribution
from weberlink.system.scoring.energy import LinkEnergy, PortWork, Records, Series
from weberlink.system.scoring.errors import Errors, known, tally

if TYPE_CHECKING:
    from weberlink.system.scoring.rotation import RotationScore

__all__ = ["Records", "SessionScore"]

LONGEST_WAIT_S = 10.0
"""How long a record waits for its counterpart; a side may run alone for days."""


@dataclass
class _Side:
    """What one side's records say by themselves."""

    ticks: int = 0
    engaged: int = 0
    limited: int = 0
    last: Any = None
    lateness: Distribution = field(default_factory=Distribution)
    work: Distribution = field(default_factory=Distribution)
    codec: Distribution = field(default_factory=Distribution)
    rtt: Distribution = field(default_factory=Distribution)
    one_way: Distribution = field(default_factory=Distribution)
    selected: dict[int, int] = field(default_factory=dict)
    schemes: dict[int, int] = field(default_factory=dict)
    tank: tuple[float, float] | None = None

    def add(self, records: Records) -> None:
        if not len(records):
            return
        self.ticks += len(records)
        self.engaged += int((records["state"] == State.ENGAGED.value).sum())
        self.limited += int((records["clipped"] > 0).sum())
        self.last = records[-1]
        for name in ("lateness", "work", "codec", "rtt", "one_way"):
            getattr(self, name).add(records[f"{name}_us"])
        tally(self.selected, records["selected"][records["sent"] > 0])
        tally(self.schemes, records["control"][records["state"] == State.ENGAGED.value])
        least, most = float(records["tank"].min()), float(records["tank"].max())
        self.tank = (least, most) if self.tank is None else (min(least, self.tank[0]), max(most, self.tank[1]))

    def counter(self, name: str) -> int:
        return 0 if self.last is None else int(self.last[name])

    def control(self) -> dict[str, Any]:
        """Ticks in session under each scheme, and how full the tank was [J]."""
        names = list(SCHEMES)
        least, most = self.tank if self.tank is not None else (None, None)
        return {
            "ticks": {names[scheme]: count for scheme, count in sorted(self.schemes.items())},
            "tank_min_j": least,
            "tank_max_j": most,
        }

    def timing(self) -> dict[str, Any]:
        return {
            "count": self.ticks,
            "missed": self.counter("ticks_missed"),
            "lateness_us": known(self.lateness.summary()),
            "work_us": known(self.work.summary()),
            "codec_us": known(self.codec.summary()),
        }


Measure = Callable[[Vector, Vector], float]


class SessionScore:
    """Joins the records of master and slave tick by tick, and sums up.

    The felt error of a slave tick is the force that the operator's device was told at the master's tick nearest in
    time, against the force that the robot measured. It is counted while both sides are engaged, but for the ramps at
    the beginning and the end of a session; a force that fades because the link is silent counts. `violation_max_jnd`
    and `violation_p99_jnd` are that error in units of its bound, over all ticks that count: the largest, and what 99 %
    of them do not exceed.

    Energy makes no such exception. `energy.generated_j` is the most that the operator had got out of the device beyond
    what had been put in, at any time: 0 where the hand touches something passive. `energy.dissipated_j` is what had
    gone in and not come out at the end. Both are the operator's port alone, in all its ticks. `energy.link_generated_j`
    is the same for the link between the ports, while both sides are engaged (`weberlink.system.scoring.energy`).

    Args:
        rate_hz: tick rate of both sides [Hz].
        bank: names of the force channel's predictors, in the order of selectors.
        torque_bank: likewise of the torque channel; None for a session of three degrees of freedom.
        measure: how the deadband of the force measures an error, of the displayed force and the actual one; None for
            their distance.
    """

    def __init__(
        self,
        rate_hz: float,
        bank: tuple[str, ...],
        torque_bank: tuple[str, ...] | None = None,
        measure: Measure | None = None,
    ) -> None:
        self._measure = measure
        self._period = 1.0 / rate_hz
        self._longest_wait = max(1, int(LONGEST_WAIT_S * rate_hz))
        self._bank = bank
        self._master, self._slave = _Side(), _Side()
        self._waiting: list[Records] = [np.empty(0), np.empty(0)]
        self._felt, self._coding, self._position = Errors(), Errors(), Errors()
        self._rotation: RotationScore | None = None
        turns = None
        if torque_bank is not None:
            self._rotation, turns = _rotation(self._period, torque_bank)
        self._ports = (
            PortWork("output", "raw", held=True, turns=turns),
            PortWork("raw", "output", held=False, turns=turns),
        )
        self._work: list[Series] = [np.empty(0), np.empty(0)]
        """Work at the port of each side, up to each of the waiting records [J]."""
        self._link_energy = LinkEnergy()
        self._first: float | None = None
        self._until = 0.0

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides, each in order of time; either may be empty or run ahead."""
        for side, index, records in ((self._master, 0, master), (self._slave, 1, slave)):
            side.add(records)
            if len(records):
                waiting = self._waiting[index]
                joined = np.concatenate([waiting, records]) if len(waiting) else records.copy()
                self._waiting[index] = joined[-self._longest_wait :]
                work = np.concatenate([self._work[index], self._ports[index].add(records)])
                self._work[index] = work[-self._longest_wait :]
                self._first = min(self._first if self._first is not None else np.inf, float(records["at"][0]))
                self._until = max(self._until, float(records["at"][-1]))
        own = slave[_in_session(slave)] if len(slave) else slave
        if len(own):  # the coding error needs no other side
            self._add_force(self._coding, own["decoded"], own["raw"], own["bound"])
        if self._rotation is not None:
            self._rotation.add(slave, own)
        self._join()

    @property
    def state(self) -> dict[str, Any]:
        """The newest record of each side, for a status line; None before the first."""
        return {"master": self._master.last, "slave": self._slave.last}

    def summary(self) -> dict[str, Any]:
        """All figures, under the keys that the commands document."""
        duration = self._until - self._first + self._period if self._first is not None else 0.0
        master, slave = self._master, self._slave
        return {
            "duration_s": duration,
            "ticks": {"master": master.timing(), "slave": slave.timing()},
            "force": self._channel(slave, master, duration, self._felt)
            | {
                "coding": self._coding.summary(self._period),
                "violation_floor": self._violation_floor(),
                "selected": {self._bank[i]: count for i, count in sorted(slave.selected.items())},
            },
            "position": self._channel(master, slave, duration, self._position),
            "link": {
                "rtt_us": _percentiles((master if master.ticks else slave).rtt),
                "one_way_us": _percentiles((master if master.ticks else slave).one_way),
                "sent": master.counter("datagrams_sent") + slave.counter("datagrams_sent"),
                "received": master.counter("datagrams_received") + slave.counter("datagrams_received"),
                "lost": master.counter("datagrams_lost") + slave.counter("datagrams_lost"),
                "dropped": master.counter("datagrams_dropped") + slave.counter("datagrams_dropped"),
                "repeats": master.counter("repeats") + slave.counter("repeats"),
            },
            "limited": {
                "force_ticks": master.limited,
                "slew_ticks": master.counter("slew_ticks"),
                "motion_ticks": slave.limited,
            },
            "control": {"master": master.control(), "slave": slave.control()},
            "energy": {
                "generated_j": max(0.0, -self._ports[0].least) if master.ticks else None,
                "dissipated_j": max(0.0, self._ports[0].total) if master.ticks else None,
                "link_generated_j": max(0.0, -self._link_energy.least) if self._felt.count else None,
            },
        } | ({} if self._rotation is None else self._rotation.summary(master, slave, duration))

    def _channel(self, sender: _Side, receiver: _Side, duration: float, errors: Errors) -> dict[str, Any]:
        """The figures of one direction; as seen by the receiver where the sender's records are on another host."""
        seen = sender if sender.ticks else receiver
        packets = seen.counter("updates_sent" if sender.ticks else "updates_received")
        datagrams = seen.counter("datagrams_sent" if sender.ticks else "datagrams_received")
        return {
            "samples": seen.engaged,
            "packets": packets,
            "packets_per_s": packets / duration if duration else None,
            "reduction": 1.0 - packets / seen.engaged if seen.engaged else None,
            "reduction_all": 1.0 - datagrams / seen.engaged if seen.engaged else None,
            "bytes_per_s": sender.counter("bytes_sent") / duration if sender.ticks and duration else None,
        } | errors.summary(self._period)

    def _violation_floor(self) -> float | None:
        """Sends per tick times latency in ticks: what an update cannot help, since it is felt a tick later at least."""
        if not self._slave.engaged:
            return None
        latency = self._master.one_way.percentile(50.0) * 1e-6 if self._master.one_way.count else 0.0
        return min(1.0, self._slave.counter("updates_sent") / self._slave.engaged * max(1.0, latency / self._period))

    def _join(self) -> None:
        master, slave = self._waiting
        if not (len(master) and len(slave)):
            return
        # Beyond this a nearer master tick may still come.
        ready = int(np.searchsorted(slave["at"], master["at"][-1] - 0.5 * self._period, side="right"))
        now, later = slave[:ready], slave[ready:]
        right = np.clip(np.searchsorted(master["at"], now["at"]), 1, max(1, len(master) - 1))
        left = right - 1
        right = np.minimum(right, len(master) - 1)
        nearest = np.where(now["at"] - master["at"][left] <= master["at"][right] - now["at"], left, right)
        matched = master[nearest]
        given, taken = self._work[0][nearest], self._work[1][:ready]
        passed = max(0, int(nearest[-1]) - 1) if ready else 0
        self._waiting = [master[passed:], later]
        self._work = [self._work[0][passed:], self._work[1][ready:]]
        self._link_energy.add(given, taken, _engaged(matched) & _engaged(now))
        close = np.abs(matched["at"] - now["at"]) <= 0.75 * self._period
        counts = close & _in_session(matched) & _in_session(now)
        self._compare(matched[counts], now[counts])

    def _add_force(self, errors: Errors, displayed: Series, actual: Series, bound: Series) -> None:
        deviations = None
        if self._measure is not None:
            pairs = zip(displayed.tolist(), actual.tolist(), strict=True)
            deviations = np.array([self._measure(tuple(one), tuple(other)) for one, other in pairs], dtype=np.float64)
        errors.add(_distance(displayed, actual), bound, deviations)

    def _compare(self, master: Records, slave: Records) -> None:
        self._add_force(self._felt, master["output"], slave["raw"], slave["bound"])
        self._position.add(_distance(slave["output"], master["raw"]), master["bound"])
        if self._rotation is not None:
            self._rotation.compare(master, slave)


def _rotation(period: float, bank: tuple[str, ...]) -> tuple["RotationScore", Callable[[Any], Series]]:
    """Its figures, and how it turns from tick to tick."""
    from weberlink.system.scoring.rotation import RotationScore, turns  # noqa: PLC0415 - for six degrees of freedom alone

    return RotationScore(period, bank), turns


def _engaged(records: Records) -> NDArray[np.bool_]:
    engaged: NDArray[np.bool_] = records["state"] == State.ENGAGED.value
    return engaged


def _in_session(records: Records) -> NDArray[np.bool_]:
    """Ticks that say how well the link works: engaged, and neither fading in nor out."""
    counts: NDArray[np.bool_] = _engaged(records) & (records["ramping"] == 0)
    return counts


def _distance(a: Series, b: Series) -> Series:
    return np.asarray(np.linalg.norm(a - b, axis=1), dtype=np.float64)


def _percentiles(histogram: Distribution) -> dict[str, float | None]:
    return known({"p50": histogram.percentile(50.0), "p99": histogram.percentile(99.0)})
