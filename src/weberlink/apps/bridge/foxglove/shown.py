"""One session as it is shown: what its records become on the topics."""

from math import isfinite
from time import monotonic
from typing import Any

import numpy as np
from foxglove.messages import Log, LogLevel, SceneUpdate

from weberlink.apps.bridge.diagnostics import SideCondition
from weberlink.apps.bridge.foxglove import motion
from weberlink.apps.bridge.foxglove.channels import Channels
from weberlink.apps.bridge.foxglove.diagnostics import condition, diagnostics
from weberlink.apps.bridge.foxglove.primitives import moment
from weberlink.apps.bridge.foxglove.solids import reach_of, scene_update
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import Records
from weberlink.system.wording import ALARM, INFO, WARN
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recording.message import Origin
from weberlink.watching.events import SessionEvent
from weberlink.watching.rings import RingSource, RowSource, joined
from weberlink.watching.rows import FeltErrorPairs, Thinning, felt_errors
from weberlink.watching.session import WatchedSession

LEVELS = {INFO: LogLevel.Info, WARN: LogLevel.Warning, ALARM: LogLevel.Error}


class ShownSession:
    """A followed session, and what of it is still to be shown.

    Args:
        name: of the session.
        source: of its first side.
        channels: where it is shown.
    """

    def __init__(self, name: str, source: RingSource, channels: Channels) -> None:
        self._channels = channels
        self._rings: dict[str, RingSource] = {}
        self._handed: dict[str, RowSource] = {}
        """The same records, for the watched session: the follower has read the rings already."""
        self.watched = WatchedSession(name, self._hand(source))
        self._origins: dict[str, Origin] = {}
        self._conditions: dict[str, SideCondition] = {}
        self._note(source)
        self._new: dict[str, list[Records]] = {MASTER: [], SLAVE: []}
        self._newest: dict[str, tuple[Any, int]] = {}
        self._felt, self._thinning = FeltErrorPairs(source.rate_hz), Thinning(source.rate_hz)
        self._reach = reach_of(self.watched.hello()["scene"])
        self._told = 0

    def admit(self, source: RingSource) -> None:
        """Add the other side."""
        self.watched.admit(self._hand(source))
        self._note(source)

    def put(self, side: str, records: Records) -> None:
        """New records of a side, at least one: its ticks are shown at once, the rest in the next `show`."""
        self._handed[side].put(records)
        self._handed[side].written, self._handed[side].lost = self._rings[side].written, self._rings[side].lost
        self._conditions[side].take(records, monotonic())
        self._new[side].append(records)
        times = self._origins[side].log_times_ns(records["at"])
        self._newest[side] = records[-1], int(times[-1])
        self._channels.put_ticks(side, records, times.tolist())
        if side == SLAVE and self.watched.arm is None and self._channels.packets.has_sinks():
            update = motion.packets(records, times, self._reach)
            if update is not None:
                self._channels.packets.log(update, log_time=int(times[-1]))

    def end(self, side: str) -> None:
        """All records of a side were put."""
        self._handed[side].end(in_order=self._rings[side].in_order)

    def show(self) -> None:
        """Show what has come since the last call; events in any case."""
        self.watched.look(show=False)
        events = self.watched.log.since(self._told)
        self._told = self.watched.log.count
        for event in events:
            self._log(event)
        new = {side: joined(pieces) if pieces else np.empty(0, DTYPE) for side, pieces in self._new.items()}
        self._new = {MASTER: [], SLAVE: []}
        if any(map(len, new.values())):
            self._show_felt(new[MASTER], new[SLAVE])
            if self.watched.arm is None:
                self._show_bodies()
            else:
                self._show_arms()

    def scene(self, at_ns: int) -> SceneUpdate:
        """All that does not move."""
        robot = self.watched.description.get("system", {}).get("slave", {}).get("robot", {})
        return scene_update(self.watched.hello()["scene"], (robot.get("tool") or {}).get("points_m") or (), at_ns)

    def show_diagnostics(self, at_ns: int, now: float) -> None:
        """Show the condition of the session and of its sides; figures per second are those since the last call."""
        sides = [each.status(now) for each in self._conditions.values()]
        if self._channels.diagnostics.has_sinks():
            told = diagnostics([condition(self.watched), *sides], at_ns)
            self._channels.diagnostics.log(told, log_time=at_ns)

    def repeat_log(self, client: int) -> None:
        """Tell one client all events that were before."""
        for event in self.watched.log.events:
            self._log(event, client)

    def _hand(self, source: RingSource) -> RowSource:
        self._rings[source.side] = source
        self._handed[source.side] = RowSource(
            source.side,
            source.rate_hz,
            source.began,
            source.ring,
            wall_offset_s=source.wall_offset_s,
            description=source.description,
        )
        return self._handed[source.side]

    def _note(self, source: RingSource) -> None:
        self._conditions[source.side] = SideCondition(source, monotonic())
        wall_s = source.began + source.wall_offset_s
        self._origins[source.side] = Origin(source.side, source.rate_hz, wall_s, source.began)

    def _show_bodies(self) -> None:
        channels, newest = self._channels, self._newest
        at_ns = max(at for _, at in newest.values())
        for side, (record, at) in newest.items():
            if channels.poses[side].has_sinks():
                channels.poses[side].log(motion.pose_of(side, record, at), log_time=at)
        if channels.frames.has_sinks():
            channels.frames.log(motion.frames(newest), log_time=at_ns)
        if channels.bodies.has_sinks():
            channels.bodies.log(motion.bodies(newest, self._reach), log_time=at_ns)

    def _show_arms(self) -> None:
        assert self.watched.arm is not None
        for side, (record, at) in self._newest.items():
            if self._channels.joints[side].has_sinks():
                self._channels.joints[side].log(motion.joints_of(side, record, self.watched.arm, at), log_time=at)

    def _show_felt(self, master: Records, slave: Records) -> None:
        channel = self._channels.felt
        pairs = self._felt.add(master, self._thinning.choose(slave))
        if not (channel.has_sinks() and len(pairs[0])):
            return
        felt = felt_errors(*pairs, self.watched.measures, self.watched.arm)
        for *values, at in zip(*felt, self._origins[SLAVE].log_times_ns(pairs[1]["at"]).tolist(), strict=True):
            shown = dict(zip(("error", "bound", "deadbands"), values, strict=True))
            channel.log({name: float(value) for name, value in shown.items() if isfinite(value)}, log_time=at)

    def _log(self, event: SessionEvent, client: int | None = None) -> None:
        at_ns = round(event.wall * 1e9)
        line = Log(
            timestamp=moment(at_ns),
            level=LEVELS[event.level],
            message=event.text,
            name=event.side or "session",
        )
        self._channels.log.log(line, log_time=at_ns, sink_id=client)
