"""The known peers, and which of them wait to be called."""

import asyncio
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink_anywhere.peers import Peer, PeerError, PeerStore
from weberlink_anywhere.rendezvous import presence
from weberlink_anywhere.signalling import Presence

ASK_LIMIT_S = 2.0
COLOURS = {"here": "green", "away": "dim", "unusable": "red"}


@dataclass(frozen=True)
class KnownPeer:
    """One line of the list.

    Args:
        label: what this user calls the peer.
        peer: None if its file cannot be used.
        presence: None if it was not asked; an operator is never asked, since it calls.
        note: why it was not asked, or what is wrong with its file.
    """

    label: str
    peer: Peer | None
    presence: Presence | None = None
    note: str = ""

    @property
    def state(self) -> str:
        """In a word: here, away, unknown, unusable, or - if it was not asked."""
        if self.peer is None:
            return "unusable"
        if self.presence is None:
            return "-"
        if self.presence.here:
            return "here"
        return "unknown" if self.presence.note else "away"

    @property
    def document(self) -> dict[str, Any]:
        """For JSON; without the key."""
        fields = {} if self.peer is None else {key: value for key, value in asdict(self.peer).items() if key != "key"}
        serves = None if self.presence is None else self.presence.serves
        return {**fields, "label": self.label, "state": self.state, "serves": serves, "note": self.note}


@dataclass(frozen=True)
class Acquaintances:
    """The known peers."""

    peers: Sequence[KnownPeer]

    @property
    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {"peers": [each.document for each in self.peers]}

    def show(self, console: Console) -> None:
        """Print a table, and below it one line for each note."""
        if not self.peers:
            console.print("no peer is known yet; pair with --invite and --join")
            return
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("peer", overflow="fold", max_width=24)
        table.add_column("name", overflow="fold", max_width=24)
        table.add_column("role", no_wrap=True)
        table.add_column("paired", no_wrap=True)
        table.add_column("state", overflow="fold")
        for each in self.peers:
            table.add_row(*_cells(each))
        console.print(table)
        notes: dict[str, list[str]] = {}
        for each in self.peers:
            notes.setdefault(each.note, []).append(each.label)
        for note, labels in notes.items():
            if note:
                console.print(Text(f"{', '.join(labels)}: {note}"), soft_wrap=True)


def acquaintances(store: PeerStore, label: str | None = None, *, ask: bool = True) -> Acquaintances:
    """The known peers, or one of them; those that may wait are asked, all at once.

    Raises:
        PeerError: the folder cannot be read, or there is no peer of this label.
    """
    peers = [_known(store, each) for each in store.labels()] if label is None else [KnownPeer(label, store.find(label))]
    return Acquaintances(asyncio.run(_ask(peers)) if ask else peers)


def _known(store: PeerStore, label: str) -> KnownPeer:
    try:
        return KnownPeer(label, store.find(label))
    except PeerError as error:
        return KnownPeer(label, None, note=str(error))


async def _ask(peers: Sequence[KnownPeer]) -> list[KnownPeer]:
    return list(await asyncio.gather(*map(_asked, peers)))


async def _asked(known: KnownPeer) -> KnownPeer:
    if known.peer is None or known.peer.role == "master":
        return known
    found = await presence(known.peer, ASK_LIMIT_S)
    return KnownPeer(known.label, known.peer, found, found.note)


def _cells(known: KnownPeer) -> tuple[Text, ...]:
    state = Text(known.state, style=COLOURS.get(known.state, ""))
    if known.peer is None:
        return Text(known.label), Text("-"), Text("-"), Text("-"), state
    if known.presence is not None and known.presence.serves is not None:
        serves = known.presence.serves
        state.append(f", serves {'this host' if serves == known.peer.own else serves}")
    paired = datetime.fromtimestamp(known.peer.paired_at, UTC).astimezone() if known.peer.paired_at else None
    day = "-" if paired is None else f"{paired:%Y-%m-%d}"
    return Text(known.label), Text(known.peer.name), Text(known.peer.role), Text(day), state
