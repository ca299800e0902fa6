"""A short soak with every fault once; and one that is ended early leaves nothing behind."""

import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import gettempdir

import pytest

from tests.soak.faults import FAULTS
from tests.soak.underlays import ALONE, UNDERLAYS
from tests.system.processes import PATIENCE, ROOT, until
from weberlink.telemetry.runtime_directory import directories

pytestmark = pytest.mark.realtime


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


def test_every_fault_once(tmp_path: Path) -> None:
    out, before = tmp_path / "soak.json", folders()
    with soak("--minutes", 0.5, "--seed", 5, "--json", out) as process:
        output, errors = process.communicate(timeout=3 * PATIENCE)
    told = json.loads(out.read_text(encoding="utf-8"))
    assert (process.returncode, errors, told["failures"]) == (0, "", []), output
    assert {name: kind["count"] for name, kind in told["kinds"].items()} == dict.fromkeys(FAULTS, 1)
    assert min(told["lives"].values()) >= 2
    assert told["checks"] > 0
    assert told["datagrams"] > 0
    relay = told["relay"]["forward"], told["relay"]["backward"]
    # Whether one is on its way to an address that is just left is chance: test_direction.py asks for "orphaned".
    for harm in ("lost", "corrupted", "duplicated", "reordered", "replayed", "released", "discarded"):
        assert sum(way[harm] for way in relay) > 0, harm
    assert told["environment"]["python"]
    assert left_by(process.pid) == []
    assert folders() <= before


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGKILL])
def test_it_leaves_nothing_behind_when_its_terminal_goes_away_or_it_is_killed(number: signal.Signals) -> None:
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
    assert ALONE.keys() == UNDERLAYS.keys()
    for name in FAULTS:
        assert any(name not in ALONE[under] for under in UNDERLAYS), name
    assert set().union(*ALONE.values()) <= set(FAULTS)
