"""Two hosts that pair in one process, each with a store of its own."""

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NamedTuple

from twisted.internet.defer import Deferred
from wormhole._wordlist import PGPWordList

from weberlink.anywhere.introduction import PairingError
from weberlink.anywhere.pairing import Meeting
from weberlink.anywhere.pairing_order import PairingOrder
from weberlink.anywhere.peers import Peer, PeerStore

LONG = 60.0
"""Patience where all messages come [s]."""


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
