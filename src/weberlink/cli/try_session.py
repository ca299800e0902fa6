"""The `try` command."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer

from weberlink.cli.arguments import (
    MONITOR_PORT,
    Browse,
    Duration,
    Json,
    Listen,
    OptionalFile,
    Port,
    Public,
    Set,
    check_public,
)
from weberlink.cli.output import fail, failing, finish
from weberlink.system.order import MISCONFIGURED

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
    port: Port = None,
    browse: Browse = False,
    listen: Listen = "127.0.0.1",
    public: Public = False,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Feel a remote scene with the mouse, in a browser.

    Until Ctrl-C, or until its page has been closed for a minute; with --public until Ctrl-C.
    """
    from weberlink.apps.monitor import access, address  # noqa: PLC0415 - each command imports what it needs
    from weberlink.system.configuration.extras import need  # noqa: PLC0415

    for package in ("aiohttp", "prometheus_client"):
        need(package, "monitor", NAME)
    check_public(listen, public)
    order = try_order(file, scene, set_ or [], duration, scripted=scripted)
    with failing(address.MonitorError):
        listening = address.bind(listen, MONITOR_PORT if port is None else port, or_any=port is None)
    token, is_own = access.new_token(), access.is_loopback(listen)
    left_s = LEFT_S if duration is None and is_own else None  # visitors of other hosts come and go
    ends = "Ctrl-C ends it" if left_s is None else f"Ctrl-C ends it, and so does a page that is closed for {left_s:g} s"
    told = [f"open {address.url(listening, token)}"]
    told.append(ends if duration is None else f"it ends after {duration:g} s, or by Ctrl-C")
    if port is None and listening.getsockname()[1] != MONITOR_PORT:
        told.append(f"port {MONITOR_PORT} is in use, so this page has another one")
    if not is_own:
        told.append(f"other hosts: {address.public_url(listening, token)}")
        told.append("warning: who has this address may drive and change the session, and nothing is encrypted")
    for line in told:
        typer.echo(f"{NAME}: {line}", err=True)
    from weberlink.apps.monitor.program import MonitorSettings, TrySession, run  # noqa: PLC0415 - takes most of a second

    result = run(MonitorSettings(listen, browse=browse), TrySession(order, listening, token, left_s))
    if result is None:
        return
    if result.report is None:
        fail(result.complaint, result.status)
    finish(result.report | {"status": result.status}, NAME, json_out)


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
