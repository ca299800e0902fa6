"""The faults: what each does to the session, and the law that must hold meanwhile.

A fault returns what broke its own law. Whether the session must live through it, and how soon it must be back, is in
the table `FAULTS`; what may last meanwhile is in `CONDITIONS`.
"""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from random import Random
from time import monotonic, sleep

from tests.program import ENGAGED
from trials.rig import LINK, Session, Side
from trials.soak import laws
from trials.soak.volley import KINDS, load as load_gun, volley
from trials.soak.watch import Watch, cpu_seconds
from weberlink.config import MASTER, SIDES, SLAVE
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.endpoint import LONGEST_QUIET
from weberlink.protocol.keys import load as load_key

NOISE = Emulation(delay_s=0.004, jitter_s=0.006, loss=0.05, reorder=0.05, duplicate=0.05, corrupt=0.05)
DELAY = Emulation(delay_s=0.025, jitter_s=0.004)
# A round trip that rises at once by more than a quarter of the silence limit interrupts the session.
BURSTS = Emulation(delay_s=0.002, loss=0.3, burst=8.0)
CUT = Emulation(loss=1.0)
QUICK_S, RESTART_S = 3.0, 60.0
"""From the end of a fault to a session, and from the start of a daemon to one, which a busy machine delays."""
HISTORY_S = 2.0  # of a session, before there is something to send again
BURST, BURST_S = 240, 0.003  # datagrams that fit the buffer of a socket, and how long it takes to send them [s]
STUTTER_SHARE = 0.33
SURELY_S, LATE_S = 0.3, 0.1
"""Beyond the limit: until all have noticed for sure, and how late a shared machine may be in a tick [s]."""
RECORDED, CALLS_PER_S, CALLS_S = 10_000, 20_000, 5.0  # calls in a long recording
FLOOD_PER_S = 50_000
MOST_CORE = 0.75  # of a core that a daemon may take during a flood
THIEF, CALLER = "127.0.0.4", ("127.0.0.3", 0)
BURN = """
import os, sys, time
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:])
end = time.monotonic() + 40.0
while time.monotonic() < end:
    sum(range(10_000))
"""


@dataclass
class Field:
    rig: Session
    watch: Watch
    random: Random
    short: bool  # whether each fault is to last no longer than it must
    notes: dict[str, int] = field(default_factory=dict)  # counts that a fault reports beside violations
    ended_at: float | None = None  # when the way back began, if not when the fault returned [s]

    def lasting(self, short: float, least: float, most: float) -> float:
        return short if self.short else self.random.uniform(least, most)


Inject = Callable[[Field], list[str]]


@dataclass(frozen=True)
class Fault:
    inject: Inject  # does it, and returns what broke its own law
    keeps: bool = False  # whether the session is to live through it
    limit_s: float = QUICK_S  # from its end to a session
    rare: bool = False  # left out of most rounds, so that daemons live long enough to see growth


def emulated(emulation: Emulation) -> Inject:
    def inject(at: Field) -> list[str]:
        at.rig.wire.emulate(emulation)
        at.watch.wait(at.lasting(1.5, 3.0, 12.0))
        return []

    return inject


def cut(way: str) -> Inject:
    """Nothing gets through; `way` is "forward", "backward", or "" for both."""

    def inject(at: Field) -> list[str]:
        since = monotonic()
        at.rig.wire.emulate(CUT, way)
        at.watch.wait(at.rig.limit + at.lasting(0.4, SURELY_S, 4.0))
        return laws.rests(at.watch.both(), since + at.rig.limit + LATE_S)

    return inject


def replay(at: Field) -> list[str]:
    """Genuine datagrams of this session again, to both ends: old ones, and some that are not stale."""
    at.watch.wait(HISTORY_S)
    sent = 0
    for turn in range(4 if at.short else 20):
        now = monotonic()
        sent += at.rig.wire.ask("replay", "", 200, 0.0 if turn % 2 else now - 0.5 * at.rig.silence, now - 0.01)
        at.watch.wait(0.1)
    at.notes["datagrams replayed"] = sent
    records = at.watch.both().values()
    dropped = sum(int(of["datagrams_dropped"][-1]) - int(of["datagrams_dropped"][0]) for of in records)
    return [] if 0 < sent <= dropped else [f"{sent} datagrams were replayed, and {dropped} refused"]


def other(side: str) -> str:
    return SLAVE if side == MASTER else MASTER


def killed(side: str) -> Inject:
    def inject(at: Field) -> list[str]:
        since = monotonic()
        at.watch.bury(at.rig.kill(side))
        away = at.lasting(0.6, 0.05, 3.0)
        at.watch.wait(away)
        found = []
        if away > at.rig.limit + SURELY_S / 2:
            found = laws.rests({other(side): at.watch.seen(other(side))}, since + at.rig.limit + LATE_S)
        at.ended_at = monotonic()
        begun = at.rig.start(side)
        if not at.watch.until(lambda: begun.ring is not None, RESTART_S):
            return [*found, f"the {side} did not start again"]
        return found

    return inject


def stopped(side: str) -> Inject:
    def inject(at: Field) -> list[str]:
        seconds, limit, since = at.lasting(0.8, 0.05, 5.0), at.rig.limit, monotonic()
        at.rig.sides[side].signal(signal.SIGSTOP)
        try:
            at.watch.wait(seconds)
        finally:
            at.rig.sides[side].signal(signal.SIGCONT)
        if seconds <= limit + SURELY_S:
            return []
        found = laws.rests({other(side): at.watch.seen(other(side))}, since + limit + LATE_S)
        at.watch.wait(0.2)
        limits, robot = at.rig.configuration.system.master.limits, at.rig.configuration.system.slave.limits
        rise = limits.force_n / (limits.ramp_ms * 1e-3) if side == MASTER else robot.approach_speed_m_s
        return found + laws.wakes_gently(at.watch.seen(side), side, most=0.1 * rise)

    return inject


def stutter(at: Field) -> list[str]:
    """Either daemon stands still for much less than the silence limit, in the middle of reading what is replayed."""
    found, judged = [], 0
    at.watch.wait(HISTORY_S)
    for turn in range(6 if at.short else 20):
        side, way = ((MASTER, "backward"), (SLAVE, "forward"))[turn % 2]
        at.watch.begin()
        with at.rig.wire.replaying(way, BURST, monotonic() - 0.01):
            sleep(at.random.uniform(0.0, BURST_S))
            at.rig.sides[side].signal(signal.SIGSTOP)
            sleep(STUTTER_SHARE * at.rig.silence)
            at.rig.sides[side].signal(signal.SIGCONT)
        at.watch.wait(1.5 * at.rig.silence)
        if at.watch.stall() < 2.0 * STUTTER_SHARE * at.rig.silence:
            judged += 1
            found += [f"{text}, after {side} had stood still for a moment" for text in laws.stays(at.watch.both())]
    at.notes["stops of a third of the limit"] = judged
    return found


def moved(host: str) -> Inject:
    """The slave sees the master at another address from one datagram to the next, a few times."""

    def inject(at: Field) -> list[str]:
        before = at.watch.books()
        for _ in range(2 if at.short else 5):
            at.rig.wire.ask("rebind", host)
            at.watch.wait(at.lasting(0.4, 0.3, 2.0))
        after = at.watch.books()
        if at.watch.stall() > 0.5 * at.rig.silence:
            return []
        kept = (after.calls, after.answers) == (before.calls, before.answers)
        found = [] if kept else ["the session was not kept: there was a handshake"]
        answered = after.backward > before.backward
        return found if answered else [*found, "the slave never answered the new address"]

    return inject


@contextmanager
def burner(_: Field) -> Iterator[None]:
    """Another program takes a whole core at normal priority."""
    process = subprocess.Popen([sys.executable, "-c", BURN])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def busy_core(at: Field) -> list[str]:
    with burner(at):
        at.watch.wait(at.lasting(2.0, 10.0, 10.0))
    return []


@contextmanager
def rival(at: Field, *arguments: str) -> Iterator[Side]:
    """Another master with the same file and key, past the relay."""
    address = f"link.slave={LINK}:{at.rig.slave_address[1]}"
    with Side(MASTER, at.rig.file, "--duration", "60", "--set", address, *arguments) as made:
        yield made


def second_master(at: Field) -> list[str]:
    """Another master with the key calls the slave, which is in a session: it is refused, and is told why."""
    with rival(at) as second:
        at.watch.until(lambda: len(second.records) or second.status is not None, RESTART_S)
        at.watch.until(lambda: second.status is not None, at.lasting(1.5, 1.5, 6.0))
        records = second.records
        second.end()
        found = ["a second master was in a session"] * bool((records["state"] == ENGAGED).any())
        return found if "refused" in second.outcome else [*found, f"it was not refused: {second.outcome}"]


def take_over(at: Field) -> list[str]:
    """A second master that says so takes the slave over; the first one is told and ends."""
    first = at.rig.sides.pop(MASTER)
    with rival(at, "--take-over") as second:
        at.watch.until(lambda: second.first_engaged(0.0) or second.status is not None, RESTART_S)
        found = [] if second.first_engaged(0.0) else [f"the second master did not get the slave: {second.outcome}"]
        at.watch.until(lambda: first.status is not None, RESTART_S)
        if first.status is None:
            found.append("the first master goes on")
        second.end()
    first.end()
    if not found and "taken over" not in first.outcome:
        found.append(f"the first master was not told why: {first.outcome}")
    at.watch.bury(first)
    at.watch.begin()  # while the second master had the slave, the first one's records say nothing of the session
    at.ended_at = monotonic()
    at.rig.start(MASTER)
    return found


def stolen_path(at: Field) -> list[str]:
    """Somebody delivers a copy of each datagram from another address before it comes itself, and drops nothing."""
    at.rig.wire.emulate(Emulation(delay_s=0.003), "forward")
    at.rig.wire.ask("steal", THIEF)
    try:
        at.watch.wait(at.lasting(1.0, 1.0, 4.0))
    finally:
        stolen, probed = at.rig.wire.ask("steal", "")
    at.notes |= {"datagrams to the thief": stolen, "probes to the thief": probed}
    if at.watch.stall() > 0.5 * LONGEST_QUIET:
        return []  # after a pause the first to be heard may be the thief, and counts as a master that has moved
    return [f"{stolen} datagrams went to who copied the master's"] * (stolen > 0)


def flood(at: Field) -> list[str]:
    """Somebody sends 50,000 datagrams a second of one kind to one end."""
    rig, wire = at.rig, at.rig.wire
    kind = "forged" if at.short else at.random.choice(KINDS)
    side, way = at.random.choice(((SLAVE, "forward"), (MASTER, "backward")))
    at.watch.wait(1.0)
    books = wire.books()
    genuine = wire.ask("recorded_calls") if kind in ("handshake", "calls") else wire.ask("recall", way, RECORDED)
    if books.master is None or not genuine:
        at.notes["left out, nothing genuine was recorded"] = 1
        return []
    datagrams = load_gun(kind, genuine, at.random, load_key(rig.key)[0].key)
    target = rig.slave_address if side == SLAVE else books.master
    pid, began = rig.sides[side].daemon, monotonic()
    spent = cpu_seconds(pid)
    with volley(datagrams, target, CALLER, FLOOD_PER_S, at.lasting(1.0, 2.0, 5.0)) as gun:
        at.watch.until(gun.poll, RESTART_S)
        shots = gun.recv()
    core = (cpu_seconds(pid) - spent) / (monotonic() - began)
    at.notes[f"% of a core of the {side} during {kind}"] = round(100 * core)
    found = [f"the {side} took {100 * core:.0f} % of a core during {kind}"] * (core > MOST_CORE)
    return found + laws.answers_little(shots, is_proven=kind == "calls")


def many_calls(at: Field) -> list[str]:
    """HELLOs of earlier calls are sent again, 20,000 a second, while both ends start anew and call for a session."""
    rig, watch, wire = at.rig, at.watch, at.rig.wire
    # The master of a soak makes a few calls only; the others stand for a long recording.
    genuine = wire.ask("recorded_calls")
    recorded = genuine + load_gun("calls", genuine, at.random, load_key(rig.key)[0].key, calls=RECORDED)
    wire.emulate(CUT)
    for side in SIDES:
        watch.bury(rig.kill(side))
        rig.start(side)
    if not watch.until(lambda: all(side.last is not None for side in rig.sides.values()), RESTART_S):
        return ["a daemon did not start"]
    with volley(recorded, rig.slave_address, CALLER, CALLS_PER_S, CALLS_S) as gun:
        watch.wait(0.3)
        at.ended_at = opened = monotonic()
        wire.emulate(Emulation())
        is_back = watch.until(lambda: watch.engaged(opened), QUICK_S)
        at.notes["ms to the newest session"] = round(1e3 * (monotonic() - opened))
        if not at.short:
            gun.poll(CALLS_S + 10.0)
            at.ended_at = monotonic()
    return [] if is_back else [f"no new session within {QUICK_S} s while {CALLS_PER_S} recorded calls came a second"]


FAULTS: dict[str, Fault] = {
    "noise": Fault(emulated(NOISE), keeps=True),
    "bursts": Fault(emulated(BURSTS)),
    "delay": Fault(emulated(DELAY), keeps=True),
    "blackout": Fault(cut("")),
    "cut_to_slave": Fault(cut("forward")),
    "cut_to_master": Fault(cut("backward")),
    "replay": Fault(replay, keeps=True),
    "stopped_master": Fault(stopped(MASTER)),
    "stopped_slave": Fault(stopped(SLAVE)),
    "stutter": Fault(stutter),
    "new_port": Fault(moved("127.0.0.1"), keeps=True),
    "new_address": Fault(moved("127.0.0.2"), keeps=True),
    "busy_core": Fault(busy_core, keeps=True),
    "second_master": Fault(second_master, keeps=True),
    "take_over": Fault(take_over, limit_s=RESTART_S, rare=True),
    "stolen_path": Fault(stolen_path, keeps=True),
    "flood": Fault(flood, keeps=True),
    "many_calls": Fault(many_calls, limit_s=RESTART_S, rare=True),
    "killed_master": Fault(killed(MASTER), limit_s=RESTART_S, rare=True),
    "killed_slave": Fault(killed(SLAVE), limit_s=RESTART_S, rare=True),
}


@contextmanager
def link(at: Field, emulation: Emulation) -> Iterator[None]:
    at.rig.wire.emulate(emulation)
    yield


CONDITIONS: dict[str, Callable[[Field], AbstractContextManager[object]]] = {
    "noise": lambda at: link(at, NOISE),
    "delay": lambda at: link(at, DELAY),
    "busy_core": burner,
}
"""What faults happen under, when several come together."""
_LINK = {"noise", "delay", "bursts", "blackout", "cut_to_slave", "cut_to_master", "stolen_path", "many_calls"}
EXCLUDED = {"noise": _LINK, "delay": _LINK, "busy_core": {"busy_core"}}
"""Faults that cannot happen under a condition: they would replace it, or wait for it."""
