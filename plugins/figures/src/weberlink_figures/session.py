"""The figures of a session, from the telemetry records of its two sides on one clock.

Live runs, virtual time, recordings and those who watch share this accumulator. Records come in pieces; sums and
histograms take bounded memory, so a session may have any length.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband import Measures
from weberlink.config import System
from weberlink.control.contract import AccountParameters
from weberlink.session.composition.channels import banks
from weberlink.session.summary import SessionCounts, SideCounts
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import AXES, TURNS
from weberlink_figures.channel import (
    ChannelScore,
    Series,
    Stream,
    UpdatesOnTheirWay,
    angles_between,
    arm_streams,
    distances,
    in_session,
    measures_in,
)
from weberlink_figures.distribution import Distribution
from weberlink_figures.energy import EnergyBound, PortWork, accounts_in
from weberlink_figures.felt import AlignedError, JumpsOfRecords, QualityStatistics
from weberlink_figures.link import WayScore, ways_of
from weberlink_figures.tree import Channel, Energy, Felt, Figures, Limited, Link, Ticks

__all__ = ["Layout", "Records", "SessionScore", "nearest_ticks", "score_of"]

LONGEST_WAIT_S = 10.0  # how long a record waits for its counterpart
MARGIN_S = 1.0
"""Records of the slave belong to the session from this long before the first one of the master to this long after the
last."""

Known = TypeVar("Known")


@dataclass(frozen=True)
class Layout:
    """What the records of a session mean.

    Args:
        rate_hz: tick rate of both sides [Hz].
        from_slave, from_master: the channels of a direction, in the order of their axes in a record. The operator feels
            the first one from the slave first.
        accounts: of the energy out of the hand; empty for none.
    """

    rate_hz: float
    from_slave: Sequence[Stream]
    from_master: Sequence[Stream]
    accounts: Sequence[AccountParameters] = ()

    @classmethod
    def hand(
        cls,
        rate_hz: float,
        bank: Sequence[str],
        torque_bank: Sequence[str] | None = None,
        measures: Measures | None = None,
        accounts: Sequence[AccountParameters] = (),
    ) -> Self:
        """That of a hand: names of the predictors of force and torque, None of three degrees of freedom; how the
        deadband of the force measures an error, None for the distance.
        """
        from_slave = [Stream("force", bank=tuple(bank), measures=measures)]
        from_master = [Stream("position")]
        if torque_bank is not None:
            from_slave.append(Stream("torque", TURNS, len(AXES), tuple(torque_bank)))
            from_master.append(Stream("orientation", TURNS, len(AXES), error=angles_between))
        return cls(rate_hz, from_slave, from_master, accounts)

    @classmethod
    def of(
        cls,
        dump: Mapping[str, Any],
        rate_hz: float,
        bank: Sequence[str],
        torque_bank: Sequence[str] | None,
        *,
        is_lenient: bool = False,
    ) -> Self:
        """That of the dump of a `System`, as descriptions and recordings hold it. A part that is missing or of another
        release is left out if lenient, else a ValueError.
        """

        def known(read: Callable[[Mapping[str, Any]], Known]) -> Known | None:
            try:
                return read(dump)
            except ValueError:
                if not is_lenient:
                    raise
                return None

        measures, accounts, arm = known(measures_in), known(accounts_in) or (), known(arm_streams)
        return cls(rate_hz, *arm, accounts) if arm else cls.hand(rate_hz, bank, torque_bank, measures, accounts)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes, as they follow each other in a record."""
        return tuple(name for stream in self.from_slave for name in stream.names)

    @property
    def joints(self) -> tuple[str, ...]:
        """The same of a session in joint space; none of a hand."""
        return () if self.from_slave[0].thresholds is None else self.axes

    def deadbands(self, slave: Records) -> Series:
        """What may stay unsent of the torque of each axis of an arm at each tick [N m], shape (n, axes)."""
        return np.hstack([stream.deadbands(slave) for stream in self.from_slave])


class _SideScore(SideCounts):
    """The figures of the records of one side."""

    def __init__(self) -> None:
        super().__init__()
        self.limited = self.missed_in_a_row = 0
        self.lateness, self.work, self.codec, self.rtt, self.one_way = (Distribution() for _ in range(5))
        self.ways = WayScore()

    def add(self, records: Records) -> None:
        self.limited += int((records["clipped"] > 0).sum())
        missed = np.diff(records["ticks_missed"].astype(np.int64), prepend=self.counter("ticks_missed"))
        self.missed_in_a_row = max(self.missed_in_a_row, int(missed.max()))
        self.ways.add(records)
        for name in ("lateness", "work", "codec", "rtt", "one_way"):
            getattr(self, name).add(records[f"{name}_us"])
        super().add(records)

    def figures(self, period: float) -> Ticks:
        return Ticks(
            count=self.ticks,
            missed=self.counter("ticks_missed"),
            missed_longest_s=self.missed_in_a_row * period,
            lateness_us=self.lateness.spread(),
            work_us=self.work.spread(),
            codec_us=self.codec.spread(),
        )


class SessionScore(SessionCounts[_SideScore]):
    """Joins the records of master and slave tick by tick, and sums up.

    The felt error of a slave tick is the force commanded to the device of the operator at the master tick nearest in
    time, against the force that the robot measured. Ticks count while both sides are engaged, except for the ramps at
    the beginning and the end of a session; a force that fades because the link is silent counts. The measures in JND
    are of the force that the operator felt, for a person of the default threshold. Energy counts in all ticks.
    """

    def __init__(self, layout: Layout) -> None:
        self._period = period = 1.0 / layout.rate_hz
        super().__init__(period, _SideScore)
        self._pairs = TickPairs(layout.rate_hz)
        directions = (layout.from_slave, layout.from_master)
        self._from_slave, self._from_master = ([ChannelScore(each) for each in streams] for streams in directions)
        self._felt = self._from_slave[0]
        self._is_arm = bool(layout.joints)
        self._quality, self._jumps = QualityStatistics(period), JumpsOfRecords()
        self._aligned = AlignedError(period, len(self._felt.stream.names), each=self._is_arm)
        self._on_its_way = UpdatesOnTheirWay(period)
        self._bound = EnergyBound(layout.accounts) if layout.accounts else None
        self._port = PortWork(rotates=len(layout.from_slave) > 1 and not self._is_arm, bound=self._bound)

    def add(self, master: Records, slave: Records) -> None:
        super().add(master, slave)
        for records, channels in ((master, self._from_master), (slave, self._from_slave)):
            if not len(records):
                continue
            counted = records[in_session(records)]
            for channel in channels:  # what the sender tells needs no records of the other side
                channel.add_sender(records, counted)
        if len(master):
            self._port.add(master)
            if not self._is_arm:  # the JND of a torque at each joint is not known
                self._quality.add_jumps(*self._jumps.of(master))
        matched, now, counts = self._pairs.add(master, slave)
        if len(now):
            self._add_pairs(matched, now, counts)

    def _add_pairs(self, matched: Records, now: Records, counts: NDArray[np.bool_]) -> None:
        """Take records of master and slave of the same moments, and which of them count for errors."""
        self._on_its_way.add(now, matched["one_way_us"], counts)
        matched, now = matched[counts], now[counts]
        stream = self._felt.stream
        displayed, measured = stream.of(matched, "output"), stream.of(now, "raw")
        self._aligned.add(now["tick"], displayed, measured)
        if not self._is_arm:
            magnitudes = (np.linalg.norm(each, axis=1) for each in (displayed, measured))
            self._quality.add(distances(displayed, measured), *magnitudes)
        for channel in self._from_slave:
            channel.compare(now, matched)
        for channel in self._from_master:
            channel.compare(matched, now)

    @property
    def state(self) -> dict[str, Any]:
        """The newest record of each side, for a status line; None before the first."""
        return {name: side.last for name, side in self.sides.items()}

    def figures(self) -> Figures:
        """All figures."""
        master, slave = self.sides.values()
        duration, heard = self.duration_s, master if master.ticks else slave
        counters = ("datagrams_sent", "datagrams_received", "datagrams_lost", "datagrams_dropped", "repeats")
        counts = (master.counter(name) + slave.counter(name) for name in counters)
        link = Link(heard.rtt.median(), heard.one_way.median(), *counts)
        energy = Energy(None, None, None, None)
        if master.ticks:
            bound = self._bound
            energy = Energy(
                generated_j=max(0.0, -self._port.least),
                dissipated_j=max(0.0, self._port.total),
                bound_j=bound.allowed if bound else None,
                bound_share=bound.share if bound else None,
            )
        lag = self._aligned.best((link.rtt_us.p99 or 0.0) * 1e-6) or (None, None)
        channels = {
            channel.stream.name: self._channel(channel, sender, receiver, duration)
            for scores, sender, receiver in ((self._from_slave, slave, master), (self._from_master, master, slave))
            for channel in scores
        }
        name = self._felt.stream.name
        channels[name] = replace(channels[name], felt=Felt(self._quality.figures(), self._on_its_way.share, *lag))
        return Figures(
            duration_s=duration,
            ticks={name: side.figures(self._period) for name, side in self.sides.items()},
            channels=channels,
            link=link,
            ways=ways_of(master.ways, slave.ways),
            limited=Limited(
                force_ticks=master.limited,
                slew_ticks=master.counter("slew_ticks"),
                motion_ticks=slave.limited,
                contact_ticks=slave.counter("contact_ticks"),
            ),
            connection=self.connections,
            faults=self.faults,
            energy=energy,
        )

    def _channel(self, channel: ChannelScore, sender: _SideScore, receiver: _SideScore, duration: float) -> Channel:
        """Packets are counted by the receiver where the sender's records are on another host."""
        seen, how = (sender, "sent") if sender.ticks else (receiver, "received")
        packets = seen.counter(channel.stream.field(f"updates_{how}"))
        # Which carry every channel of a direction.
        datagrams, is_first = seen.counter(f"datagrams_{how}"), not channel.stream.first
        return Channel(
            samples=seen.engaged,
            packets=packets,
            packets_per_s=packets / duration if duration else None,
            reduction=1.0 - packets / seen.engaged if seen.engaged else None,
            errors=channel.felt.figures(self._period),
            widened_fraction=channel.widened_fraction,
            widened_max=channel.widest,
            reduction_all=1.0 - datagrams / seen.engaged if is_first and seen.engaged else None,
            bytes_per_s=sender.counter("bytes_sent") / duration if is_first and sender.ticks and duration else None,
            coding=channel.coding.figures(self._period) if channel.stream.bank else None,
            selected=channel.selected,
            axes=channel.axes,
        )


class TickPairs:
    """Pairs each record of the slave with that of the master nearest in time.

    A record waits for its counterpart for a limited time; one side may run alone for days.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period, self._longest_wait = 1.0 / rate_hz, max(1, int(LONGEST_WAIT_S * rate_hz))
        self._master: Records | None = None
        self._slave: Records | None = None

    def add(self, master: Records, slave: Records) -> tuple[Records, Records, NDArray[np.bool_]]:
        """Take the next records of both sides, each in order of time; returns those of the master and of the slave,
        shape (n,) each, that make pairs, and whether they count for errors: of the same moment, in session and not in a
        ramp.
        """
        self._master, self._slave = (
            joined([each for each in (waiting, new) if each is not None and len(each)])[-self._longest_wait :]
            if len(new)
            else waiting
            for waiting, new in ((self._master, master), (self._slave, slave))
        )
        if self._master is None or self._slave is None or not (len(self._master) and len(self._slave)):
            return master[:0], slave[:0], np.empty(0, np.bool_)
        ready, nearest, close = nearest_ticks(self._master["at"], self._slave["at"], self._period)
        now, matched = self._slave[:ready], self._master[nearest]
        self._slave = self._slave[ready:]
        if ready:
            self._master = self._master[max(0, int(nearest[-1]) - 1) :]
        return matched, now, close & in_session(matched) & in_session(now)


def joined(pieces: Sequence[Records]) -> Records:
    """Concatenate records of the same fields, one piece or more, into one read-only array.

    Via bytes: `np.concatenate` first finds the common type of forty fields, which takes thirty times as long.
    """
    return np.frombuffer(b"".join([piece.tobytes() for piece in pieces]), pieces[0].dtype)


def nearest_ticks(
    master_at: Series, slave_at: Series, period: float
) -> tuple[int, NDArray[np.intp], NDArray[np.bool_]]:
    """The tick of the master nearest in time to each tick of the slave; times [s] of one tick or more, in order.

    Returns the number n of slave ticks for which no nearer tick of the master can follow; for each of these the index
    of the nearest, shape (n,), and whether it belongs to the same moment, shape (n,).
    """
    ready = int(np.searchsorted(slave_at, master_at[-1] - 0.5 * period, side="right"))
    now = slave_at[:ready]
    right = np.minimum(np.maximum(np.searchsorted(master_at, now), 1), len(master_at) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(now - master_at[left] <= master_at[right] - now, left, right)
    return ready, nearest, np.abs(master_at[nearest] - now) <= 0.75 * period


def score_of(system: System) -> SessionScore:
    """The score of a session of this configuration."""
    return SessionScore(Layout.of(system.model_dump(mode="json"), system.rate_hz, *banks(system)))
