"""The commands `doctor` and `device test`."""

import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from weberlink.cli.arguments import Json, Set
from weberlink.cli.output import fail, write
from weberlink.order import COMPLETED, FAILED, MISCONFIGURED, SIDES


def doctor(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Configuration whose needs are checked; default: the usual.")
    ] = None,
    side: Annotated[
        Literal["master", "slave"] | None, typer.Option("--side", help="Check what this side needs; default: both.")
    ] = None,
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            metavar="PEER|HOST",
            help="Measure the link to the waiting slave instead, and name settings that suit it: of a known peer where "
            "link.finder finds a path, else of HOST or HOST:PORT. No device is opened, and the robot does not move.",
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option("--duration", metavar="S", min=1.0, max=600.0, help="Of the measurement of the link [s].")
    ] = 10.0,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Check this machine, or the link to the robot.

    For real time, with FILE for what that needs; or with --link the link. Suggests fixes, takes some seconds.
    """
    from rich.console import Console  # noqa: PLC0415

    from weberlink.config import load  # noqa: PLC0415
    from weberlink_doctor.host.examination import advised, examine  # noqa: PLC0415
    from weberlink_doctor.report import Grade, Needs  # noqa: PLC0415

    overrides, sides = set_ or [], SIDES if side is None else (side,)
    if file is None and (link is not None or overrides):
        fail(f"{'--set' if link is None else '--link'}: needs a FILE", MISCONFIGURED)
    console = Console(stderr=True)
    with console.status("measuring for some seconds") if console.is_terminal else nullcontext():
        if file is None:
            found = examine(Needs(sides=sides))
        elif link is None:
            configuration = load(file, overrides, sides)
            found = examine(Needs(configuration.system, sides, file))
            found = replace(found, findings=[*found.findings, *advised(configuration)])
        else:
            from weberlink_doctor.link.examination import examine as examine_link  # noqa: PLC0415

            found = examine_link(file, overrides, link, seconds)
    write(found.document, json_out, found.show)
    raise typer.Exit(FAILED if found.count(Grade.PROBLEM) else COMPLETED)


def device_test(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the driver; `weberlink device list` lists them.")
    ],
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Configuration with options of the driver.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Agree to force and motion in advance.")] = False,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Set an option of the driver; may be repeated."),
    ] = None,
) -> None:
    """Test a device step by step, at last with a gentle force.

    It shows the readings, checks signs without force and, after a yes, with a gentle force.
    """
    from weberlink_doctor.device.commissioning import run  # noqa: PLC0415
    from weberlink_doctor.device.dialog import Dialog  # noqa: PLC0415

    run(name, Dialog(sys.stdin, sys.stdout, yes=yes), config, set_ or ())
