"""Flood a daemon of a live session: `python -m tests.soak.flood --rate 50000 --seconds 10 --kind forged`.

Measures what a daemon costs before, during and after the flood, whether the session lives, what the operator feels, and
whether anything is answered.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import inf
from pathlib import Path
from random import Random
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.soak.ammunition import KINDS, load
from tests.soak.laws import engaged, longest_gap
from tests.soak.processes import cpu_seconds
from tests.soak.rig import SIDES, Rig, RigError
from tests.soak.volley import volley
from weberlink.protocol.keys import load as load_key
from weberlink.system.composition.channels import channels
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.environment import environment, footer
from weberlink.system.scoring.session import Records, SessionScore

FOREIGN, PEER = "foreign", "peer"
STRANGER = ("127.0.0.3", 0)
SETTLE_S = 2.0
_RECALLED = 4000
_LOOK = 0.05

LIVES = 0.999
"""Share of the ticks of a flood that must be in the session."""
STALL_S = 0.1
"""Without a tick for so long, the machine stood still, and a lost session does not count."""
MUCH = 3.0
"""Times what a daemon sends without a flood: what it feels meanwhile varies."""
PROVEN = "calls"
"""The kind of datagrams that hold a proof of the key, and may be answered."""


@dataclass
class Phase:
    """One stretch of time; one value for each side where it says so.

    Attributes:
        core: share of a core that the daemon took.
        missed: share of deadlines without a tick.
        engaged: share of ticks in a session.
        violations: share of ticks whose felt error is outside the deadband; None if none counts.
        dropped: datagrams refused.
        sent_bytes: of datagrams sent.
        stall_s: longest time without a tick on either side, or that the relay stood still.
    """

    seconds: float = 0.0
    core: dict[str, float] = field(default_factory=dict)
    missed: dict[str, float] = field(default_factory=dict)
    engaged: dict[str, float] = field(default_factory=dict)
    violations: float | None = None
    dropped: dict[str, int] = field(default_factory=dict)
    stall_s: float = 0.0
    sent_bytes: dict[str, int] = field(default_factory=dict)


def observe(rig: Rig, seconds: float, until: subprocess.Popen[bytes] | None = None) -> Phase:
    """The figures of the next `seconds`, or until a process ends."""
    score = SessionScore(rig.rate_hz, channels(rig.configuration.system)[1].bank)
    seen: dict[str, list[Records]] = {side: [] for side in SIDES}
    for life in rig.lives.values():
        life.read()
    rig.wire.books()  # what the relay was late before does not count
    began = monotonic()
    cpu = {side: cpu_seconds(rig.lives[side].pid) for side in SIDES}
    while monotonic() < began + seconds and (until is None or until.poll() is None):
        sleep(_LOOK)
        for side in SIDES:
            records = rig.lives[side].read()
            if records is None or not rig.lives[side].daemon.running:
                raise RigError(f"the {side} has ended")
            seen[side].append(records)
        score.add(seen[MASTER][-1], seen[SLAVE][-1])
    lasted = monotonic() - began
    phase = Phase(lasted, violations=score.summary()["force"]["violation_fraction"], stall_s=rig.wire.books().late)
    for side in SIDES:
        records = np.concatenate(seen[side])
        phase.core[side] = (cpu_seconds(rig.lives[side].pid) - cpu[side]) / lasted
        phase.stall_s = max(phase.stall_s, longest_gap(records, 1.0 / rig.rate_hz))
        grown = {
            name: int(records[name][-1] - records[name][0]) if len(records) else 0
            for name in ("ticks_missed", "datagrams_dropped", "bytes_sent")
        }
        phase.missed[side] = grown["ticks_missed"] / (rig.rate_hz * lasted) if len(records) else 1.0
        phase.engaged[side] = float(engaged(records).mean()) if len(records) else 0.0
        phase.dropped[side], phase.sent_bytes[side] = grown["datagrams_dropped"], grown["bytes_sent"]
    return phase


def flood(kind: str, target: str, source: str, rate: int, seconds: float, seed: int) -> dict[str, Any]:
    """One flood at a session of its own; returns its figures.

    Args:
        kind: of datagrams.
        target: the side that is flooded.
        source: FOREIGN for an address of the flooder's own, PEER for that of the other end, spoofed.
        rate: datagrams per second.
        seconds: how long.
    """
    with Rig(seed=seed) as rig:
        rig.until_engaged()
        sleep(SETTLE_S)
        books = rig.wire.books()
        assert books.master is not None
        address = books.master if target == MASTER else rig.slave_address
        seen_as = rig.wire.front if target == MASTER else books.back
        before = observe(rig, seconds / 2)
        is_call = kind in ("handshake", "calls")
        way = "forward" if target == SLAVE else "backward"
        genuine = rig.wire.recorded_calls() if is_call else rig.wire.recall(way, _RECALLED)
        datagrams = load(kind, genuine, Random(seed), load_key(rig.folder / "soak.key"))
        spoof = source == PEER
        came_from = seen_as if spoof else STRANGER
        with volley(rig.folder, datagrams, address, came_from, rate, seconds, spoof=spoof) as gun:
            during = observe(rig, seconds, gun)
            output, _ = gun.communicate(timeout=seconds + 10.0)
        after = observe(rig, seconds / 2)
        calls = rig.wire.books().calls - books.calls
    phases = {"before": asdict(before), "during": asdict(during), "after": asdict(after)}
    what = {"kind": kind, "target": target, "source": source, "rate": rate}
    return {**what, **phases, "shots": json.loads(output), "calls": calls}


def line(figures: Mapping[str, Any]) -> str:
    """One flood in one line, of the side that it was aimed at; before, during and after."""
    target, shots = figures["target"], figures["shots"]
    before, during, after = (figures[name] for name in ("before", "during", "after"))
    core = " -> ".join(f"{100 * phase['core'][target]:.1f}" for phase in (before, during, after))
    missed = " -> ".join(f"{100 * phase['missed'][target]:.2f}" for phase in (before, during))
    felt = " -> ".join(_share(phase["violations"]) for phase in (before, during))
    lived = "/".join(f"{100 * share:.1f}" for share in during["engaged"].values())
    answers = "unheard" if shots["answers"] is None else f"{shots['answers']} answers {shots['answered_bytes']} B"
    return (
        f"{figures['kind']:10} at the {target:6} from {figures['source']:7} {shots['sent'] / shots['seconds']:7.0f}/s: "
        f"core {core} %, missed {missed} %, engaged {lived} %, calls {figures['calls']}, felt outside {felt}, "
        f"refused {during['dropped'][target]}, {answers}"
    )


def _share(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.1f} %"


def violated(figures: Mapping[str, Any], most_core: float = inf, most_missed: float = inf) -> list[str]:
    """What a flood has done that it must not.

    Args:
        figures: of `flood`.
        most_core: share of a core that the flooded daemon may take.
        most_missed: share of ticks that it may miss.
    """
    target, before, during, shots = figures["target"], figures["before"], figures["during"], figures["shots"]
    found = [
        f"the {side} was in the session for {100 * share:.2f} % of the ticks {name} the flood"
        for name in ("during", "after")
        if figures[name]["stall_s"] < STALL_S
        for side, share in figures[name]["engaged"].items()
        if share < LIVES
    ]
    if shots["answers"]:  # at most one to a question, no longer than that, and none without proof of the key
        if figures["kind"] != PROVEN:
            found.append(f"{shots['answers']} answers to who has not proved the key")
        if shots["answers"] > shots["sent"] or shots["answered_bytes"] > shots["sent_bytes"]:
            asked = f"{shots['sent']} questions of {shots['sent_bytes']} B"
            found.append(f"{asked} had {shots['answers']} answers of {shots['answered_bytes']} B")
        if shots["longest_answer"] > shots["shortest_question"]:
            found.append(f"an answer of {shots['longest_answer']} B, a question of {shots['shortest_question']} B")
    # What goes to a spoofed address cannot be heard, but the daemon counts it.
    usual = before["sent_bytes"][target] / before["seconds"] * during["seconds"]
    if (sent := during["sent_bytes"][target]) > MUCH * usual + shots["sent_bytes"]:
        found.append(f"the {target} sent {sent} B, {usual:.0f} B without a flood")
    if during["core"][target] > most_core:
        taken = f"{100 * during['core'][target]:.0f} % of a core"
        found.append(f"the {target} took {taken}, more than {100 * most_core:.0f} %")
    if during["missed"][target] > most_missed:
        found.append(f"the {target} missed {100 * during['missed'][target]:.2f} % of its ticks")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rate", type=int, default=50_000, help="datagrams per second")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--kind", choices=[*KINDS, "all"], default="all")
    parser.add_argument("--target", choices=[*SIDES, "both"], default="both")
    parser.add_argument("--source", choices=[FOREIGN, PEER, "both"], default="both", help="peer: spoofed; needs root")
    parser.add_argument("--most-core", type=float, default=inf, help="share of a core beyond which it has failed, 0..1")
    parser.add_argument("--most-missed", type=float, default=inf, help="share of ticks beyond which it failed, 0..1")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    rows = []
    for kind in KINDS if arguments.kind == "all" else [arguments.kind]:
        for target in SIDES if arguments.target == "both" else [arguments.target]:
            for source in (FOREIGN, PEER) if arguments.source == "both" else [arguments.source]:
                figures = flood(kind, target, source, arguments.rate, arguments.seconds, arguments.seed)
                found = violated(figures, arguments.most_core, arguments.most_missed)
                rows.append(figures | {"violations": found})
                sys.stdout.write("\n".join([line(figures), *(f"  VIOLATED {text}" for text in found)]) + "\n")
                sys.stdout.flush()
    facts = environment()
    sys.stdout.write(footer(facts, arguments.seed) + "\n")
    if arguments.json is not None:
        arguments.json.write_text(json.dumps({"floods": rows, "environment": facts}, indent=1), encoding="utf-8")
    return 1 if any(row["violations"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
