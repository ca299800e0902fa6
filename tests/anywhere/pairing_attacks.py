"""Attacks on a pairing: by the mailbox, message by message, and by third parties."""

from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from twisted.internet.defer import Deferred, DeferredSemaphore, gatherResults
from twisted.internet.task import deferLater
from twisted.internet.threads import deferToThread

from tests.anywhere.mailbox_server import MailboxServer
from tests.anywhere.malicious_mailbox import MaliciousMailbox
from tests.anywhere.pairing_hosts import LONG, End, Rig, is_sound, join, wrong
from weberlink.anywhere.pairing import reactor

PHASES = ("pake", "version", "0", "1", "2")
"""Of a pairing: key exchange, its confirmation, hello, confirm, kept."""
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


def as_json(found: dict[str, Any]) -> dict[str, Any]:
    ends = {}
    for name, trial in found["ends"].items():
        ends[name] = {
            who: {"paired": end.peer is not None, "stored": len(end.stored), "reason": end.reason}
            for who, end in trial.items()
        }
    sound = {name: is_sound({"slave": t["slave"], "master": t["master"]}) for name, t in found["ends"].items()}
    return {"ends": ends, "sound": sound, "times": found["times"], "learnt": found["learnt"]}
