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
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

from twisted.internet.defer import Deferred, DeferredSemaphore, gatherResults
from twisted.internet.task import deferLater
from twisted.internet.threads import deferToThread
from wormhole._wordlist import PGPWordList

from tests.anywhere.mailbox_server import MailboxServer
from tests.anywhere.malicious_mailbox import MaliciousMailbox
from weberlink.anywhere.introduction import PairingError
from weberlink.anywhere.pairing import Meeting, events_out, reactor
from weberlink.anywhere.pairing_order import PairingOrder
from weberlink.anywhere.peers import Peer, PeerStore

LONG = 60.0
"""Patience where all messages come [s]."""
PHASES = ("pake", "version", "0", "1", "2")
"""Of a pairing: key exchange, its confirmation, hello, confirm, kept."""


class End(NamedTuple):
    """How it ended for one host: the peer, or why there is none, and what is in its store then."""

    peer: Peer | None
    reason: str
    stored: list[Peer]


class Host:
    """One end of a pairing, with a store of its own."""

    def __init__(self, side: str, name: str, folder: Path) -> None:
        self.side, self.name, self.store = side, name, PeerStore(folder)

    async def meet(self, mailbox: str, code: str = "", patience_s: float = LONG, shown: Any = None) -> End:
        """Pair; calls `shown` back with the code."""
        order = PairingOrder(
            self.side, self.name, str(self.store.folder), mailbox, code, "", 2 * patience_s, patience_s
        )

        def tell(key: str, text: str) -> None:
            if key == "code":
                shown.callback(text)

        try:
            peer = await Meeting(order, tell).run()
        except PairingError as error:
            if shown is not None and not shown.called:
                shown.callback("")
            return End(None, str(error), list(self.store))
        return End(peer, "", list(self.store))


async def join(master: Host, mailbox: str, code: str, patience_s: float) -> End:
    return await master.meet(mailbox, code, patience_s) if code else End(None, "no code was shown", [])


class Rig:
    """Makes hosts and lets them meet.

    Args:
        folder: of all stores.
        short: patience where a message never comes [s].
    """

    def __init__(self, folder: Path, short: float = LONG) -> None:
        self._folder, self._hosts = folder, 0
        self.short = short

    def host(self, side: str, name: str = "") -> Host:
        self._hosts += 1
        return Host(side, name or f"{side} {self._hosts}", self._folder / str(self._hosts))

    async def pair(
        self,
        slave: Host,
        master: Host,
        mailbox: str,
        patience_s: float = LONG,
        typed: Callable[[str], str] = str,
        between: Callable[[str], Awaitable[object]] | None = None,
    ) -> dict[str, End]:
        """One invites, the other joins with what it `typed` for the code; `between` runs before it joins."""
        shown: Deferred[str] = Deferred()
        invited = Deferred.fromCoroutine(slave.meet(mailbox, "", patience_s, shown))
        code = await shown
        if between is not None and code:
            await between(code)
        joined = await join(master, mailbox, typed(code) if code else "", patience_s)
        return {"slave": await invited, "master": joined}


def wrong(code: str) -> str:
    """The code with another last word of the list."""
    number, first, last = code.split("-")
    other = next(word for word in iter(lambda: PGPWordList().choose_words(2).split("-")[1], "") if word != last)
    return f"{number}-{first}-{other}"


def is_sound(ends: dict[str, End]) -> bool:
    """What one holds for a peer is what it said to have paired with, and two that hold each other have one key."""
    for end in ends.values():
        if end.stored != ([] if end.peer is None else [end.peer]):
            return False
    one, other = (ends[side].peer for side in ("slave", "master"))
    return one is None or other is None or (one.key, one.own, one.name) == (other.key, other.name, other.own)


# --- random pairings


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


# --- attacks


EVERY = tuple(
    f"{rule} {phase} {to}"
    for rule in ("drop", "changed", "reflected", "foreign")
    for phase in PHASES
    for to in ("slave", "master", "both")
)
FEW = (
    "drop pake slave",
    "drop version master",
    "drop 0 both",
    "drop 1 slave",
    "drop 2 master",
    "drop 2 both",
    "changed pake slave",
    "changed version master",
    "changed 0 slave",
    "changed 1 master",
    "changed 2 slave",
    "reflected pake both",
    "reflected 0 master",
    "foreign 0 slave",
)
"""One of each kind."""


async def timed(trial: Awaitable[dict[str, End]]) -> tuple[dict[str, End], float]:
    began = perf_counter()
    return await trial, perf_counter() - began


async def attacks(names: tuple[str, ...], at_once: int, patience_s: float) -> dict[str, Any]:
    """Run the trials of these names, many at once, after an honest pairing, whose messages are searched for secrets."""
    with ExitStack() as stack:
        server = stack.enter_context(MailboxServer())
        own = {name: stack.enter_context(MailboxServer()) for name in names if name in ALONE}
        evil = stack.enter_context(MaliciousMailbox(server.url))
        rig = Rig(Path(stack.enter_context(TemporaryDirectory())), patience_s)
        turns = DeferredSemaphore(at_once)
        url = evil.url("honest", 0)
        honest = await timed(rig.pair(rig.host("slave"), rig.host("master"), url))
        trials = [
            turns.run(Deferred.fromCoroutine, timed(trial(rig, name, evil, own.get(name, server)))) for name in names
        ]
        done = {"honest": honest} | dict(zip(names, await gatherResults(trials), strict=True))
        peer = honest[0]["slave"].peer
        assert peer is not None, honest
        told = "".join(evil.trial(url).seen)
        secrets = [peer.key.hex(), peer.name, peer.name.encode().hex(), peer.own, "hello"]
        return {
            "ends": {name: ends for name, (ends, _) in done.items()},
            "times": {name: took for name, (_, took) in done.items()},
            "learnt": [secret for secret in secrets if secret in told],
        }


async def trial(rig: Rig, name: str, evil: MaliciousMailbox, server: MailboxServer) -> dict[str, End]:
    """One trial, by its name: a rule of the mailbox, or a course of events."""
    if name in ALONE:
        return await ALONE[name](rig, server)
    if name in COURSES:
        course, rule = COURSES[name]
        return await course(rig, evil.url(rule, name.replace(" ", "")) if rule else server.url)
    slave, master, url = rig.host("slave"), rig.host("master"), evil.url(name.replace(" ", "/"), 0)
    return await rig.pair(slave, master, url, LONG if name in HARMLESS else rig.short)


async def crossed(rig: Rig, url: str) -> dict[str, End]:
    """The mailbox connects each of two masters to the slave of the other one."""
    shown: list[Deferred[str]] = [Deferred(), Deferred()]
    invited, codes = [], []
    for one in shown:
        invited.append(Deferred.fromCoroutine(rig.host("slave").meet(url, "", rig.short, one)))
        codes.append(await one)
        await deferLater(reactor, 0.3)  # so that each is connected before the next one
    joined = []
    for code in codes:
        joined.append(Deferred.fromCoroutine(join(rig.host("master"), url, code, rig.short)))
        await deferLater(reactor, 0.3)
    return dict(
        zip(("slave", "other slave", "master", "other master"), await gatherResults(invited + joined), strict=True)
    )


async def recorded(rig: Rig, url: str) -> dict[str, End]:
    """After a pairing, the mailbox gives the next one that invites what the first got."""
    first = await rig.pair(rig.host("slave"), rig.host("master"), url)
    shown: Deferred[str] = Deferred()
    second = await rig.host("slave").meet(url, "", LONG, shown)
    return {"slave": first["slave"], "master": first["master"], "second slave": second}


async def third_party_first(rig: Rig, url: str) -> dict[str, End]:
    thief: list[End] = []

    async def guess(code: str) -> None:
        thief.append(await rig.host("master", "thief").meet(url, wrong(code)))

    ends = await rig.pair(rig.host("slave"), rig.host("master"), url, rig.short, between=guess)
    return ends | dict(zip(("thief",), thief, strict=False))


async def used_twice(rig: Rig, url: str) -> dict[str, End]:
    codes: list[str] = []

    async def note(code: str) -> None:
        codes.append(code)

    ends = await rig.pair(rig.host("slave"), rig.host("master"), url, between=note)
    return ends | {"second master": await join(rig.host("master"), url, "".join(codes), rig.short)}


async def third_party_between(rig: Rig, url: str) -> dict[str, End]:
    """A third host comes while the other two are held up."""
    late: list[Deferred[End]] = []

    async def soon(code: str) -> None:
        async def come() -> End:
            await deferLater(reactor, 1.0)
            return await rig.host("master", "thief").meet(url, code, rig.short)

        late.append(Deferred.fromCoroutine(come()))

    ends = await rig.pair(rig.host("slave"), rig.host("master"), url, 2 * rig.short, between=soon)
    return ends | {"thief": await late[0]} if late else ends


async def known_already(rig: Rig, url: str) -> dict[str, End]:
    """Two that know each other pair again."""
    slave, master = rig.host("slave"), rig.host("master")
    first = await rig.pair(slave, master, url)
    again = await rig.pair(slave, master, url)
    return {"slave": first["slave"], "master": first["master"], "slave again": again["slave"]} | {
        "master again": again["master"]
    }


async def wrong_code(rig: Rig, url: str) -> dict[str, End]:
    return await rig.pair(rig.host("slave"), rig.host("master"), url, typed=wrong)


async def two_slaves(rig: Rig, url: str) -> dict[str, End]:
    return await rig.pair(rig.host("slave"), rig.host("slave"), url)


async def server_restarted(rig: Rig, server: MailboxServer) -> dict[str, End]:
    """The mailbox server ends, and starts again, while the code waits."""

    async def restart(code: str) -> None:
        await deferToThread(server.restart)

    return await rig.pair(rig.host("slave"), rig.host("master"), server.url, between=restart)


COURSES: dict[str, tuple[Callable[[Rig, str], Awaitable[dict[str, End]]], str]] = {
    "wrong code": (wrong_code, ""),
    "third party between": (third_party_between, "drop/pake/both"),
    "known already": (known_already, ""),
    "two slaves": (two_slaves, ""),
    "crossed": (crossed, "crossed"),
    "recorded": (recorded, "recorded"),
}
"""What happens, and the rule of the mailbox; "" for the real one."""
ALONE: dict[str, Callable[[Rig, MailboxServer], Awaitable[dict[str, End]]]] = {
    "third party first": lambda rig, server: third_party_first(rig, server.url),
    "code used twice": lambda rig, server: used_twice(rig, server.url),
    "server restarted": server_restarted,
}
"""With a server of their own, which gives the number of a void code to nobody else."""
HARMLESS = ("twice", "shuffled")
OTHERS = (*HARMLESS, "renumbered 0 both", "renumbered 1 both", "mute", "garbage", "unwelcome", *COURSES, *ALONE)


# --- the program


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


def as_json(found: dict[str, Any]) -> dict[str, Any]:
    ends = {}
    for name, trial in found["ends"].items():
        ends[name] = {
            who: {"paired": end.peer is not None, "stored": len(end.stored), "reason": end.reason}
            for who, end in trial.items()
        }
    sound = {name: is_sound({"slave": t["slave"], "master": t["master"]}) for name, t in found["ends"].items()}
    return {"ends": ends, "sound": sound, "times": found["times"], "learnt": found["learnt"]}


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
