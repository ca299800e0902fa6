"""The figures of a session, from the telemetry records of its two sides on one clock.

Records come in pieces; sums and histograms take bounded memory, so a session may have any length.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband.contract import Measures
from weberlink.config import System
from weberlink.control.contract import AccountParameters
from weberlink.figures.channel import (
    ChannelScore,
    UpdatesOnTheirWay,
    angles_between,
    distances,
    engaged,
    in_session,
    none_for_nan,
    tally,
    turns,
)
from weberlink.figures.distribution import Distribution
from weberlink.figures.energy import EnergyBound, LinkEnergy, PortWork, Records, Series, accounts_in
from weberlink.figures.felt import AlignedError, JumpsOfRecords, QualityStatistics
from weberlink.figures.link import ConnectionScore, WaysScore
from weberlink.session.composition.channels import banks, measures_of
from weberlink.telemetry.fault import Fault

if TYPE_CHECKING:
    from weberlink.figures.arm import ArmLayout, AxesScore

__all__ = ["Records", "SessionScore", "nearest_ticks"]

LONGEST_WAIT_S = 10.0
"""How long a record waits for its counterpart; one side may run alone for days."""
MARGIN_S = 1.0
"""Records of the slave belong to the session from this long before the first one of the master to this long after the
last."""
ANOTHER_CLOCK_S = 0.1
"""A larger jump of the clock of the peer means another peer, or a restart of it."""
LATEST_S = 1e10
"""Upper limit of plausible times and durations [s]: three centuries."""


@dataclass
class _SideScore:
    """The figures of the records of one side."""

    ticks: int = 0
    engaged: int = 0
    limited: int = 0
    missed_in_a_row: int = 0
    last: Any = None
    lateness: Distribution = field(default_factory=Distribution)
    work: Distribution = field(default_factory=Distribution)
    codec: Distribution = field(default_factory=Distribution)
    rtt: Distribution = field(default_factory=Distribution)
    one_way: Distribution = field(default_factory=Distribution)
    faults: dict[int, int] = field(default_factory=dict)
    connection: ConnectionScore = field(default_factory=ConnectionScore)

    def add(self, records: Records) -> None:
        if not len(records):
            return
        self.ticks += len(records)
        counted = engaged(records)
        self.engaged += int(counted.sum())
        self.limited += int((records["clipped"] > 0).sum())
        missed = np.diff(records["ticks_missed"].astype(np.int64), prepend=self.counter("ticks_missed"))
        self.missed_in_a_row = max(self.missed_in_a_row, int(missed.max()))
        fault = records["fault"]
        begins = np.diff(fault, prepend=np.uint8(self.counter("fault"))) != 0
        tally(self.faults, fault[begins & (fault > 0)])
        self.connection.add(records)
        self.last = records[-1]
        for name in ("lateness", "work", "codec", "rtt", "one_way"):
            getattr(self, name).add(records[f"{name}_us"])

    def counter(self, name: str) -> int:
        """The last value of a cumulative field."""
        return 0 if self.last is None else int(self.last[name])

    def fault_counts(self) -> dict[str, int]:
        """How often the records of each fault began, by name."""
        return {Fault(number).name.lower(): count for number, count in sorted(self.faults.items())}

    def timing(self, period: float) -> dict[str, Any]:
        return {
            "count": self.ticks,
            "missed": self.counter("ticks_missed"),
            "missed_longest_s": self.missed_in_a_row * period,
            "lateness_us": none_for_nan(self.lateness.summary()),
            "work_us": none_for_nan(self.work.summary()),
            "codec_us": none_for_nan(self.codec.summary()),
        }


class SessionScore:
    """Joins the records of master and slave tick by tick, and sums up.

    The felt error of a slave tick is the force commanded to the device of the operator at the master tick nearest in
    time, against the force that the robot measured. Ticks count while both sides are engaged, except for the ramps at
    the beginning and the end of a session; a force that fades because the link is silent counts. `error_max_deadbands`
    and `error_p99_deadbands` are that error in units of its bound: the largest, and the 99th percentile.

    `widened_fraction` is the share of the sender's ticks in which a bounded rate of updates widened the deadband, and
    `widened_max` the largest deadband then.

    The measures in JND are of the force that the operator felt, for a person of the default threshold
    (`weberlink.figures.felt`). Jumps need the records of the master only.

    `aligned_rms` of the felt channel is the least RMS of its error against what the robot measured a lag before, and
    `aligned_lag_s` that lag: positive where the robot measured it before it was felt. It is of the axis of an arm whose
    error is largest then.

    Energy counts in all ticks. `energy.generated_j` is the largest energy that the operator had taken from the device
    beyond what had been put in, at any time: 0 for a passive environment. `energy.dissipated_j` is the energy that had
    gone in and not come out at the end. Both are of the port of the operator. `energy.bound_share` is the largest share
    of what the accounts allowed to come out there by then that did, above 1 if they did not hold, and `energy.bound_j`
    what they allowed then (`weberlink.figures.energy`); None without accounts. `energy.link_generated_j` is the
    energy that the link between the ports generated, while errors count too (`weberlink.figures.energy`).

    `violation_floor` is the share of the ticks of the felt error that no codec can keep within the deadband, because an
    update is on its way (`weberlink.figures.channel.UpdatesOnTheirWay`).

    `connection` says of each side how long it waited for its first session, was connected, unconnected (silent, or lost
    by silence) and away (left by the peer in order), and in `ended` and `last_s` which of these it was at the end.
    `faults` counts how often records with each fault began.

    Args:
        rate_hz: tick rate of both sides [Hz].
        bank: names of the predictors of the force channel, in the order of selectors.
        torque_bank: the same of the torque channel; None for a session of three degrees of freedom.
        measures: how the deadband of the force measures an error; None for the distance.
        arm: the axes of a session in joint space; None for a session in Cartesian space. Its channels are
            `joint_torque`, `joint_angle` and, with a gripper, `gripper_torque` and `gripper_angle`.
        accounts: of the energy out of the hand (`weberlink.figures.energy.accounts_in`); empty for none.
    """

    def __init__(
        self,
        rate_hz: float,
        bank: tuple[str, ...],
        torque_bank: tuple[str, ...] | None = None,
        measures: Measures | None = None,
        arm: "ArmLayout | None" = None,
        accounts: Sequence[AccountParameters] = (),
    ) -> None:
        self._period = 1.0 / rate_hz
        self._longest_wait = max(1, int(LONGEST_WAIT_S * rate_hz))
        self._sides = (_SideScore(), _SideScore())
        self._waiting: list[Records] = [np.empty(0), np.empty(0)]
        self._quality, self._jumps = QualityStatistics(self._period), JumpsOfRecords()
        self._is_arm = arm is not None
        self._from_slave: Mapping[str, ChannelScore | AxesScore]
        self._from_master: Mapping[str, ChannelScore | AxesScore]
        self._bound = EnergyBound(accounts) if accounts else None
        if arm is None:
            self._from_slave, self._from_master = cartesian_channels(self._period, bank, torque_bank, measures)
            turning = None if torque_bank is None else turns
            self._ports = (
                PortWork("output", "position", held=True, turns=turning, turning="rotation_raw", bound=self._bound),
                PortWork("raw", "output", held=False, turns=turning),
            )
        else:
            self._from_slave, self._from_master = arm.channels(self._period)
            self._ports = (
                PortWork("joint_output", "joint_position", held=True, bound=self._bound),
                PortWork("joint_raw", "joint_output", held=False),
            )
        self._felt = next(iter(self._from_slave))
        self._columns = ("output", "raw") if arm is None else ("joint_output", "joint_raw")
        self._axes = slice(0, 3 if arm is None else len(arm.names))
        self._aligned = AlignedError(self._period, self._axes.stop, each=self._is_arm)
        self._work: list[Series] = [np.empty(0), np.empty(0)]
        """Work at the port of each side, up to each of the waiting records [J]."""
        self._link_energy = LinkEnergy()
        self._on_its_way = UpdatesOnTheirWay(self._period)
        self._ways = WaysScore()
        self._first: float | None = None
        self._until = 0.0

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides, each in order of time; either may be empty or run ahead."""
        for index, (side, records) in enumerate((("master", master), ("slave", slave))):
            self._sides[index].add(records)
            self._ways.add(side, records)
            if len(records):
                waiting = self._waiting[index]
                joined = np.concatenate([waiting, records]) if len(waiting) else records.copy()
                self._waiting[index] = joined[-self._longest_wait :]
                work = np.concatenate([self._work[index], self._ports[index].add(records)])
                self._work[index] = work[-self._longest_wait :]
                self._first = min(self._first if self._first is not None else np.inf, float(records["at"][0]))
                self._until = max(self._until, float(records["at"][-1]))
        if len(master) and not self._is_arm:  # the JND of a torque at each joint is not known
            self._quality.add_jumps(*self._jumps.of(master))
        for records, channels in ((master, self._from_master), (slave, self._from_slave)):
            if len(records):  # these figures need no records of the other side
                counted = records[in_session(records)]
                for channel in channels.values():
                    channel.add_sender(records, counted)
        self._join()

    @property
    def state(self) -> dict[str, Any]:
        """The newest record of each side, for a status line; None before the first."""
        master, slave = self._sides
        return {"master": master.last, "slave": slave.last}

    def summary(self) -> dict[str, Any]:
        """All figures, under the keys that the commands document."""
        master, slave = self._sides
        duration = self._until - self._first + self._period if self._first is not None else 0.0
        heard = master if master.ticks else slave
        summary: dict[str, Any] = {
            "duration_s": duration,
            "ticks": {"master": master.timing(self._period), "slave": slave.timing(self._period)},
            **{name: {} for name in (*self._from_slave, *self._from_master)},
            "link": {
                "rtt_us": heard.rtt.p50_p99(),
                "one_way_us": heard.one_way.p50_p99(),
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
                "contact_ticks": slave.counter("contact_ticks"),
            },
            "connection": {
                "master": master.connection.summary() if master.ticks else None,
                "slave": slave.connection.summary() if slave.ticks else None,
            },
            "faults": {
                name: side.fault_counts() for name, side in (("master", master), ("slave", slave)) if side.ticks
            },
            "energy": {
                "generated_j": max(0.0, -self._ports[0].least) if master.ticks else None,
                "dissipated_j": max(0.0, self._ports[0].total) if master.ticks else None,
                "bound_j": self._bound.allowed if self._bound and master.ticks else None,
                "bound_share": self._bound.share if self._bound and master.ticks else None,
                "link_generated_j": (
                    max(0.0, -self._link_energy.least) if self._from_slave[self._felt].felt.count else None
                ),
            },
        }
        for name, channel in self._from_slave.items():
            summary[name] = _packets(slave, master, duration, name) | channel.summary()
        summary[self._felt] |= self._quality.summary() | {"violation_floor": self._on_its_way.share}
        aligned = self._aligned.best((summary["link"]["rtt_us"]["p99"] or 0.0) * 1e-6) or (None, None)
        summary[self._felt] |= dict(zip(("aligned_rms", "aligned_lag_s"), aligned, strict=True))
        for name, channel in self._from_master.items():
            summary[name] = _packets(master, slave, duration, name) | channel.summary()
        return summary

    def ways(self) -> dict[str, Any]:
        """The figures of the link, each way apart: see `WaysScore.summary`."""
        return self._ways.summary()

    def _join(self) -> None:
        master, slave = self._waiting
        if not (len(master) and len(slave)):
            return
        ready, nearest, close = nearest_ticks(master["at"], slave["at"], self._period)
        now, matched = slave[:ready], master[nearest]
        given, taken = self._work[0][nearest], self._work[1][:ready]
        passed = max(0, int(nearest[-1]) - 1) if ready else 0
        self._waiting = [master[passed:], slave[ready:]]
        self._work = [self._work[0][passed:], self._work[1][ready:]]
        self._link_energy.add(given, taken, in_session(matched) & in_session(now))
        counts = close & in_session(matched) & in_session(now)
        self._on_its_way.add(now, matched["one_way_us"], counts)
        matched, now = matched[counts], now[counts]
        felt, measured = (side[name][:, self._axes] for side, name in zip((matched, now), self._columns, strict=True))
        self._aligned.add(now["tick"], felt, measured)
        if not self._is_arm:
            displayed, measured = (np.asarray(each, dtype=np.float64) for each in (matched["output"], now["raw"]))
            magnitudes = (np.linalg.norm(each, axis=1) for each in (displayed, measured))
            self._quality.add(distances(displayed, measured), *magnitudes)
        for channel in self._from_slave.values():
            channel.compare(now, matched)
        for channel in self._from_master.values():
            channel.compare(matched, now)


def nearest_ticks(
    master_at: Series, slave_at: Series, period: float
) -> tuple[int, NDArray[np.intp], NDArray[np.bool_]]:
    """The tick of the master nearest in time to each tick of the slave.

    Args:
        master_at: times of ticks [s], at least one, in order.
        slave_at: the same.
        period: of a tick [s].

    Returns:
        The number n of slave ticks for which no nearer tick of the master can follow; for each of these the index of
        the nearest, shape (n,), and whether it belongs to the same moment, shape (n,).
    """
    ready = int(np.searchsorted(slave_at, master_at[-1] - 0.5 * period, side="right"))
    now = slave_at[:ready]
    right = np.minimum(np.maximum(np.searchsorted(master_at, now), 1), len(master_at) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(now - master_at[left] <= master_at[right] - now, left, right)
    return ready, nearest, np.abs(master_at[nearest] - now) <= 0.75 * period


def score_of(system: System) -> SessionScore:
    """The score of a session of this configuration."""
    dump, arm = system.model_dump(mode="json"), None
    if system.codec.joints is not None:
        from weberlink.figures.arm import arm_in  # noqa: PLC0415 - for arms alone

        arm = arm_in(dump)
    return SessionScore(system.rate_hz, *banks(system), measures_of(system), arm, accounts_in(dump))


def cartesian_channels(
    period: float, bank: tuple[str, ...], torque_bank: tuple[str, ...] | None, measures: Measures | None
) -> tuple[dict[str, ChannelScore], dict[str, ChannelScore]]:
    """The scores of the channels from the slave, the force first, and of those from the master."""
    from_slave = {"force": ChannelScore("", period, bank, measures=measures)}
    from_master = {"position": ChannelScore("", period)}
    if torque_bank is not None:
        from_slave["torque"] = ChannelScore("rotation_", period, torque_bank)
        from_master["orientation"] = ChannelScore("rotation_", period, error=angles_between)
    return from_slave, from_master


COUNTED = {"torque": "rotation_", "orientation": "rotation_", "gripper_torque": "gripper_", "gripper_angle": "gripper_"}
"""Prefix of the counters of a channel that is the second one of its direction."""


def _packets(sender: _SideScore, receiver: _SideScore, duration: float, channel: str) -> dict[str, Any]:
    """The packets of one channel; counted by the receiver where the sender's records are on another host."""
    seen = sender if sender.ticks else receiver
    prefix = COUNTED.get(channel, "")
    packets = seen.counter(f"{prefix}updates_{'sent' if sender.ticks else 'received'}")
    figures = {
        "samples": seen.engaged,
        "packets": packets,
        "packets_per_s": packets / duration if duration else None,
        "reduction": 1.0 - packets / seen.engaged if seen.engaged else None,
    }
    if prefix:  # datagrams carry both channels of a direction, and are counted with the other one
        return figures
    datagrams = seen.counter("datagrams_sent" if sender.ticks else "datagrams_received")
    return figures | {
        "reduction_all": 1.0 - datagrams / seen.engaged if seen.engaged else None,
        "bytes_per_s": sender.counter("bytes_sent") / duration if sender.ticks and duration else None,
    }
