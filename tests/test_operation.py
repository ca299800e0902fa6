"""What a host is set up with is right as far as it can be known without one: units, container, their pages."""

import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from typer import Context
from typer.main import get_command

from tests.hardware.test_guardian import TAKE_OFF
from tests.program import COMMANDS, Program, document
from tests.test_repository import GENERATED
from weberlink.cli import app
from weberlink.cli.arguments import CommandGroup
from weberlink.hardware.guardian import SOCKET
from weberlink.installation import guests
from weberlink.order import MISCONFIGURED
from weberlink.protocol.states import State
from weberlink.session.launcher import STOP_LIMIT_S
from weberlink.session.recorder import FINISH_LIMIT_S
from weberlink.telemetry.fault import Fault

ROOT = Path(__file__).parents[1]
UNITS = ROOT / "configs" / "systemd"
SIDES = ["weberlink-master@.service", "weberlink-slave@.service"]
GUARDIAN = "weberlink-guardian.service"
PROGRAM, PYTHON = "/opt/weberlink/bin/weberlink", "/opt/weberlink/bin/python"
PAGE = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "operation").glob("*.md")))
CONTAINER = (ROOT / "Containerfile").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

Unit = dict[str, list[str]]


def unit(path: Path) -> Unit:
    """Settings of a unit, each with its values in order; comments and sections left out."""
    settings: Unit = defaultdict(list)
    for line in path.read_text(encoding="utf-8").splitlines():
        if line and line[0] not in "#[":
            key, equals, value = line.partition("=")
            assert equals, line
            settings[key].append(value)
    return settings


def options_of(words: list[str]) -> set[str] | None:
    """Those of the command that some words begin with; None if it is of a guest that is not installed."""
    found: Any = get_command(app)
    for word in words:
        if not isinstance(found, CommandGroup) or word.startswith("-"):
            break
        member = found.get_command(Context(found), word)
        if member is None:
            assert word in guests(found.extended_by), words
            return None
        found = member
    return {option for parameter in found.params for option in parameter.opts}


def assert_starts_a_command(path: Path) -> None:
    program, *words = unit(path)["ExecStart"][0].split()
    assert program == PROGRAM
    assert {word for word in words if word.startswith("--")} <= (options_of(words) or set())


@pytest.mark.parametrize("name", SIDES)
def test_a_unit_starts_a_command_that_is_there_and_waits_for_longer_than_it(name: str) -> None:
    settings = unit(UNITS / name)
    assert_starts_a_command(UNITS / name)
    # A recorder is waited for, told to finish, and waited for again.
    assert int(settings["TimeoutStopSec"][0]) > STOP_LIMIT_S + 2 * FINISH_LIMIT_S
    assert (settings["KillSignal"], settings["KillMode"]) == (["SIGTERM"], ["mixed"])
    assert settings["RestartPreventExitStatus"] == [str(MISCONFIGURED)]


def systemd_analyze(*arguments: object) -> subprocess.CompletedProcess[str]:
    program = shutil.which("systemd-analyze") or pytest.skip("there is no systemd-analyze here (Debian's systemd)")
    command = [program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def assert_accepted_and_little_exposed(unit_file: Path, folder: Path, most: int = 25) -> None:
    """By systemd, with programs that are there."""
    path = folder / unit_file.name.replace("@", "@lan")
    started = r"^(Exec\w+=)/opt/\S+"
    text = re.sub(started, rf"\g<1>{sys.executable}", unit_file.read_text(encoding="utf-8"), flags=re.M)
    path.write_text(text, encoding="utf-8")
    verified = systemd_analyze("verify", "--man=no", path)
    assert (verified.returncode, [line for line in verified.stderr.splitlines() if path.name in line]) == (0, [])
    done = systemd_analyze("security", "--offline=true", f"--threshold={most}", "--no-pager", path)
    if "unrecognized option" in done.stderr:
        pytest.skip("this systemd-analyze does not look at files")
    assert done.returncode == 0, done.stdout.splitlines()[-1:]


def test_the_guardian_outlives_the_units_that_insist_on_it() -> None:
    """It is in no control group of theirs and another user's, and its end writes the zeros that are left."""
    guardian = unit(UNITS / GUARDIAN)
    assert_starts_a_command(UNITS / GUARDIAN)
    socket = next(each.default for each in COMMANDS["guardian"].params if each.name == "socket")
    assert str(socket) == SOCKET == f"/run/{guardian['RuntimeDirectory'][0]}/socket"
    (post,) = guardian["ExecStopPost"]
    assert post.split() == [PYTHON, *TAKE_OFF, str(Path(SOCKET).parent)]
    assert (guardian["Type"], guardian["KillMode"], guardian["Restart"]) == (["notify"], ["control-group"], ["always"])
    for name in SIDES:
        settings = unit(UNITS / name)
        assert f"WEBERLINK_GUARDIAN={SOCKET}" in settings["Environment"]
        assert all(GUARDIAN in settings[order][0].split() for order in ("Wants", "After"))
        assert settings["User"] != guardian["User"]
        assert settings["SupplementaryGroups"] == guardian["Group"], "which may use the socket"


@pytest.mark.parametrize("name", [*SIDES, GUARDIAN])
def test_systemd_accepts_a_unit_and_finds_it_little_exposed(name: str, tmp_path: Path) -> None:
    assert_accepted_and_little_exposed(UNITS / name, tmp_path)


CONFINED = """
import ctypes, os, sys
libc = ctypes.CDLL(None, use_errno=True)
assert libc.prctl(38, 1, 0, 0, 0) == 0  # PR_SET_NO_NEW_PRIVS
if libc.prctl(65, 1, 0, 0, 0) != 0:  # PR_SET_MDWE, PR_MDWE_REFUSE_EXEC_GAIN
    sys.exit(77)
os.execv(sys.argv[1], sys.argv[1:])
"""


@pytest.mark.realtime
def test_a_session_runs_without_new_privileges_and_writable_code() -> None:
    """As the units ask with NoNewPrivileges= and MemoryDenyWriteExecute=, which the kernel applies to children too."""
    with Program("loopback", "--duration", 1, "--json", "-", prefix=(sys.executable, "-c", CONFINED)) as session:
        status, output, errors = session.finish()
    if status == 77:
        pytest.skip("this kernel cannot be asked to refuse writable code: PR_SET_MDWE is of Linux 6.3")
    assert (status, errors) == (0, "")
    assert document(output)["outcome"] == "completed"


def test_what_the_container_copies_is_there_and_is_all_that_is_needed() -> None:
    copied = [source for line in re.findall(r"^COPY (.+) \S+$", CONTAINER, re.M) for source in line.split()]
    for source in copied:
        assert (ROOT / source).exists(), source
    links = {link.name for link in (ROOT / "src" / "weberlink").iterdir() if link.is_symlink()}
    assert {"src", *links} <= {source.rstrip("/") for source in copied}
    needed = {PROJECT["project"]["readme"], *PROJECT["project"]["license-files"], "pyproject.toml"}
    assert {name for name in needed if not name.startswith("src/")} <= set(copied)


def test_commands_and_options_of_all_pages_are_there() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages if page.name not in GENERATED)
    named = re.findall(r"(?:^|`|/bin/)weberlink ([a-z][^\n`#]*)", text, re.M)
    assert len(named) > 100
    for line in named:
        options = options_of(line.split())
        assert options is None or set(re.findall(r"(?<!\S)--[a-z-]+", line)) <= options, line


def test_every_state_and_every_fault_has_its_line() -> None:
    rows = "\n".join(line for line in PAGE.splitlines() if line.startswith("|"))
    for state in State:
        assert f"`{state.name.lower()}`" in rows
    for fault in list(Fault)[1:]:
        assert re.search(rf"^\| `{fault.name.lower()}` \|", rows, re.M), fault
