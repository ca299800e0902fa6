"""What the commands print, write and return, for good arguments and for bad ones."""

import json
import re
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from tests.program import COMMANDS, Ended, document, weberlink
from tests.session.systems import CONFIGS
from weberlink.config import load
from weberlink.master.trace import read_trace
from weberlink.session.simulation import TraceRecorder, simulate

FILES = sorted(path.name for path in CONFIGS.glob("*.yaml"))
HARDWARE = ("phantom.yaml",)  # those whose drivers need hardware or its emulator
TAKE_A_FILE = ("check", "simulate", "master --duration 0", "slave --duration 0", "loopback --duration 0")


def run(line: str, *further: object) -> Ended:
    """A command as it is typed in a folder that has `configs`, and further arguments."""
    return weberlink(*(re.sub("^configs/", f"{CONFIGS}/", word) for word in shlex.split(line)), *further)


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("cli") / "weberlink.key"
    assert run("keygen", path).status == 0
    return f"link.key_file={path}"


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_every_command_explains_itself(command: str) -> None:
    ended = run(f"{command} --help")
    assert (ended.status, ended.output[:7], ended.errors) == (0, "Usage: ", "")


def test_a_group_without_a_command_shows_its_help() -> None:
    ended = run("device")
    assert (ended.status, ended.output, ended.errors) == (2, "", run("device -h").output)


LOOPBACK, FIG6, ARM = "configs/loopback.yaml", "configs/fig6.yaml", "configs/phantom.yaml"
WRONG = {
    # The command or the option is not there.
    "loopback --durations 3": "--duration",
    "simulate": "FILE",
    # A number is none, or out of its range.
    "loopback --duration three": "--duration",
    f"simulate {LOOPBACK} --duration -1": "--duration",
    # A field of the file.
    f"check {LOOPBACK} --set codec.force.webber=1": "codec.force.webber: unknown key; did you mean weber?",
    f"master {LOOPBACK} --duration 0": "link.slave",
    # The file is not there, or not for this command.
    "check .": "is a folder",
    f"simulate {ARM}": "polhem_serial",
    # What is to be written has no place; standard output is for --json and --log.
    f"simulate {LOOPBACK} --json /sys/out.json": "--json: /sys",
    f"simulate {LOOPBACK} --trace .": "--trace",
    "loopback --duration 0 --log missing/log": "--log",
    f"simulate {FIG6} --duration 0 --trace -": "--trace",
    "keygen -": "out",
    f"keygen {LOOPBACK}": "loopback.yaml exists already",
    "configs --out a.yaml": "--out",
    "configs deley": "delay",
}


@pytest.mark.parametrize(
    ("line", "field"),
    [*WRONG.items(), *((f"{command} none.yaml", "none.yaml") for command in TAKE_A_FILE)]
    + [(f"{each} {LOOPBACK} --set slave.limits.spead_m_s=1", "slave.limits.spead_m_s") for each in TAKE_A_FILE]
    + [(f"{each} configs/lan.yaml --set link.key_file=none.key", "link.key_file") for each in TAKE_A_FILE],
    ids=lambda value: value[:60],
)
def test_a_wrong_argument_is_one_line_that_names_it(
    line: str, field: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = run(line).complaint()
    assert said.startswith("weberlink: ")
    assert field in said
    assert not list(tmp_path.iterdir()), "nothing is written"


def test_a_file_in_place_of_the_directory_for_telemetry_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with TemporaryDirectory(dir="/dev/shm") as login:
        (Path(login) / "weberlink").touch()
        monkeypatch.setenv("XDG_RUNTIME_DIR", login)
        assert "weberlink is a file" in run("loopback --duration 0").complaint(1)


@pytest.mark.parametrize("name", [name for name in FILES if name not in HARDWARE])
def test_simulate_completes_every_shipped_file(name: str, key: str) -> None:
    ended = run(f"simulate configs/{name} --duration 0.3 --json - --set", key)
    assert ended.status == 0, ended.errors
    summary = document(ended.output)
    assert (summary["outcome"], summary["faults"]) == ("completed", {"master": {}, "slave": {}})
    assert summary["ticks"]["slave"]["count"] >= 300


def test_a_trace_is_the_signal_to_the_last_digit(tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    assert run("simulate configs/scene-sphere.yaml --duration 1 --trace", path).status == 0
    recorder = TraceRecorder()
    simulate(load(CONFIGS / "scene-sphere.yaml"), 1.0, [recorder.add])
    read, made = read_trace(path), recorder.trace
    for name in ("time_s", "position_m", "force_n"):
        assert getattr(read, name).tolist() == getattr(made, name).tolist()
    assert np.abs(made.force_n).max() > 0.1


def test_figures_that_cannot_be_written_are_not_lost() -> None:
    ended = run(f"simulate {FIG6} --duration 0 --json", "/dev/full")  # which can be opened
    text, _, said = ended.errors.rstrip("\n").rpartition("\n")
    assert ended.status == 1
    assert "outcome" in json.loads(text)
    assert said.startswith("weberlink: /dev/full: cannot be written: ")
