"""The known peers, and which of them wait to be called."""

import asyncio
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink_anywhere.peers import PeerError, PeerStore
from weberlink_anywhere.rendezvous import presence

ASK_LIMIT_S = 2.0
COLOURS = {"here": "green", "away": "dim", "unusable": "red"}


@dataclass(frozen=True)
class Survey:
    """The known peers, for JSON, without their keys.

    The state of each is here, away, unknown, unusable (its file), or - if it was not asked.
    """

    document: dict[str, Any]

    def show(self, console: Console) -> None:
        """Print a table, and below it one line for each note."""
        peers = self.document["peers"]
        if not peers:
            console.print("no peer is known yet; pair with --invite and --join")
            return
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for column in ("peer", "name"):
            table.add_column(column, overflow="fold", max_width=24)
        for column in ("role", "paired"):
            table.add_column(column, no_wrap=True)
        table.add_column("state", overflow="fold")
        notes: dict[str, list[str]] = {}
        for each in peers:
            table.add_row(*_cells(each))
            notes.setdefault(each["note"], []).append(each["label"])
        console.print(table)
        for note, labels in notes.items():
            if note:
                console.print(Text(f"{', '.join(labels)}: {note}"), soft_wrap=True)


def survey(store: PeerStore, label: str | None = None, *, ask: bool = True) -> Survey:
    """The known peers, or one of them; those that may wait are asked, all at once.

    Raises:
        PeerError: the folder cannot be read, or there is no peer of this label.
    """
    labels = store.labels() if label is None else [store.find(label).label]

    async def look() -> list[dict[str, Any]]:
        return await asyncio.gather(*(_look(store, each, ask) for each in labels))

    return Survey({"peers": asyncio.run(look())})


async def _look(store: PeerStore, label: str, ask: bool) -> dict[str, Any]:
    found: dict[str, Any] = {"label": label, "state": "-", "serves": None, "note": ""}
    try:
        peer = store.find(label)
    except PeerError as error:
        return found | {"state": "unusable", "note": str(error)}
    if ask and peer.role != "master":  # an operator calls
        told = await presence(peer, ASK_LIMIT_S)
        state = "here" if told.here else "unknown" if told.note else "away"
        found |= {"state": state, "serves": told.serves, "note": told.note}
    return {key: value for key, value in asdict(peer).items() if key != "key"} | found


def _cells(peer: dict[str, Any]) -> tuple[Text, ...]:
    state, serves, paired = Text(peer["state"], style=COLOURS.get(peer["state"], "")), peer["serves"], "-"
    if serves is not None:
        state.append(f", serves {'this host' if serves == peer['own'] else serves}")
    if peer.get("paired_at"):
        paired = f"{datetime.fromtimestamp(peer['paired_at'], UTC).astimezone():%Y-%m-%d}"
    role = peer.get("role", "-") + {"watch": ", watches", "stop": ", stops"}.get(peer.get("right", ""), "")
    return Text(peer["label"]), Text(peer.get("name", "-")), Text(role), Text(paired), state
