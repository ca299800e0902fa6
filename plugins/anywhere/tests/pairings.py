"""Pairings of two hosts in one process: attacks of the mailbox, message by message, and of third parties.

    python -m plugins.anywhere.tests.pairings PATIENCE "wrong code" "drop 0 slave" ...

Prints one JSON object: the outcome of each trial. A process of its own, since the reactor of Twisted runs once. Uses
real mailbox servers on loopback, and real folders of peers. A trial is a course of events, or a rule of the mailbox.
"""

import json
import sys
from collections.abc import Awaitable, Callable
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from twisted.internet.defer import Deferred, gatherResults, succeed
from wormhole._wordlist import PGPWordList
from wormhole_mailbox_server.database import create_channel_db
from wormhole_mailbox_server.server import make_server
from wormhole_mailbox_server.server_websocket import WebSocketServer, WebSocketServerFactory

from weberlink_anywhere.key_confirmation import PairingError
from weberlink_anywhere.order import PairingOrder
from weberlink_anywhere.pairing import PairingSession, events_out, reactor
from weberlink_anywhere.peers import Peer, PeerStore

LONG = 60.0  # patience where all messages come [s]


class Connection(WebSocketServer):
    """Of a host to a mailbox that may change or drop what others have sent it."""

    def onMessage(self, payload: bytes, isBinary: bool) -> None:  # noqa: N802, N803 - of autobahn
        mailbox, told = self.factory, json.loads(payload)
        mailbox.seen.append(payload.decode())
        super().onMessage(payload, isBinary)
        if told["type"] == "bind" and self._side not in mailbox.sides:
            mailbox.sides.append(self._side)
        if (told["type"], mailbox.rule, len(mailbox.sides)) == ("open", "recorded", 3):
            for old in mailbox.of_slave:
                super().send("message", **old)

    def send(self, mtype: str, **told: Any) -> None:
        mailbox = self.factory
        if mtype == "message" and told["side"] != self._side:
            to = ("slave", "master")[mailbox.sides.index(self._side) % 2]
            if to == "slave":
                mailbox.of_slave.append(dict(told))
            if (told["phase"], to) == (mailbox.phase, mailbox.whom):
                if mailbox.rule == "drop":
                    return
                body = bytearray.fromhex(told["body"])
                body[-1] ^= 1
                told["body"] = body.hex()
        super().send(mtype, **told)


class Mailbox(WebSocketServerFactory):
    """A mailbox server in this process, with the rule "drop PHASE TO", "changed PHASE TO", "recorded", or none.

    The first host to come is the slave, which invites; a third host of "recorded" is given what the slave got.
    """

    protocol = Connection

    def __init__(self, trial: str) -> None:
        super().__init__(None, make_server(create_channel_db(":memory:")))
        self.rule, self.phase, self.whom, *_ = *trial.split(), "", ""
        self.sides: list[str] = []
        self.of_slave: list[dict[str, Any]] = []
        self.seen: list[str] = []
        self.url = f"ws://127.0.0.1:{reactor.listenTCP(0, self, interface='127.0.0.1').getHost().port}/v1"


class End(NamedTuple):
    """How it ended for one host: the peer, or why there is none, and what is in its store then."""

    peer: Peer | None
    reason: str
    stored: list[Peer]


Ends = dict[str, End]


class Rig:
    """Makes hosts and lets them meet; `short` is the patience where a message never comes [s]."""

    def __init__(self, folder: Path, short: float) -> None:
        self._folder, self._numbers, self.short = folder, count(1), short
        self.words: dict[str, dict[str, str]] = {}  # that each side was shown, by mailbox

    def store(self) -> PeerStore:
        return PeerStore(self._folder / str(next(self._numbers)))

    async def meet(
        self,
        side: str,
        mailbox: str,
        code: str = "",
        patience_s: float = LONG,
        shown: "Deferred[str] | None" = None,
        consents: bool = True,
    ) -> End:
        """A new host that invites, and calls `shown` back with the code, or that joins by one."""
        if not code and shown is None:
            return End(None, "no code was shown", [])
        store = self.store()
        name = f"{side} {store.folder.name}"

        def tell(key: str, text: str) -> None:
            if key == "code" and shown is not None:
                shown.callback(text)
            if key == "words":
                words[side] = text

        words: dict[str, str] = self.words.setdefault(mailbox, {})
        limits = {"lifetime_s": 2 * patience_s, "consent_s": patience_s, "patience_s": patience_s}
        order = PairingOrder(side, name, str(store.folder), mailbox, code, **limits)
        try:
            peer = await PairingSession(order, tell, lambda: succeed(consents)).run()
        except PairingError as error:
            if shown is not None and not shown.called:
                shown.callback("")
            return End(None, str(error), list(store))
        return End(peer, "", list(store))

    async def pair(
        self,
        mailbox: str,
        patience_s: float = LONG,
        *,
        joins: str = "master",
        typed: Callable[[str], str] = str,
        between: Callable[[str], Awaitable[object]] | None = None,
        consents: bool = True,
    ) -> Ends:
        """One invites, the other joins with what it `typed` for the code; `between` runs before it joins."""
        shown: Deferred[str] = Deferred()
        invited = Deferred.fromCoroutine(self.meet("slave", mailbox, "", patience_s, shown, consents))
        code = await shown
        if between is not None and code:
            await between(code)
        joined = await self.meet(joins, mailbox, typed(code) if code else "", patience_s)
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
    return first | {"second slave": await rig.meet("slave", url, shown=Deferred())}


async def with_third(rig: Rig, url: str, *, is_first: bool, knows: bool = False) -> Ends:
    """A third host comes before the master, by a wrong code or by the right one, or after the two with the right one.

    The person at the robot sees words that the operator does not have, and refuses.
    """
    codes, ends = [], dict[str, End]()

    async def between(code: str) -> None:
        codes.append(code)
        if is_first:
            ends["thief"] = await rig.meet("master", url, code if knows else wrong(code))

    ends |= await rig.pair(url, rig.short if is_first else LONG, between=between, consents=not knows)
    return ends if is_first else ends | {"thief": await rig.meet("master", url, codes[0], rig.short)}


COURSES: dict[str, Callable[[Rig, str], Awaitable[Ends]]] = {
    "wrong code": lambda rig, url: rig.pair(url, typed=wrong),
    "two slaves": lambda rig, url: rig.pair(url, joins="slave"),
    "recorded": recorded,
    "third party first": lambda rig, url: with_third(rig, url, is_first=True),
    "thief with the code": lambda rig, url: with_third(rig, url, is_first=True, knows=True),
    "words refused": lambda rig, url: rig.pair(url, consents=False),
    "code used twice": lambda rig, url: with_third(rig, url, is_first=False),
}


async def attacks(patience_s: float, names: list[str]) -> dict[str, Any]:
    """Run the trials of these names at once, after an honest pairing, whose messages are searched for secrets."""
    with TemporaryDirectory() as folder:
        rig = Rig(Path(folder), patience_s)

        def trial(name: str) -> Awaitable[Ends]:
            return COURSES.get(name, lambda rig, url: rig.pair(url, rig.short))(rig, Mailbox(name).url)

        mailbox = Mailbox("honest")
        honest = await rig.pair(mailbox.url)
        done = await gatherResults([Deferred.fromCoroutine(trial(name)) for name in names])
        peer = honest["slave"].peer
        assert peer is not None, honest
        told = "".join(mailbox.seen)
        secrets = [peer.key.hex(), peer.name, peer.name.encode().hex(), peer.own, "hello"]
        ends = {"honest": honest} | dict(zip(names, done, strict=True))
        return {
            "ends": {
                name: {who: "paired" if e.peer else e.reason for who, e in of.items()} for name, of in ends.items()
            },
            "unsound": [name for name, of in ends.items() if not is_sound({s: of[s] for s in ("slave", "master")})],
            "words": rig.words[mailbox.url],
            "learnt": [secret for secret in secrets if secret in told],
        }


def main() -> None:
    found: list[dict[str, Any]] = []
    out = events_out()

    def begin() -> None:
        done: Any = Deferred.fromCoroutine(attacks(float(sys.argv[1]), sys.argv[2:]))
        done.addCallback(found.append)
        done.addErrback(lambda failure: failure.printTraceback(sys.stderr))
        done.addBoth(lambda _: reactor.stop())

    reactor.callWhenRunning(begin)
    reactor.run()
    out.write("".join(json.dumps(each, ensure_ascii=False) for each in found))
    out.flush()
    sys.exit(not found)


if __name__ == "__main__":
    main()
