"""A flood at a live session: `python -m tests.soak.flood --rate 50000 --seconds 10 --kind forged`.

Owns the measurement: what a daemon costs before, during and after a flood at its port, whether the session lives, what
the operator feels, and whether anything is answered. The flood itself is `tests.soak.volley`, in another process.
"""

import argparse
import json
import subprocess
import sys
from dataclasses import asdict
from math import inf
from pathlib import Path
from random import Random
from time import sleep
from typing import Any

from tests.soak.ammunition import KINDS, load
from tests.soak.flood_laws import line, violated
from tests.soak.observer import Observer
from tests.soak.rig import SIDES, Rig
from weberlink.protocol.keys import load as load_key
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.environment import environment, footer

FOREIGN, PEER = "foreign", "peer"
STRANGER = ("127.0.0.3", 0)
SETTLE_S = 2.0
_RECALLED = 4000


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
        addresses = {MASTER: books.master, SLAVE: rig.slave_address}
        seen_as = {MASTER: rig.wire.front, SLAVE: books.back}
        observer = Observer(rig, {side: address[1] for side, address in addresses.items()})
        before = observer.watch(seconds / 2)
        way = "forward" if target == SLAVE else "backward"
        genuine = rig.wire.recall("forward", _RECALLED) if kind in ("handshake", "calls") else None
        datagrams = load(
            kind, genuine or rig.wire.recall(way, _RECALLED), Random(seed), load_key(rig.folder / "soak.key")
        )
        order = {
            "target": addresses[target],
            "source": seen_as[target] if source == PEER else STRANGER,
            "spoof": source == PEER,
            "rate": rate,
            "seconds": seconds,
            "datagrams": [data.hex() for data in datagrams],
        }
        path = rig.folder / "order.json"
        path.write_text(json.dumps(order), encoding="ascii")
        gun = subprocess.Popen([sys.executable, "-m", "tests.soak.volley", str(path)], stdout=subprocess.PIPE)
        try:
            assert gun.stdout is not None
            gun.stdout.readline()  # it begins
            during = observer.watch(seconds, gun)
            output, _ = gun.communicate(timeout=seconds + 10.0)
        finally:
            gun.kill()
            gun.wait()
        after = observer.watch(seconds / 2)
        answered = rig.wire.books()
    return {
        "kind": kind,
        "target": target,
        "source": source,
        "rate": rate,
        "shots": json.loads(output),
        "before": asdict(before),
        "during": asdict(during),
        "after": asdict(after),
        "calls": answered.calls - books.calls,
        "strange": answered.backward.strange + answered.forward.strange,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rate", type=int, default=50_000, help="datagrams per second")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--kind", choices=[*KINDS, "all"], default="all")
    parser.add_argument("--target", choices=[*SIDES, "both"], default="both")
    parser.add_argument("--source", choices=[FOREIGN, PEER, "both"], default="both", help="peer: spoofed; needs root")
    parser.add_argument("--most-core", type=float, default=inf, help="share of a core beyond which it has failed, 0..1")
    parser.add_argument(
        "--most-missed", type=float, default=inf, help="share of ticks beyond which it has failed, 0..1"
    )
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
