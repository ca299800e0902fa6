"""Faults caused by others: a second master, an attacker who copies datagrams, recorded calls."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from time import monotonic, time_ns
from typing import Self

from tests.soak import laws
from tests.soak.ammunition import KINDS, load
from tests.soak.conditions import Field
from tests.soak.processes import cpu_seconds
from tests.soak.rig import LINK, Rig
from tests.soak.volley import volley
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.handshake import read_hello_header
from weberlink.protocol.keys import load as load_key
from weberlink.protocol.states import State
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

START_S = 20.0
"""From the start of a program to its first tick: its imports take longest [s]."""
NEW_SESSION_S = 3.0
RECORDED, CALLS_PER_S = 10_000, 20_000
"""Calls in a long recording."""
CALLS_S = 5.0
FLOOD_PER_S = 50_000
MOST_CORE = 0.75
"""Of a core that a daemon may take during a flood."""
THIEF, CALLER = "127.0.0.4", ("127.0.0.3", 0)


class Rival:
    """Another master or slave with the same file and key, started by its command, for as long as the `with` lasts.

    Attributes:
        engaged: ticks that it spent in a session.
        ticks: that were seen.
        outcome: what its report says, once it has ended; "" if it gave none.
    """

    def __init__(self, rig: Rig, side: str, *arguments: str) -> None:
        self.engaged = self.ticks = 0
        self.outcome = ""
        self._reader: RingReader | None = None
        self._process = subprocess.Popen(
            [sys.executable, "-m", "weberlink", side, str(rig.file), "--json", "-", "--duration", "60", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self._ring = default_path(f"{self._process.pid}-{side}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def look(self) -> bool:
        """Read its telemetry; returns whether it is in a session now."""
        if self._reader is None:
            with suppress(FileNotFoundError):
                self._reader = RingReader(self._ring)
        if self._reader is None:
            return False
        states = self._reader.read()["state"]
        self.ticks += len(states)
        self.engaged += int((states == State.ENGAGED.value).sum())
        return len(states) > 0 and bool(states[-1] == State.ENGAGED.value)

    def end(self) -> None:
        """Stop it, if it still runs."""
        if self.outcome or self._process.stdout is None or self._process.stdout.closed:
            return
        self.look()
        if self.running:
            self._process.send_signal(signal.SIGTERM)
        try:
            output, errors = self._process.communicate(timeout=START_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            output, errors = self._process.communicate()
        with suppress(ValueError):
            self.outcome = str(json.loads(output).get("outcome", ""))
        self.outcome = self.outcome or errors.decode(errors="replace").strip()[-200:]
        if self._reader is not None:
            self._reader.close()


def _follow(at: Field, rival: Rival, seconds: float) -> None:
    """Let a rival run for so long from its first tick on, or until it ends."""
    at.watch.until(lambda: rival.look() or rival.ticks > 0 or not rival.running, START_S)
    deadline = monotonic() + seconds
    at.watch.until(lambda: (rival.look() and False) or not rival.running or monotonic() > deadline, seconds)


def second_master(at: Field) -> list[str]:
    """Another master with the key calls the slave, which is in a session: it is refused, and is told why."""
    address = f"link.slave={LINK}:{at.rig.slave_address[1]}"
    with Rival(at.rig, MASTER, "--set", address) as rival:
        _follow(at, rival, at.lasting(1.5, 1.5, 6.0))
        rival.end()
    found = [f"a second master was in a session for {rival.engaged} ticks"] * (rival.engaged > 0)
    if "refused" not in rival.outcome:
        found.append(f"the second master was not refused: {rival.outcome or 'it says nothing'}")
    return found if rival.ticks else [*found, "the second master did not start"]


def take_over(at: Field) -> list[str]:
    """A second master that says so takes the slave over; the first one is told and ends."""
    address = f"link.slave={LINK}:{at.rig.slave_address[1]}"
    first = at.rig.lives.pop(MASTER)
    found = []
    with Rival(at.rig, MASTER, "--set", address, "--take-over") as rival:
        at.watch.until(lambda: first.read() is None or rival.look() or not rival.running, START_S)
        if not rival.engaged:
            rival.end()
            found.append(f"the second master did not get the slave: {rival.outcome}")
        at.watch.until(lambda: not first.daemon.running, 3.0)
        if first.daemon.running:
            found.append("the first master goes on")
        rival.end()
    if first.daemon.running:
        first.daemon.stop(signal.SIGTERM)
    outcome = str(first.daemon.finish()["outcome"])
    if not found and "taken over" not in outcome:
        found.append(f"the first master was not told why: {outcome}")
    at.watch.bury(first, first.read())
    first.close()
    at.watch.begin()  # while the second master had the slave, the first one's records say nothing of the session
    at.ended_at = monotonic()
    at.rig.start(MASTER)
    return found


def stolen_path(at: Field) -> list[str]:
    """Somebody delivers a copy of each datagram from another address before it comes itself, and drops nothing."""
    wire = at.rig.wire
    wire.emulate(Emulation(delay_s=0.003), "forward")
    wire.steal(THIEF)
    try:
        at.watch.wait(at.lasting(1.0, 1.0, 4.0))
    finally:
        stolen, probed = wire.steal("")
    sent = at.watch.seen(SLAVE)["datagrams_sent"]
    at.notes["datagrams to the thief"] = stolen
    at.notes["probes to the thief"] = probed
    at.notes["datagrams sent meanwhile"] = int(sent[-1] - sent[0])
    return [f"{stolen} of {sent[-1] - sent[0]} datagrams went to who copied the master's"] * (stolen > 0)


def flood(at: Field) -> list[str]:
    """Somebody sends 50,000 datagrams a second of one kind to one end, as root also in the name of the other end."""
    rig, wire = at.rig, at.rig.wire
    kind = "forged" if at.short else at.random.choice(KINDS)
    side, way = at.random.choice(((SLAVE, "forward"), (MASTER, "backward")))
    spoof = os.geteuid() == 0 and not at.short and at.random.random() < 0.5
    at.watch.wait(1.0)
    books = wire.books()
    genuine = wire.recorded_calls() if kind in ("handshake", "calls") else wire.recall(way, RECORDED)
    if books.master is None or not genuine:
        at.notes["left out, nothing genuine was recorded"] = 1
        return []
    datagrams = load(kind, genuine, at.random, load_key(rig.folder / "soak.key"))
    target = rig.slave_address if side == SLAVE else books.master
    source = (books.back if side == SLAVE else wire.front) if spoof else CALLER
    pid, began = rig.lives[side].pid, monotonic()
    spent = cpu_seconds(pid)
    with volley(rig.folder, datagrams, target, source, FLOOD_PER_S, at.lasting(1.0, 2.0, 5.0), spoof=spoof) as gun:
        at.watch.until(lambda: gun.poll() is not None, START_S)
        output, _ = gun.communicate(timeout=START_S)
    core = (cpu_seconds(pid) - spent) / (monotonic() - began)
    at.notes[f"% of a core of the {side} during {kind}"] = round(100 * core)
    found = [f"the {side} took {100 * core:.0f} % of a core during {kind}"] * (core > MOST_CORE)
    return found + laws.answers_little(json.loads(output), is_proven=kind == "calls")


def _stamp(call: bytes) -> int:
    header = read_hello_header(call)
    assert header is not None
    return header.stamp


def many_calls(at: Field) -> list[str]:
    """HELLOs of earlier calls are sent again, 20,000 a second, while both ends start anew and call for a session."""
    rig, watch, wire = at.rig, at.watch, at.rig.wire
    # The master of a soak makes a few calls only; the others stand for a long recording. Calls of a clock that has gone
    # back since are not taken: a master gets past those when they end.
    now_ns = time_ns() + (0 if rig.wall is None else rig.wall.offset * 10**9)
    genuine = [call for call in wire.recorded_calls() if _stamp(call) <= now_ns]
    if not genuine:
        at.notes["left out, nobody has called by the present clock"] = 1
        return []
    recorded = genuine + load("calls", genuine, at.random, load_key(rig.folder / "soak.key"), calls=RECORDED)
    wire.emulate(Emulation(loss=1.0))
    for side in (MASTER, SLAVE):
        watch.bury(*rig.kill(side))
        rig.start(side)
    if not watch.until(lambda: all(life.last is not None for life in rig.lives.values()), START_S):
        return ["a daemon did not start"]
    with volley(rig.folder, recorded, rig.slave_address, CALLER, CALLS_PER_S, CALLS_S) as gun:
        watch.wait(0.3)
        opened = monotonic()
        wire.emulate(Emulation())
        is_back = watch.until(lambda: watch.engaged(opened), NEW_SESSION_S)
        seconds = monotonic() - opened
        if not at.short:
            gun.wait(CALLS_S + 10.0)
    at.ended_at = monotonic()
    at.notes["ms to the newest session"] = round(1e3 * seconds)
    return (
        [] if is_back else [f"no new session within {seconds:.1f} s while {CALLS_PER_S} recorded calls came a second"]
    )
