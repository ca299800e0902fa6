"""The command `peer`: the known peers."""

from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import Json
from weberlink.cli.output import fail, failing, write
from weberlink.order import MISCONFIGURED


def peer(
    label: Annotated[str | None, typer.Argument(metavar="[NAME]", help="One known peer; default: all.")] = None,
    rename: Annotated[str | None, typer.Option(metavar="NEW", help="Call the peer NEW.")] = None,
    remove: Annotated[bool, typer.Option("--remove", help="Forget the peer and its key.")] = False,
    offline: Annotated[bool, typer.Option("--offline", help="Ask no mailbox server which robots wait.")] = False,
    store: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the known peers (link.finder.peer_store of a file).")
    ] = None,
    json_out: Json = None,
) -> None:
    """List known peers and which of them wait; rename or remove one."""
    from weberlink_anywhere.peers import PeerError, PeerStore  # noqa: PLC0415 - not for the help

    if (rename is not None or remove) and (label is None or (rename is not None and remove)):
        fail("peer: --rename NEW and --remove are for one peer: weberlink peer NAME --remove", MISCONFIGURED)
    known = PeerStore(store)
    with failing(PeerError, MISCONFIGURED, "peer: "):
        if label is not None and remove:
            known.remove(label)
            typer.echo(f"{label} is forgotten; a slave that runs knows it until it is started again")
        elif label is not None and rename is not None:
            known.rename(label, rename)
            typer.echo(f"{label} is now called {rename}")
        else:
            from weberlink_anywhere.survey import survey  # noqa: PLC0415 - not for the help

            found = survey(known, label, ask=not offline)
            write(found.document, json_out, found.show)
