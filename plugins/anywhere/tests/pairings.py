"""Pairings of two hosts in one process: attacks of the mailbox, message by message, and of third parties.

    python -m plugins.anywhere.tests.pairings "wrong code,drop 0 both"     one JSON object: the outcome of each trial

A process of its own, since the reactor of Twisted runs once. Uses a real mailbox server on loopback, and real folders
of peers. A trial is a course of events, or a rule of the malicious mailbox.
"""

import argparse
import json
import sys
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from twisted.internet.defer import Deferred, DeferredSemaphore, gatherResults
from wormhole._wordlist import PGPWordList

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.malicious_mailbox import MaliciousMailbox
from weberlink_anywhere.introduction import PairingError
from weberlink_anywhere.order import PairingOrder
from weberlink_anywhere.pairing import PairingSession, events_out, reactor
from weberlink_anywhere.peers import Peer, PeerStore

LONG = 60.0
"""Patience where all messages come [s]."""


class End(NamedTuple):
    """How it ended for one host: the peer, or why there is none, and what is in its store then."""

    peer: Peer | None
    reason: str
    stored: list[Peer]


Ends = dict[str, End]


class Host:
    """One end of a pairing, with a store of its own."""

    def __init__(self, side: str, name: str, folder: Path) -> None:
        self.side, self.name, self.store = side, name, PeerStore(folder)

    async def meet(self, mailbox: str, code: str = "", patience_s: float = LONG, shown: Any = None) -> End:
        """Pair; calls `shown` back with the code."""
        words = (self.side, self.name, str(self.store.folder), mailbox, code, "", 2 * patience_s, patience_s)

        def tell(key: str, text: str) -> None:
            if key == "code":
                shown.callback(text)

        try:
            peer = await PairingSession(PairingOrder(*words), tell).run()
        except PairingError as error:
            if shown is not None and not shown.called:
                shown.callback("")
            return End(None, str(error), list(self.store))
        return End(peer, "", list(self.store))

    async def join(self, mailbox: str, code: str, patience_s: float = LONG) -> End:
        return await self.meet(mailbox, code, patience_s) if code else End(None, "no code was shown", [])


class Rig:
    """Makes hosts and lets them meet.

    Args:
        folder: of all stores.
        short: patience where a message never comes [s].
    """

    def __init__(self, folder: Path, short: float) -> None:
        self._folder, self._hosts, self.short = folder, 0, short

    def host(self, side: str) -> Host:
        self._hosts += 1
        return Host(side, f"{side} {self._hosts}", self._folder / str(self._hosts))

    async def pair(
        self,
        mailbox: str,
        patience_s: float = LONG,
        *,
        master: Host | None = None,
        typed: Callable[[str], str] = str,
        between: Callable[[str], Awaitable[object]] | None = None,
    ) -> Ends:
        """One invites, the other joins with what it `typed` for the code; `between` runs before it joins."""
        slave, master = self.host("slave"), master or self.host("master")
        shown: Deferred[str] = Deferred()
        invited = Deferred.fromCoroutine(slave.meet(mailbox, "", patience_s, shown))
        code = await shown
        if between is not None and code:
            await between(code)
        joined = await master.join(mailbox, typed(code) if code else "", patience_s)
        return {"slave": await invited, "master": joined}


def wrong(code: str) -> str:
    """The code with another last word of the list."""
    number, first, last = code.split("-")
    other = next(word for word in iter(lambda: PGPWordList().choose_words(2).split("-")[1], "") if word != last)
    return f"{number}-{first}-{other}"


def is_sound(ends: Ends) -> bool:
    """What one holds for a peer is what it said to have paired with, and two that hold each other have one key."""
    if any(end.stored != ([] if end.peer is None else [end.peer]) for end in ends.values()):
        return False
    one, other = (ends[side].peer for side in ("slave", "master"))
    return one is None or other is None or (one.key, one.own, one.name) == (other.key, other.name, other.own)


async def recorded(rig: Rig, url: str) -> Ends:
    """After a pairing, the mailbox gives the next one that invites what the first got."""
    first = await rig.pair(url)
    return first | {"second slave": await rig.host("slave").meet(url, "", LONG, Deferred())}


async def with_third(rig: Rig, url: str, *, is_first: bool) -> Ends:
    """A third host comes before the master with a wrong code, or after the two with the right one."""
    thief, codes, ends = rig.host("master"), [], dict[str, End]()

    async def between(code: str) -> None:
        codes.append(code)
        if is_first:
            ends["thief"] = await thief.meet(url, wrong(code))

    ends |= await rig.pair(url, rig.short if is_first else LONG, between=between)
    return ends if is_first else ends | {"thief": await thief.join(url, codes[0], rig.short)}


COURSES: dict[str, tuple[Callable[[Rig, str], Awaitable[Ends]], str]] = {
    "wrong code": (lambda rig, url: rig.pair(url, typed=wrong), ""),
    "two slaves": (lambda rig, url: rig.pair(url, master=rig.host("slave")), ""),
    "recorded": (recorded, "recorded"),
}
"""What happens, and the rule of the mailbox; "" for the real one."""
ALONE: dict[str, Callable[[Rig, MailboxServer], Awaitable[Ends]]] = {
    "third party first": lambda rig, server: with_third(rig, server.url, is_first=True),
    "code used twice": lambda rig, server: with_third(rig, server.url, is_first=False),
}
"""With a server of their own, which gives the number of a void code to nobody else."""


async def attacks(names: tuple[str, ...], patience_s: float) -> dict[str, Any]:
    """Run the trials of these names at once, after an honest pairing, whose messages are searched for secrets."""
    with ExitStack() as stack:
        server = stack.enter_context(MailboxServer())
        evil = stack.enter_context(MaliciousMailbox(server.url))
        rig = Rig(Path(stack.enter_context(TemporaryDirectory())), patience_s)

        def trial(name: str) -> Awaitable[Ends]:
            if name in ALONE:
                return ALONE[name](rig, stack.enter_context(MailboxServer()))
            if name in COURSES:
                course, rule = COURSES[name]
                return course(rig, evil.url(rule, name.replace(" ", "")) if rule else server.url)
            return rig.pair(evil.url(name.replace(" ", "/"), 0), rig.short)

        url, turns = evil.url("honest", 0), DeferredSemaphore(32)
        honest = await rig.pair(url)
        done = await gatherResults([turns.run(Deferred.fromCoroutine, trial(name)) for name in names])
        peer = honest["slave"].peer
        assert peer is not None, honest
        told = "".join(evil.trial(url).seen)
        secrets = [peer.key.hex(), peer.name, peer.name.encode().hex(), peer.own, "hello"]
        ends = {"honest": honest} | dict(zip(names, done, strict=True))
        return {
            "ends": {
                name: {who: "paired" if e.peer else e.reason for who, e in of.items()} for name, of in ends.items()
            },
            "unsound": [name for name, of in ends.items() if not is_sound({s: of[s] for s in ("slave", "master")})],
            "learnt": [secret for secret in secrets if secret in told],
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trials", help="their names, with commas")
    parser.add_argument("--patience", type=float, default=3.0)
    arguments, found, out = parser.parse_args(), [], events_out()

    def begin() -> None:
        done: Any = Deferred.fromCoroutine(attacks(tuple(arguments.trials.split(",")), arguments.patience))
        done.addCallback(found.append)
        done.addErrback(lambda failure: failure.printTraceback(sys.stderr))
        done.addBoth(lambda _: reactor.stop())

    reactor.callWhenRunning(begin)
    reactor.run()
    out.write(json.dumps(found[0], ensure_ascii=False) + "\n" if found else "")
    out.flush()
    sys.exit(not found)


if __name__ == "__main__":
    main()
