"""The commands `monitor` and `try`."""

import json
from contextlib import suppress
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from weberlink.cli.arguments import (
    Duration,
    Json,
    Listen,
    OptionalFile,
    Public,
    SessionName,
    Set,
    check_public,
)
from weberlink.cli.output import fail, failing, finish, tell
from weberlink.installation import install_line
from weberlink.order import MISCONFIGURED
from weberlink.text import is_loopback

if TYPE_CHECKING:
    from weberlink_page.launcher import TryOrder

# Robots share their host with other tools, whose ports this one avoids: 8765 of Foxglove's bridge, which LeRobot starts
# too; 9090 of rosbridge and Prometheus; 9876 and 9877 of Rerun; 7000 of MeshCat; 5000, 5555, 8000, 8080, 8081 and 8888
# of web servers, notebooks and ZeroMQ. IANA assigns 8724 to nobody; Linux takes it for no outgoing connection.
MONITOR_PORT = 8724  # port of the live page where none is given
Port = Annotated[
    int | None, typer.Option(min=0, max=65535, help=f"Port of the page; 0 for any free one; default: {MONITOR_PORT}.")
]
Browse = Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")]
NAME = "weberlink try"
LEFT_S = 60.0  # how long the page of one person may be closed before the session ends [s]


def monitor(
    port: Port = None,
    listen: Listen = "127.0.0.1",
    public: Public = False,
    session: SessionName = None,
    browse: Browse = False,
    recordings: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the recordings that the page starts; made on first use.")
    ] = Path("recordings"),
) -> None:
    """Show running sessions in a browser.

    Until Ctrl-C. The same address has figures for Prometheus.
    """
    from weberlink_page.address import MonitorError  # noqa: PLC0415 - each command imports what it needs
    from weberlink_page.program import MonitorSettings, run  # noqa: PLC0415

    check_public(listen, public)
    if not is_loopback(listen):
        tell(f"warning: {listen}: not encrypted, and everybody who can reach it sees everything")
    with failing(MonitorError):
        run(MonitorSettings(listen, MONITOR_PORT if port is None else port, session, browse, recordings))


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
    from weberlink.config.cameras import CAMERAS  # noqa: PLC0415 - each command imports what it needs
    from weberlink_page import access, address  # noqa: PLC0415

    check_public(listen, public)
    order = try_order(file, scene, set_ or [], duration, scripted=scripted)
    if CAMERAS:
        order = replace(order, overrides=(*cameras_to_try(order), *order.overrides))
    with failing(address.MonitorError):
        listening = address.bind(listen, MONITOR_PORT if port is None else port, or_any=port is None)
    token, is_own = access.new_token(), is_loopback(listen)
    left_s = LEFT_S if duration is None and is_own else None  # visitors of other hosts come and go
    ends = "Ctrl-C ends it" if left_s is None else f"Ctrl-C ends it, and so does a page that is closed for {left_s:g} s"
    told = [f"open {address.url(listening, token)}"]
    told.append(ends if duration is None else f"it ends after {duration:g} s, or by Ctrl-C")
    if port is None and listening.getsockname()[1] != MONITOR_PORT:
        told.append(f"port {MONITOR_PORT} is in use, so this page has another one")
    if not is_own:
        told.append(f"other hosts: {address.public_url(listening, token)}")
        told.append("warning: who has this address may drive and change the session, and nothing is encrypted")
    told += [f"to see the robot's camera: {install_line(guest)}" for guest in CAMERAS.absent().values()]
    for line in told:
        typer.echo(f"{NAME}: {line}", err=True)
    from weberlink_page.program import MonitorSettings, TrySession, run  # noqa: PLC0415 - takes most of a second

    result = run(MonitorSettings(listen, browse=browse), TrySession(order, listening, token, left_s))
    if result is None:
        return
    if result.report is None:
        fail(result.complaint, result.status)
    from weberlink_figures.reporting import told as told_of  # noqa: PLC0415 - where there is a report
    from weberlink_page.report import figures_of  # noqa: PLC0415

    finish(told_of(replace(figures_of(result.report), status=result.status)), NAME, json_out)


def cameras_to_try(order: "TryOrder") -> tuple[str, ...]:
    """An override by which a camera driver that is installed shows the robot, where the file names no cameras."""
    from weberlink.config import ConfigurationError, load  # noqa: PLC0415
    from weberlink.config.cameras import CAMERAS  # noqa: PLC0415

    with suppress(ConfigurationError):  # the session says what is wrong
        slave = load(Path(order.file), order.overrides, sides=()).system.slave
        if slave.cameras is None:
            shown = {name: CAMERAS.load(name).preview(slave.robot.driver) for name in CAMERAS}
            return tuple(f"slave.cameras={json.dumps({'driver': name} | of)}" for name, of in shown.items())[:1]
    return ()


def try_order(
    file: Path | None, scene: str | None, overrides: list[str], duration: float | None, *, scripted: bool
) -> "TryOrder":
    """The sessions to run: those of the scenes of the shipped file, or of another file, which has one scene."""
    from weberlink_page.launcher import SCENES, TryOrder  # noqa: PLC0415

    if file is not None:
        if scene is not None:
            fail("--scene is for the shipped configuration; give no FILE", MISCONFIGURED)
        script = ["master.device.scripted=true"] if scripted else []
        return TryOrder(str(file), (*overrides, *script), duration_s=duration)
    first = next(iter(SCENES)) if scene is None else scene
    if first not in SCENES:
        fail(f"--scene {scene}: no such scene; there are {', '.join(SCENES)}", MISCONFIGURED)
    path = str(files("weberlink_page.configs") / "try.yaml")
    script = [f"master.device.scripted={str(scripted).lower()}"]
    return TryOrder(path, (*script, *overrides), SCENES, first, duration)
