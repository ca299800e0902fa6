"""Pairings of two hosts in one process: many random ones, and attacks of the mailbox and of third parties.

    python -m tests.anywhere.pairings --number 1000     random pairings; their time and failures
    python -m tests.anywhere.pairings --attacks every   one JSON object: the outcome of each attack

Both use a real mailbox server on loopback, and real folders of peers.
"""

import argparse
import json
import random
import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from twisted.internet.defer import Deferred, DeferredSemaphore, gatherResults

from tests.anywhere.mailbox_server import MailboxServer
from tests.anywhere.pairing_attacks import EVERY, FEW, OTHERS, as_json, attacks
from tests.anywhere.pairing_hosts import Rig, is_sound, wrong
from weberlink.anywhere.pairing import events_out, reactor


def random_name(draw: random.Random) -> str:
    letters = "abcXYZ019 .:@-_äßéλя漢字🤖'\"$%"
    return "".join(draw.choices(letters, k=draw.randint(1, 40)))


async def one_random(rig: Rig, mailbox: str, draw: random.Random, times: list[float]) -> str:
    """What was wrong; "" if nothing: one in ten types a wrong code, and both must refuse."""
    slave, master = rig.host("slave", random_name(draw)), rig.host("master", random_name(draw))
    is_wrong = draw.random() < 0.1
    began = perf_counter()
    ends = await rig.pair(slave, master, mailbox, typed=wrong if is_wrong else str)
    took = perf_counter() - began
    paired = [end.peer is not None for end in ends.values()]
    if not is_sound(ends) or paired != [not is_wrong] * 2:
        return f"{slave.name!r} and {master.name!r}, wrong code {is_wrong}: {ends}"
    if not is_wrong:
        times.append(took)
        if (ends["slave"].peer.name, ends["master"].peer.name) != (master.name, slave.name):  # type: ignore[union-attr]
            return f"{slave.name!r} and {master.name!r} know each other by other names"
    return ""


async def many(number: int, seed: int, at_once: int) -> dict[str, Any]:
    draw, times = random.Random(seed), []
    with MailboxServer() as server, TemporaryDirectory() as folder:
        rig, turns = Rig(Path(folder)), DeferredSemaphore(at_once)
        began = perf_counter()
        work = [
            turns.run(lambda: Deferred.fromCoroutine(one_random(rig, server.url, draw, times))) for _ in range(number)
        ]
        failures = [text for text in await gatherResults(work) if text]
        seconds = perf_counter() - began
    keys = {"number": number, "seed": seed, "seconds": seconds, "paired": len(times), "failures": failures}
    return keys | {"median_s": statistics.median(times), "longest_s": max(times)}


def in_reactor(work: Callable[[], Any]) -> Any:
    """What the work returns."""
    found: list[Any] = []

    def begin() -> None:
        done: Any = Deferred.fromCoroutine(work())
        done.addCallback(found.append)
        done.addErrback(lambda failure: failure.printTraceback(sys.stderr))
        done.addBoth(lambda _: reactor.stop())

    reactor.callWhenRunning(begin)
    reactor.run()
    if not found:
        sys.exit(1)
    return found[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    parser.add_argument("--at-once", type=int, default=16)
    parser.add_argument("--attacks", help="few, every, or the names of some, with commas")
    parser.add_argument("--patience", type=float, default=3.0)
    arguments = parser.parse_args()
    out = events_out()
    if arguments.attacks:
        known = {"few": FEW + OTHERS, "every": EVERY + OTHERS}
        names = known.get(arguments.attacks) or tuple(arguments.attacks.split(","))
        found = as_json(in_reactor(lambda: attacks(names, arguments.at_once, arguments.patience)))
    else:
        found = in_reactor(lambda: many(arguments.number, arguments.seed, arguments.at_once))
    out.write(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    out.flush()
    sys.exit(bool(found.get("failures")))


if __name__ == "__main__":
    main()
