"""The `peers` command."""

from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.output import fail
from weberlink.system.order import MISCONFIGURED


def peers(
    label: Annotated[str | None, typer.Argument(metavar="[NAME]", help="One known peer; default: all.")] = None,
    rename: Annotated[str | None, typer.Option(metavar="NEW", help="Call the peer NEW.")] = None,
    remove: Annotated[bool, typer.Option("--remove", help="Forget the peer and its key.")] = False,
    store: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the known peers (link.peer_store of a file).")
    ] = None,
) -> None:
    """List the known peers; rename or remove one."""
    from weberlink.anywhere.peers import PeerError, PeerStore  # noqa: PLC0415 - each command imports what it needs

    known = PeerStore(store)
    try:
        if label is not None and remove:
            known.remove(label)
        elif label is not None and rename is not None:
            known.rename(label, rename)
        for peer in known if label is None else ():
            typer.echo(f"{peer.label}  {peer.role} {peer.name}")
    except PeerError as error:
        fail(f"peers: {error}", MISCONFIGURED)
