"""The `doctor` command."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import Json, OptionalFile, Set
from weberlink.cli.output import errors, fail, write
from weberlink.system.order import COMPLETED, FAILED, MASTER, MISCONFIGURED, SIDES

Side = Annotated[
    Literal["master", "slave"] | None, typer.Option("--side", help="Check what this side needs; default: both.")
]


Network = Annotated[
    str | None,
    typer.Option(
        "--network",
        metavar="PEER|HOST",
        help="Measure the link to the waiting slave instead, and name settings that suit it: of a known peer with "
        "link.path ice, else of HOST or HOST:PORT. No device is opened, and the robot does not move.",
    ),
]
Seconds = Annotated[
    float, typer.Option("--duration", metavar="S", min=1.0, max=600.0, help="Of the measurement of the link [s].")
]


def doctor(
    file: OptionalFile = None,
    side: Side = None,
    network: Network = None,
    seconds: Seconds = 10.0,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Check this machine, or the link to the robot.

    For real time, with FILE for what that needs; or with --network the link. Suggests fixes, takes some seconds.
    """
    if network is not None:
        _doctor_network(file, network, seconds, json_out, set_ or [])
    from weberlink.apps.doctor import Grade, Needs, examine  # noqa: PLC0415 - each command imports what it needs
    from weberlink.system.configuration import load  # noqa: PLC0415

    if file is None and set_:
        fail("--set: needs a FILE", MISCONFIGURED)
    sides = SIDES if side is None else (side,)
    with errors():
        needs = Needs(sides=sides) if file is None else Needs.of(load(file, set_ or (), sides), sides)
    from rich.console import Console  # noqa: PLC0415 - slow import

    console = Console(stderr=True)
    with console.status("measuring for some seconds") if console.is_terminal else nullcontext():
        found = examine(needs)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)


def _doctor_network(file: Path | None, peer: str, seconds: float, json_out: Path | None, overrides: list[str]) -> None:
    from weberlink.apps.doctor import Grade  # noqa: PLC0415 - each command imports what it needs
    from weberlink.apps.doctor.link_report import examine_network, towards  # noqa: PLC0415
    from weberlink.system.configuration import load  # noqa: PLC0415

    if file is None:
        fail("--network: needs a FILE", MISCONFIGURED)
    with errors():
        overrides = towards(peer, load(file, overrides, [MASTER]).system.link, overrides)
        configuration = load(file, overrides, [MASTER])
    from rich.console import Console  # noqa: PLC0415 - slow import

    console = Console(stderr=True)
    with console.status(f"measuring for {seconds:g} s") if console.is_terminal else nullcontext(), errors():
        found = examine_network(configuration, overrides, seconds)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)
