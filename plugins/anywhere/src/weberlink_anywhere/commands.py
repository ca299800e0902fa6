"""The command `peer`: the known peers."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import Json
from weberlink.cli.output import fail, failing, write
from weberlink.order import MISCONFIGURED


def peer(
    label: Annotated[str | None, typer.Argument(metavar="[NAME]", help="One known peer; default: all.")] = None,
    rename: Annotated[str | None, typer.Option(metavar="NEW", help="Call the peer NEW.")] = None,
    remove: Annotated[bool, typer.Option("--remove", help="Forget the peer and its key.")] = False,
    right: Annotated[
        Literal["drive", "watch", "stop"] | None, typer.Option("--right", help="What the peer may do from now on.")
    ] = None,
    offline: Annotated[bool, typer.Option("--offline", help="Ask no mailbox server which robots wait.")] = False,
    store: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the known peers (link.finder.peer_store of a file).")
    ] = None,
    json_out: Json = None,
) -> None:
    """List known peers and which of them wait; rename or remove one, or change its right."""
    from weberlink.protocol.keys import Right  # noqa: PLC0415 - not for the help
    from weberlink_anywhere.peers import PeerError, PeerStore  # noqa: PLC0415

    changes = (rename is not None) + remove + (right is not None)
    if changes > 1 or (changes and label is None):
        fail(
            "peer: one of --rename NEW, --right and --remove, of one peer: weberlink peer NAME --remove", MISCONFIGURED
        )
    known = PeerStore(store)
    with failing(PeerError, MISCONFIGURED, "peer: "):
        if label is not None and remove:
            known.remove(label)
            typer.echo(f"{label} is forgotten; a slave that runs ends its session within a second")
        elif label is not None and right is not None:
            known.allow(label, Right(right))
            typer.echo(f"{label} may {right}, also at a slave that runs")
        elif label is not None and rename is not None:
            known.rename(label, rename)
            typer.echo(f"{label} is now called {rename}")
        else:
            from weberlink_anywhere.survey import survey  # noqa: PLC0415 - not for the help

            found = survey(known, label, ask=not offline)
            write(found.document, json_out, found.show)
