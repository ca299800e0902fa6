"""The `try` command."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer

from weberlink.cli.arguments import MONITOR_PORT, Duration, Json, OptionalFile, Set
from weberlink.cli.output import errors, fail, finish
from weberlink.system.order import FAILED, MISCONFIGURED

NAME = "weberlink try"
LEFT_S = 60.0
"""How long the page of one person may be closed before the session ends [s]."""


def try_session(
    file: OptionalFile = None,
    scene: Annotated[
        str | None, typer.Option(metavar="NAME", help="Scene to begin with: dome, plane, box, bumps, cavity, moving.")
    ] = None,
    scripted: Annotated[
        bool, typer.Option("--scripted", help="Let a script move the handle until a visitor takes it.")
    ] = False,
    duration: Duration = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help=f"Port of the page; default: {MONITOR_PORT}, or a free one if that is in use."
        ),
    ] = None,
    browse: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = False,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address of the page; one that other hosts can reach needs --public.")
    ] = "127.0.0.1",
    public: Annotated[
        bool,
        typer.Option("--public", help="Allow other hosts, without encryption; who has the printed address may drive."),
    ] = False,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Feel a remote scene with the mouse, in a browser.

    Until Ctrl-C, or until its page has been closed for a minute; with --public until Ctrl-C.
    """
    from weberlink.apps.monitor import access, address  # noqa: PLC0415 - each command imports what it needs
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    with errors():
        for package in ("aiohttp", "prometheus_client"):
            need(package, "monitor", NAME)
    if not (public or access.is_loopback(listen)):
        fail(f"--listen {listen}: the page is not encrypted; add --public to serve it to other hosts", MISCONFIGURED)
    order = try_order(file, scene, set_ or [], duration, scripted=scripted)
    try:
        listening = address.bind(listen, MONITOR_PORT if port is None else port, or_any=port is None)
    except address.MonitorError as error:
        fail(str(error), FAILED)
    token = access.new_token()
    # Visitors of other hosts come and go.
    left_s = LEFT_S if duration is None and access.is_loopback(listen) else None
    _tell(f"open {address.url(listening, token)}")
    _tell(_ends(duration, left_s))
    if port is None and listening.getsockname()[1] != MONITOR_PORT:
        _tell(f"port {MONITOR_PORT} is in use, so this page has another one")
    if not access.is_loopback(listen):
        _tell(f"other hosts: {address.public_url(listening, token)}")
        _tell("warning: who has this address may drive and change the session, and nothing is encrypted")
    from weberlink.apps.monitor.program import MonitorSettings, TrySession, run  # noqa: PLC0415 - takes most of a second

    result = run(MonitorSettings(listen, browse=browse), TrySession(order, listening, token, left_s))
    if result is None:
        raise typer.Exit
    if result.report is None:
        fail(result.complaint, result.status)
    finish(result.report | {"status": result.status}, NAME, json_out)


def _ends(duration: float | None, left_s: float | None) -> str:
    """How it ends, for the user."""
    if duration is not None:
        return f"it ends after {duration:g} s, or by Ctrl-C"
    return "Ctrl-C ends it" if left_s is None else f"Ctrl-C ends it, and so does a page that is closed for {left_s:g} s"


def try_order(
    file: Path | None, scene: str | None, overrides: list[str], duration: float | None, *, scripted: bool
) -> Any:
    """The sessions to run: those of the scenes of the shipped file, or of another file, which has one scene."""
    from weberlink.apps.monitor.launcher import TryOrder  # noqa: PLC0415
    from weberlink.system.scenes import SCENES  # noqa: PLC0415

    if file is not None:
        if scene is not None:
            fail("--scene is for the shipped configuration; give no FILE", MISCONFIGURED)
        script = ["master.device.scripted=true"] if scripted else []
        return TryOrder(str(file), (*overrides, *script), duration_s=duration)
    first = next(iter(SCENES)) if scene is None else scene
    if first not in SCENES:
        fail(f"--scene {scene}: no such scene; there are {', '.join(SCENES)}", MISCONFIGURED)
    path = str(files("weberlink.configs") / "try.yaml")
    script = [f"master.device.scripted={str(scripted).lower()}"]
    return TryOrder(path, (*script, *overrides), SCENES, first, duration)


def _tell(text: str) -> None:
    typer.echo(f"{NAME}: {text}", err=True)
