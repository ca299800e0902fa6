"""Commands that run a system or one side of it."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from weberlink.cli.arguments import Duration, File, Json, Log, OptionalFile, Record, Set, file_target
from weberlink.cli.output import attempt, errors, fail, finish, progress_bar, tell, write
from weberlink.order import MASTER, MISCONFIGURED, NOTE, SIDES, SLAVE
from weberlink.session.targets import STANDARD_OUTPUT

if TYPE_CHECKING:
    from weberlink.session.advice import DryRun
    from weberlink.telemetry.reader import Records

PeerLabel = Annotated[str | None, typer.Option("--peer", metavar="NAME", help="Meet this known peer only.")]


# Each command imports what it needs when it runs.


def loopback(
    file: OptionalFile = None,
    duration: Duration = None,
    json_out: Json = None,
    record: Record = None,
    log: Log = None,
    set_: Set = None,
) -> None:
    """Run both sides as two processes over UDP on 127.0.0.1."""
    path = file or Path(str(files("weberlink.configs") / "loopback.yaml"))
    given = set_ or []
    _live("loopback", path, lambda: [*given, *one_host(path, given)], duration, json_out, record, log)


def master(
    file: File,
    duration: Duration = None,
    json_out: Json = None,
    record: Record = None,
    log: Log = None,
    set_: Set = None,
    take_over: Annotated[
        bool, typer.Option("--take-over", help="Replace the master that the slave serves now, which then stops.")
    ] = False,
    join: Annotated[
        bool, typer.Option("--join", help="Ask for the code that a robot shows, pair with it, then run.")
    ] = False,
    peer: PeerLabel = None,
) -> None:
    """Run the operator side."""
    given = set_ or []
    _live(
        "master", file, lambda: [*given, *acquainted(file, given, MASTER, peer, pairs=join)],
        duration, json_out, record, log, take_over=take_over,
    )  # fmt: skip


def slave(
    file: File,
    duration: Duration = None,
    json_out: Json = None,
    record: Record = None,
    log: Log = None,
    set_: Set = None,
    invite: Annotated[
        bool, typer.Option("--invite", help="Show a code by which an operator pairs with this robot, then run.")
    ] = False,
    accept: Annotated[
        bool, typer.Option("--accept", help="With --invite: keep the operator's key without a question.")
    ] = False,
    right: Annotated[
        Literal["drive", "watch", "stop"] | None,
        typer.Option("--right", help="With --invite: what the host that pairs may do; drive: all three."),
    ] = None,
    peer: PeerLabel = None,
) -> None:
    """Run the teleoperator side."""
    given = set_ or []
    _live(
        "slave", file,
        lambda: [*given, *acquainted(file, given, SLAVE, peer, pairs=invite, accept=accept, right=right)],
        duration, json_out, record, log,
    )  # fmt: skip


def acquainted(
    path: Path,
    overrides: Sequence[str],
    side: str,
    label: str | None,
    *,
    pairs: bool,
    accept: bool = False,
    right: str | None = None,
) -> list[str]:
    """Overrides by which the path finder of the file meets a peer; the two hosts are paired first if `pairs`."""
    if not pairs and label is None and not accept and right is None:
        return []
    from weberlink.config import ConfigurationError, load  # noqa: PLC0415

    if (accept or right is not None) and not pairs:
        raise ConfigurationError(f"{'--accept' if accept else '--right'}: goes with --invite")
    asked = "--peer" if not pairs else "--join" if side == MASTER else "--invite"
    configuration = load(path, overrides, [side])
    if configuration.finder is None:
        raise ConfigurationError(f"{asked}: needs link.finder in the file, which knows other hosts by name")
    if pairs:
        code = ""
        if side == MASTER:  # not an argument: other users of the host can read those
            if sys.stdin.isatty():
                sys.stderr.write("Code that the robot's host shows: ")
                sys.stderr.flush()
            code = sys.stdin.readline().strip()
            if not code:
                raise ConfigurationError("--join: standard input gave no code; the robot's host shows it")
        pair = configuration.finder.driver.pair
        label = pair(configuration, side, code, label, accept=accept, right=right or "drive")
        if side == SLAVE:  # which waits for all that it knows
            return []
    return [f"link.finder.peer={json.dumps(label)}"]


def one_host(path: Path, overrides: Sequence[str]) -> list[str]:
    """Overrides by which both sides meet on this host, several loopbacks at once too: a port that is free replaces 0;
    raises ConfigurationError if the file is wrong, or of two hosts that pair.
    """
    import socket  # noqa: PLC0415

    from weberlink.config import ConfigurationError, load  # noqa: PLC0415
    from weberlink.config.model import split_address  # noqa: PLC0415

    configuration = load(path, overrides)
    if configuration.finder is not None:
        raise ConfigurationError(
            f"{path}: link.finder is for two hosts; for weberlink loopback add --set link.finder=null "
            "--set link.security=session --set link.listen=127.0.0.1:47000"
        )
    host, port = split_address(configuration.system.link.listen)
    if port != 0:
        return []
    is_v6 = ":" in host
    with socket.socket(socket.AF_INET6 if is_v6 else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        port = probe.getsockname()[1]
    address = json.dumps(f"[{host}]:{port}" if is_v6 else f"{host}:{port}")  # quoted, for YAML
    return [f"link.listen={address}", f"link.slave={address}"]


def remote(
    file: File,
    stop: Annotated[bool, typer.Option("--stop", help="Stop the robot at once; its side ends.")] = False,
    peer: PeerLabel = None,
    json_out: Json = None,
    set_: Set = None,
) -> None:
    """Ask the robot's side over the link whom it serves, or stop it.

    The key of this host must be good for it (weberlink keygen --right). FILE is the master's; no device is opened.
    """
    from weberlink.cli.remote import ask  # noqa: PLC0415
    from weberlink.config import load  # noqa: PLC0415
    from weberlink.protocol.keys import Right  # noqa: PLC0415
    from weberlink.text import one_line  # noqa: PLC0415

    overrides = [*(set_ or ()), *acquainted(file, set_ or (), MASTER, peer, pairs=False)]
    told = ask(load(file, overrides, [MASTER]), Right.STOP if stop else Right.WATCH)
    lines = [f"{name}: {one_line(str(value))}" for name, value in told.items()]
    write({**told, "stopped": stop}, json_out, lambda console: console.print("\n".join(lines), markup=False))


def simulate(
    file: File,
    duration: Duration = None,
    json_out: Json = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT", callback=file_target, help="Write the robot's commanded position and measured force as CSV."
        ),
    ] = None,
    record: Record = None,
    set_: Set = None,
) -> None:
    """Run the whole system in virtual time.

    60 s of it by default, in about 12 s. Ctrl-C ends it with the report of the simulated time so far.
    """
    from weberlink.config import ConfigurationError, load  # noqa: PLC0415
    from weberlink.session.advice import dry_run  # noqa: PLC0415
    from weberlink.session.report import report_type  # noqa: PLC0415
    from weberlink.session.simulation import DEFAULT_DURATION, TraceRecorder, refuse_live, simulate as run  # noqa: PLC0415

    configuration = load(file, set_ or ())
    if trace is not None and configuration.system.codec.joints is not None:
        raise ConfigurationError(
            f"--trace: {file}: an arm has joints, not one position; use --record and weberlink record export"
        )
    refuse_live(configuration)
    report, recorder = report_type()(configuration), TraceRecorder()
    say_advice(dry_run(configuration))
    observers = [report.add] if trace is None else [report.add, recorder.add]
    recording, length = None, DEFAULT_DURATION if duration is None else duration
    if record is not None:
        from weberlink.session.recorder import virtual_recording  # noqa: PLC0415

        recording = virtual_recording(configuration, record, tell)
        observers.append(recording.add)
    with progress_bar() as progress:

        def show(master: "Records", _: "Records") -> None:
            done = (int(master["tick"][-1]) + 1) * configuration.system.tick_period
            progress(round(min(done, length), 1), length, "s")

        facts = run(configuration, duration, [*observers, show])
    facts["recording"] = None if recording is None else recording.finish()
    ended = report.end(facts)
    problem = None if trace is None else attempt(lambda: recorder.save(trace), trace)
    if facts.get("interrupted") and problem is None:
        problem = f"interrupted: {ended.document['duration_s']:.1f} s of simulated time are done, and in the report"
    finish(ended, f"weberlink simulate {file}", json_out, problem)


def _live(
    name: str,
    path: Path,
    find_overrides: Callable[[], list[str]],
    duration: float | None,
    json_out: Path | None,
    record: Path | None,
    log: Path | None,
    *,
    take_over: bool = False,
) -> None:
    from weberlink.session.waiting import WaitingDaemon  # noqa: PLC0415

    sides: Any = [name] if name in SIDES else SIDES
    if log == json_out == STANDARD_OUTPUT:
        fail("--log -: standard output is taken by --json -; write one of them to a file", MISCONFIGURED)
    with ExitStack() as stack:
        opened = None
        if log is not None:
            from weberlink.session.report import report_type  # noqa: PLC0415

            opened = stack.enter_context(report_type().open_log(log))
        # Their imports take as long as ours, which follow.
        waiting = {side: stack.enter_context(WaitingDaemon(side)) for side in sides}
        from weberlink.config import load  # noqa: PLC0415
        from weberlink.session.advice import dry_run  # noqa: PLC0415
        from weberlink.session.launcher import LiveRun  # noqa: PLC0415
        from weberlink.session.report import chosen_report, report_type  # noqa: PLC0415
        from weberlink.telemetry.runtime_directory import directory  # noqa: PLC0415

        with errors(lambda trace: None if opened is None else opened.trace(trace)):
            overrides = find_overrides()
            configuration = load(path, overrides, sides)
            parts = dry_run(configuration)
            report = chosen_report()
            directory()
            if record is not None:
                from weberlink.session.recorder import format_for  # noqa: PLC0415

                format_for(record)
        on_delay = say_advice(parts)
        with LiveRun(
            configuration, overrides, sides, duration, status_display, record,
            lambda: report_type(report)(configuration, sides, opened),
            take_over=take_over, tell=tell, on_delay=on_delay, waiting=waiting,
        ) as run:  # fmt: skip
            ended = run.run()
    finish(ended, f"weberlink {name}", json_out, quiet=log == STANDARD_OUTPUT)


def say_advice(parts: "DryRun") -> Callable[[float], str | None]:
    """Say the advice on a file; returns what gives that on a measured round trip [s]."""
    from weberlink.session.advice import advise, on_measured_delay  # noqa: PLC0415

    for line in advise(parts):
        tell(f"{NOTE}{line}")
    return on_measured_delay(parts)


@contextmanager
def status_display() -> Iterator[Any]:
    """Show the status of a session in one line on standard error if it is a terminal; None if it is not."""
    from rich.console import Console  # noqa: PLC0415
    from rich.live import Live  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with Live(Text("starting"), console=console, refresh_per_second=10, transient=True) as live:
        yield lambda line: live.update(Text(line))
