"""A short soak with every fault once; and one that is ended early leaves nothing behind."""

import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import pytest

from tests.program import ROOT
from tests.soak.conditions import CONDITIONS, EXCLUDED
from tests.soak.faults import FAULTS
from tests.wait import PATIENCE, until
from weberlink.telemetry.runtime_directory import directories

pytestmark = pytest.mark.realtime(alone=True)


def soak(*arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.soak", *map(str, arguments)],
        cwd=ROOT,
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def left_by(pid: int) -> list[str]:
    """Rings in shared memory that bear its number, and its daemons."""
    rings = [str(path) for folder in directories() for path in folder.glob(f"weberlink-{pid}-*")]
    return rings + [str(path) for path in running(f'"parent": {pid}')]


def running(mark: str) -> list[Path]:
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            command = path.read_bytes().decode(errors="replace")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if mark in command:
            found.append(path)
    return found


def is_unused(folder: Path) -> bool:
    return not running(str(folder))


def folders() -> set[Path]:
    return set(Path(gettempdir()).glob("weberlink-soak-*"))


def soaked(folder: Path, *arguments: object) -> dict[str, Any]:
    """The report of a short soak, which must end in order and leave nothing behind."""
    out, before = folder / "soak.json", folders()
    with soak("--minutes", 0.01, "--seed", 5, "--json", out, *arguments) as process:
        output, errors = process.communicate(timeout=3 * PATIENCE)
    told: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    assert (process.returncode, errors, told["failures"]) == (0, "", []), output
    assert left_by(process.pid) == []
    assert folders() <= before
    return told


@pytest.mark.hunt
def test_a_cut_and_a_flood_break_no_law(tmp_path: Path) -> None:
    told = soaked(tmp_path, "--faults", "cut_to_slave", "flood")
    assert {kind["count"] for kind in told["kinds"].values()} == {1}
    assert told["environment"]["python"]


@pytest.mark.hunt
def test_every_fault_once(tmp_path: Path) -> None:
    told = soaked(tmp_path)
    assert {name: kind["count"] for name, kind in told["kinds"].items()} == dict.fromkeys(FAULTS, 1)
    relay = told["relay"]["forward"], told["relay"]["backward"]
    for harm in ("lost", "corrupted", "duplicated", "reordered", "replayed", "released", "discarded"):
        assert sum(way.get(harm, 0) for way in relay) > 0, harm


@pytest.mark.parametrize("number", [signal.SIGHUP, pytest.param(signal.SIGKILL, marks=pytest.mark.hunt)])
def test_ended_soak_leaves_nothing_behind(number: signal.Signals) -> None:
    before = folders()
    with soak("--minutes", 60) as process:
        until(lambda: len([path for path in left_by(process.pid) if path.endswith(".ring")]) == 2, "both rings")
        os.kill(process.pid, number)
        output, _ = process.communicate(timeout=PATIENCE)
    if number == signal.SIGHUP:
        assert process.returncode == 1
        assert "VIOLATED ended early by SIGHUP" in output
    until(lambda: running(f'"parent": {process.pid}') == [], "the daemons to end")
    until(lambda: left_by(process.pid) == [], "the rings to go")
    for folder in folders() - before:  # only who is killed has no time to tidy up
        assert number == signal.SIGKILL
        until(partial(is_unused, folder), "all others to end")
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()


def test_what_can_come_together_is_told_in_full() -> None:
    assert EXCLUDED.keys() == CONDITIONS.keys()
    for name in FAULTS:
        assert any(name not in EXCLUDED[under] for under in CONDITIONS), name
    assert set().union(*EXCLUDED.values()) <= set(FAULTS)
