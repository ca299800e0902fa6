"""The faults: what each does to the rig, and the law that must hold meanwhile.

A fault returns what broke its own law. Whether the session must live through it, and how soon it must be back, is in
the table `FAULTS`.
"""

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic, sleep, time

from tests.soak import intruders, laws
from tests.soak.conditions import (
    DELAY,
    FULL_S,
    NOISE,
    SMALL_DISK_KIB,
    Field,
    MountError,
    burner,
    recording,
    small_disk,
)
from weberlink.protocol.emulation import Emulation
from weberlink.system.configuration import MASTER, SLAVE

QUICK_S, RESTART_S = 3.0, 20.0
"""From the end of a fault to a session, and from the start of a daemon to one: its imports take longest [s]."""
HOUR = 3600
_CLOCK_ERROR_S = 30.0
_HISTORY_S = 2.0
"""Of a session, before there is something to send again."""
_BURST, _BURST_S = 240, 0.003
"""Datagrams that fit the buffer of a socket, and how long it takes to send them [s]."""
_STUTTER_SHARE = 0.33
_SURELY_S = 0.3
"""Beyond the silence limit; what the machine may be late, and what was under way."""
_LATE_S = 0.1
"""By which a shared machine may be late in a tick."""


Inject = Callable[[Field], list[str]]


@dataclass(frozen=True)
class Fault:
    """One kind.

    Args:
        inject: does it, and returns what broke its own law.
        keeps: whether the session is to live through it.
        limit_s: from its end to a session.
        rare: whether it is left out of most rounds, so that the lives of the daemons are long enough to see growth.
    """

    inject: Inject
    keeps: bool
    limit_s: float = QUICK_S
    rare: bool = False


def _emulated(emulation: Emulation, short: float = 1.5) -> Inject:
    def inject(at: Field) -> list[str]:
        at.rig.wire.emulate(emulation)
        at.watch.wait(at.lasting(short, 3.0, 12.0))
        at.rig.wire.emulate(Emulation())
        return []

    return inject


def _cut(way: str) -> Inject:
    """Nothing gets through; `way` is "forward", "backward", or "" for both."""

    def inject(at: Field) -> list[str]:
        since = monotonic()
        at.rig.wire.emulate(Emulation(loss=1.0), way)
        at.watch.wait(at.rig.silence + at.lasting(0.4, _SURELY_S, 4.0))
        sides = at.watch.both()
        at.rig.wire.emulate(Emulation())
        return laws.rests(sides, since + at.rig.silence + _LATE_S)

    return inject


def flap(at: Field) -> list[str]:
    """The link is cut in one direction for half of each period."""
    way = at.random.choice(("forward", "backward"))
    period = 1.0 / at.random.uniform(1.0, 20.0)
    at.rig.wire.emulate(Emulation(blackouts=((0.0, 0.5 * period, period),)), way)
    at.watch.wait(at.lasting(1.0, 2.0, 8.0))
    at.rig.wire.emulate(Emulation())
    return []


def replay(at: Field) -> list[str]:
    """Genuine datagrams of this session again, to both ends."""
    at.watch.wait(_HISTORY_S)
    sent = 0
    for turn in range(4 if at.short else 20):
        now = monotonic()
        since = 0.0 if turn % 2 else now - 0.5 * at.rig.silence  # old ones, and some that are not stale
        sent += at.rig.wire.replay("", 200, since, now - 0.01)
        at.watch.wait(0.1)
    at.notes["datagrams replayed"] = sent
    records = at.watch.both()
    dropped = sum(int(of["datagrams_dropped"][-1] - of["datagrams_dropped"][0]) for of in records.values())
    if not sent:
        return ["there was nothing to replay"]
    return [] if dropped >= sent else [f"{sent} datagrams were replayed, and only {dropped} refused"]


def _held(way: str, side: str) -> Inject:
    """Datagrams to a side are held back beyond the silence limit, and then delivered, all of them too old."""
    still = ("position", "output") if side == SLAVE else ("output",)

    def inject(at: Field) -> list[str]:
        wire, watch, silence = at.rig.wire, at.watch, at.rig.silence
        wire.hold(way)
        try:
            if not watch.until(lambda: watch.state_of(side) != laws.ENGAGED, silence + 5.0):
                return [f"the {side} heard nothing for longer than the silence limit, and stayed in the session"]
            watch.wait(at.lasting(0.1, 0.1, 1.0))
            until = monotonic()
            # The youngest of them is too old by then; some come after a session that heard nothing has ended.
            watch.wait(silence + (0.1 if at.short else at.random.choice((0.1, 4.0 * silence, 5.0))))
            watch.begin()
            before = getattr(watch.books(), way)["handshakes"]
            watch.wait(0.05)
            released = wire.release_old(way, until)
            watch.wait(0.3)
            released -= getattr(watch.books(), way)["handshakes"] - before
            at.notes["stale datagrams delivered"] = released
            return laws.nothing_stale(watch.seen(side), released, still)
        finally:
            wire.release(way, deliver=False)

    return inject


def _killed(side: str) -> Inject:
    other = SLAVE if side == MASTER else MASTER

    def inject(at: Field) -> list[str]:
        since = monotonic()
        at.watch.bury(*at.rig.kill(side))
        away = at.lasting(0.5, 0.05, 3.0)
        at.watch.wait(away)
        found = []
        if away > at.rig.silence + _SURELY_S / 2:
            found = laws.rests({other: at.watch.seen(other)}, since + at.rig.silence + _LATE_S)
        at.ended_at = monotonic()
        life = at.rig.start(side)
        if not at.watch.until(lambda: life.started_wall_s is not None, RESTART_S):
            return [*found, f"the {side} did not start again"]
        wall, offset = life.started_wall_s, 0 if at.rig.wall is None else at.rig.wall.offset
        assert wall is not None
        if abs(wall - time() - offset) > _CLOCK_ERROR_S:
            found.append(f"the {side} began at {wall:.0f} by its wall clock, stepped to {time() + offset:.0f}")
        return found

    return inject


def _stopped(side: str) -> Inject:
    other = SLAVE if side == MASTER else MASTER

    def inject(at: Field) -> list[str]:
        seconds, silence = at.lasting(0.8, 0.05, 5.0), at.rig.silence
        since = monotonic()
        at.rig.signal(side, signal.SIGSTOP)
        try:
            at.watch.wait(seconds)
        finally:
            at.rig.signal(side, signal.SIGCONT)
        if seconds <= silence + _SURELY_S:
            return []
        found = laws.rests({other: at.watch.seen(other)}, since + silence + _LATE_S)
        at.watch.wait(0.2)
        system = at.rig.configuration.system
        limits, approach = system.master.limits, system.slave.limits.approach_speed_m_s
        most = 0.1 * (limits.force_n / (limits.ramp_ms * 1e-3) if side == MASTER else approach)
        return found + laws.wakes_gently(at.watch.seen(side), side, most=most)

    return inject


def stutter(at: Field) -> list[str]:
    """Either daemon stands still for a moment much shorter than the silence limit, in the middle of reading.

    It must not take longer to be heard again than it stood still: a few replayed datagrams see to it that it reads.
    """
    found, judged = [], 0
    at.watch.wait(_HISTORY_S)
    for turn in range(6 if at.short else 20):
        side, way = ((MASTER, "backward"), (SLAVE, "forward"))[turn % 2]
        at.watch.begin()
        with at.rig.wire.replaying(way, _BURST, monotonic() - 0.01):
            sleep(at.random.uniform(0.0, _BURST_S))
            at.rig.signal(side, signal.SIGSTOP)
            sleep(_STUTTER_SHARE * at.rig.silence)
            at.rig.signal(side, signal.SIGCONT)
        at.watch.wait(1.5 * at.rig.silence)
        if at.watch.stall() < 2.0 * _STUTTER_SHARE * at.rig.silence:
            judged += 1
            found += [f"{text}, after {side} had stood still for a moment" for text in laws.stays(at.watch.both())]
    at.notes["stops of a third of the limit"] = judged
    return found


def _moved(host: str) -> Inject:
    """The slave sees the master at another address from one datagram to the next, a few times."""

    def inject(at: Field) -> list[str]:
        before = at.watch.books()
        for _ in range(2 if at.short else 5):
            at.rig.wire.rebind(host)
            at.watch.wait(at.lasting(0.4, 0.3, 2.0))
        after = at.watch.books()
        if at.watch.stall() > 0.5 * at.rig.silence:
            return []
        found = laws.same_session(after.calls - before.calls, after.answers - before.answers)
        if after.backward["passed"] == before.backward["passed"]:
            found.append("the slave never answered the new address")
        return found

    return inject


def clock_step(at: Field) -> list[str]:
    """The wall clock of the daemons steps by an hour, and stays there."""
    wall = at.rig.wall
    if wall is None:
        at.notes["left out, no C compiler to make a wall clock with"] = 1
        return []
    found = []
    for offset in (HOUR, -HOUR) if at.short else at.random.sample([HOUR, -HOUR, 0], 2):
        wall.step(offset)
        at.watch.wait(at.lasting(0.5, 1.0, 4.0))
        shown = wall.witnessed()
        if abs(shown - offset) > _CLOCK_ERROR_S:
            found.append(f"the wall clock was stepped to {offset:+d} s, and a running process saw {shown:+.0f} s")
    return found


def stalled_disk(at: Field) -> list[str]:
    """The recorder is stopped as if its disk had not answered."""
    with recording(at) as recorder:
        at.watch.wait(1.0)
        os.kill(recorder.pid, signal.SIGSTOP)
        try:
            at.watch.wait(at.lasting(1.0, 3.0, 14.0))
        finally:
            os.kill(recorder.pid, signal.SIGCONT)
        at.watch.wait(0.5)
        return [] if recorder.running else ["the recorder ended after its disk had stalled"]


def full_disk(at: Field) -> list[str]:
    """The recording is on a disk that fills up; the recorder ends with it, and nothing else does."""
    try:
        with small_disk(at.rig.folder) as small:
            with recording(at, small) as recorder:
                is_full = at.watch.until(lambda: not recorder.running, FULL_S)
                outcome = str(recorder.finish().get("outcome")) if is_full else "it still runs"
            return [] if "space" in outcome else [f"a disk of {SMALL_DISK_KIB} KiB was full; the recorder: {outcome}"]
    except MountError as refused:
        at.notes[f"left out, {refused}"] = 1
        return []


def busy_core(at: Field) -> list[str]:
    """Another program takes a whole core."""
    seconds = at.lasting(2.0, 10.0, 10.0)
    with burner(seconds):
        at.watch.wait(seconds + 0.2)
    return []


FAULTS: dict[str, Fault] = {
    "noise": Fault(_emulated(NOISE), keeps=True),
    "bursts": Fault(_emulated(Emulation(delay_s=0.002, loss=0.3, burst=8.0)), keeps=False),
    "delay": Fault(_emulated(DELAY), keeps=True),
    "blackout": Fault(_cut(""), keeps=False),
    "cut_to_slave": Fault(_cut("forward"), keeps=False),
    "cut_to_master": Fault(_cut("backward"), keeps=False),
    "flap": Fault(flap, keeps=False),
    "replay": Fault(replay, keeps=True),
    "held_to_slave": Fault(_held("forward", SLAVE), keeps=False),
    "held_to_master": Fault(_held("backward", MASTER), keeps=False),
    "stopped_master": Fault(_stopped(MASTER), keeps=False),
    "stopped_slave": Fault(_stopped(SLAVE), keeps=False),
    "stutter": Fault(stutter, keeps=False),
    "new_port": Fault(_moved("127.0.0.1"), keeps=True),
    "new_address": Fault(_moved("127.0.0.2"), keeps=True),
    "clock_step": Fault(clock_step, keeps=True),
    "stalled_disk": Fault(stalled_disk, keeps=True),
    "full_disk": Fault(full_disk, keeps=True),
    "busy_core": Fault(busy_core, keeps=True),
    "second_master": Fault(intruders.second_master, keeps=True),
    "take_over": Fault(intruders.take_over, keeps=False, limit_s=RESTART_S, rare=True),
    "stolen_path": Fault(intruders.stolen_path, keeps=True),
    "flood": Fault(intruders.flood, keeps=True),
    "many_calls": Fault(intruders.many_calls, keeps=False, limit_s=RESTART_S, rare=True),
    "killed_master": Fault(_killed(MASTER), keeps=False, limit_s=RESTART_S, rare=True),
    "killed_slave": Fault(_killed(SLAVE), keeps=False, limit_s=RESTART_S, rare=True),
}
