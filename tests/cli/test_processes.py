"""What only processes show of the commands: signals, missing packages, ports and sessions of others, imports."""

import json
import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.compiled import COMPILED
from tests.program import PATIENT, ROOT, Ended, Program, document, free_port
from tests.session.packages import install
from tests.session.systems import CONFIGS
from tests.wait import PATIENCE
from weberlink.installation import install_line
from weberlink.protocol.keys import generate

LOOPBACK, LAN = CONFIGS / "loopback.yaml", CONFIGS / "lan.yaml"


def python(*arguments: object, **environment: str) -> Ended:
    """A process of Python, to its end."""
    command = [sys.executable, *map(str, arguments)]
    ended = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    return Ended(ended.returncode, ended.stdout, ended.stderr)


# --- imports: they take most of the time to the first line of a command, or to its daemons

IMPORTED = """
import contextlib, io, json, os, socket, sys
def tell(*_line, **_options):
    json.dump(sorted(sys.modules), sys.__stdout__)
    sys.__stdout__.flush()
    os._exit(0)
socket.send_fds = tell
from weberlink.cli import main
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    main(sys.argv[1:])
tell()
"""
"""Ends with the modules that are there when a command is done, or orders its first daemon, which waits since before."""
SLOW = {"numpy", "scipy", "matplotlib", "uvloop", "asyncio", "rich", "aiohttp", "mcap"}
PROGRAMS = tuple(f"weberlink.cli.{name}" for name in ("check", "device", "rules", "shipped"))
LATE = {f"weberlink.{name}" for name in ("telemetry.reader", "session.summary", "session.daemon")}


@pytest.mark.parametrize(
    ("command", "there", "absent"),
    [
        ("--help", "weberlink.cli", {"pydantic", "yaml", "weberlink.config", "weberlink.protocol"}),
        ("loopback", "weberlink.session.launcher", LATE | {"weberlink.session.recorder"}),
    ],
)
def test_a_command_imports_what_it_needs_when_it_needs_it(command: str, there: str, absent: set[str]) -> None:
    ended = python("-c", IMPORTED, command, FORCE_COLOR="1")  # a status line would be shown
    assert (ended.status, ended.errors) == (0, "")
    modules = set(json.loads(ended.output))
    assert there in modules
    assert not modules & (SLOW | absent)
    guests = ("weberlink_",) if command != "--help" else ()  # which is that of their commands too
    assert not [name for name in modules - {COMPILED} if name.startswith((*PROGRAMS, *guests))]


# --- packages

HIDDEN = """
import importlib.metadata, json, sys
importlib.metadata.entry_points = lambda **_: ()  # no guest is installed
sys.modules.update(dict.fromkeys(["matplotlib", "mujoco", "scipy"]))
from tests.program import weberlink
json.dump([weberlink(*line) for line in json.loads(sys.argv[1])], sys.stdout)
"""
PREDICTORS = "is of weberlink-predictors, which is not installed; install it with: "
WITHOUT = [
    # A package is asked for where it is needed only, and after what is nearer: a name that is wrong.
    (["doctor"], 2, install_line("doctor")),
    (["loopback", "--record", "a.mcap"], 2, "--record is of weberlink-recording, which is not installed; install it"),
    (["record", "info", "a.mcap"], 2, install_line("recording")),
    (["check", LOOPBACK, "--set", "master.device.driver=touch"], 2, install_line("devices")),
    (["device", "test", "operator"], 2, install_line("doctor")),
    *(
        (["check", LOOPBACK, "--set", f"codec.force.{setting}"], 2, f"{PREDICTORS}{install_line('predictors')}")
        for setting in ("predictor=adaptive", "predictor=surface", "bank=[zoh, path]", "deadband={shape: cone}")
    ),
]


def test_a_missing_package_is_one_line_with_what_installs_it() -> None:
    lines = [[str(word) for word in line] for line, _, _ in WITHOUT]
    ended = python("-c", HIDDEN, json.dumps(lines))
    assert ended.status == 0, ended.errors
    for (line, status, part), found in zip(WITHOUT, json.loads(ended.output), strict=True):
        assert (found[0], len(found[2].splitlines())) == (status, int(status != 0)), (line, found)
        assert part in found[2]


COMMAND = """
import typer
from weberlink.cli.arguments import File
from weberlink.config import load
def rate(file: File) -> None:
    typer.echo(f"{load(file).system.rate_hz:g} Hz")
"""


@pytest.mark.parametrize(
    ("group", "words"),
    [("commands", ["rate"]), ("bridges", ["bridge", "rate"]), ("device_commands", ["device", "rate"])],
)
def test_command_of_another_distribution_runs(tmp_path: Path, group: str, words: list[str]) -> None:
    install(tmp_path, "rates", {"rates": COMMAND}, f"[weberlink.{group}]\nrate = rates:rate\n")
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    assert python("-m", "weberlink", *words, LOOPBACK, PYTHONPATH=paths) == (0, "1000 Hz\n", "")


def told(program: Program, lasts: float = 0.0) -> str:
    """What a command that failed says, without notes; no traceback."""
    status, output, errors = program.finish(lasts)
    assert (status, "Traceback" in errors) == (1, False)
    return " ".join((output + errors).split())


@pytest.mark.realtime
def test_a_master_of_another_file_or_key_is_told_which(tmp_path: Path) -> None:
    port = free_port()
    for key in "ab":
        generate(tmp_path / key)

    def arguments(key: str, *further: str) -> list[str]:
        settings = (f"link.listen=127.0.0.1:{port}", f"link.slave=127.0.0.1:{port}", f"link.key_file={tmp_path / key}")
        return [f"--set={each}" for each in (*settings, *further)]

    with Program("slave", LAN, *arguments("a")) as slave:
        slave.telemetry("slave")
        with Program("slave", LAN, *arguments("a")) as other:
            assert f"127.0.0.1:{port} is in use" in told(other)
        others = ((("a", "codec.force.weber=0.2"), "codec.force.weber"), (("b",), "keys"))
        with ExitStack() as stack:
            masters = [
                stack.enter_context(Program("master", LAN, *arguments(*given), "--duration", 3)) for given, _ in others
            ]
            for master, (_, part) in zip(masters, others, strict=True):
                assert part in told(master, 3.0)


@pytest.mark.realtime
def test_sessions_do_not_disturb_each_other_and_end_by_ctrl_c_with_what_they_have() -> None:
    with Program("loopback", *PATIENT) as first:
        first.engaged("slave")
        with Program("loopback", *PATIENT, "--json", "-") as second:
            second.engaged("slave")
            second.send(signal.SIGINT)  # a second one would end it at once, as failed
            status, output, _ = second.finish()
            assert (status, document(output)["outcome"], second.rings()) == (0, "interrupted", [])
        assert len(first.daemons()) >= 2, "the first one goes on"
        first.send(signal.SIGINT)
        status, _, errors = first.finish()
        assert (status, errors, first.rings()) == (0, "", [])
