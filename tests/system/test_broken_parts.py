"""A part of another distribution that cannot be imported, or that raises in a run, is one line that names it.

The line is the same in every command, and the log of a session has the trace.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.apps.packages import add_drivers
from tests.program import PATIENT, Program, document
from tests.system.packages import install
from tests.system.systems import CONFIGS
from weberlink.apps.devices import survey
from weberlink.cli import app

DISTRIBUTION = "breaking-parts"
GROUPS = {
    "devices": ("loopback.yaml", "master.device.driver={}"),
    "robots": ("loopback.yaml", "slave.robot.driver={}"),
    "leaders": ("arms.yaml", "master.device.driver={}"),
    "followers": ("arms.yaml", "slave.robot.driver={}"),
    "predictors": ("loopback.yaml", "codec.force.predictor={}"),
    "deadbands": ("loopback.yaml", "codec.force.deadband={{shape: {}}}"),
    "integrators": ("scene-simulated-robot.yaml", "slave.robot.integrator={}"),
    "shapes": ("loopback.yaml", "slave.scene=[{{shape: {}}}]"),
}
"""By group of entry points: a shipped file, and the override by which it names a part."""
SCHEME = "control.scheme={}_control_schemes"
"""Likewise of control schemes, whose table is read when a process begins."""
MISTAKES = {
    "needy": ("import no_such_package_at_all", "ModuleNotFoundError: No module named 'no_such_package_at_all'"),
    "raising": ("raise RuntimeError('no\\ncalibration')", "RuntimeError: no calibration"),
    "unfinished": ("def (:", "SyntaxError: invalid syntax (unfinished.py, line 1)"),
    "empty": ("", "AttributeError: module 'empty' has no attribute 'Part'"),
}
"""By module: its source, and what its import raises."""
CLUMSY = '''
from pydantic import BaseModel

from weberlink.master.devices.operator import OperatorDevice
from weberlink.slave.robots.point import PointRobot


class Options(BaseModel):
    where: str = ""


class Clumsy:
    COMPUTED = True
    """Does what another part does, and raises in one of the methods, at the 300th call or at once."""

    Options = Options

    def __init__(self, options, *others):
        self.where, self.calls = options.where, 0
        self.meet("__init__")
        self.part = self.of(*others)
        self.spec = self.part.spec

    def meet(self, where):
        if where == self.where:
            self.calls += 1
            if self.calls == 300 or where in ("__init__", "open"):
                stumble({})

    def open(self, now):
        self.meet("open")
        self.part.open(now)

    def latest(self, now):
        self.meet("latest")
        return self.part.latest(now)

    def command(self, value, now):
        self.meet("command")
        self.part.command(value, now)

    def close(self):
        self.part.close()


class Hand(Clumsy):
    def of(self, period):
        return OperatorDevice(OperatorDevice.Options(), period)


class Tool(Clumsy):
    def of(self, scene, period):
        return PointRobot(PointRobot.Options(), scene, period)


def stumble(things):
    return things["there"]
'''
ENTRY_POINTS = {
    group: "\n".join(f"{name}_{group} = {name}:Part" for name in MISTAKES) for group in (*GROUPS, "control_schemes")
}
ENTRY_POINTS["devices"] += "\nhand = clumsy:Hand"
ENTRY_POINTS["robots"] += "\ntool = clumsy:Tool"
FAULTS = {
    "device": ("master.device", "hand", "device fault: hand of breaking-parts: KeyError: 'there' (clumsy.py:"),
    "robot": ("slave.robot", "tool", "robot fault: tool of breaking-parts: KeyError: 'there' (clumsy.py:"),
}
KEYED = ("--set", "link.security=session")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    text = "\n".join(f"[weberlink.{group}]\n{lines}" for group, lines in ENTRY_POINTS.items())
    sources = {name: source for name, (source, _) in MISTAKES.items()}
    install(tmp_path, DISTRIBUTION, sources | {"clumsy": CLUMSY}, text)
    add_drivers(tmp_path, monkeypatch)
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([*filter(None, paths), str(tmp_path)]))
    yield tmp_path


def line_of(command: str, file: str, *overrides: str, status: int = 2) -> str:
    """The one line of a command that fails and prints nothing else."""
    arguments = [part for each in overrides for part in ("--set", each)]
    result = CliRunner().invoke(app, [command, str(CONFIGS / file), *arguments])
    assert (result.exit_code, result.stdout) == (status, ""), result.output
    (line,) = result.stderr.splitlines()
    return line


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.parametrize("group", GROUPS)
def test_part_that_cannot_be_imported_is_one_line(group: str, name: str, folder: Path) -> None:
    file, override = GROUPS[group]
    line = line_of("check", file, override.format(f"{name}_{group}"))
    assert f"{name}_{group} of {DISTRIBUTION}" in line
    assert line.endswith(MISTAKES[name][1])


@pytest.mark.parametrize("name", ["needy"])
def test_control_scheme_that_cannot_be_imported_is_one_line(name: str, folder: Path) -> None:
    with Program("check", CONFIGS / "loopback.yaml", "--set", SCHEME.format(name)) as program:
        status, output, errors = program.finish()
    assert (status, output) == (2, "")
    (line,) = errors.splitlines()
    assert f"{name}_control_schemes of {DISTRIBUTION}" in line
    assert line.endswith(MISTAKES[name][1])


@pytest.mark.parametrize(("group", "side"), [("devices", "master"), ("robots", "slave")])
def test_every_command_has_the_same_line(group: str, side: str, folder: Path) -> None:
    file, override = GROUPS[group]
    overrides = (override.format(f"needy_{group}"), "link.security=session")
    told = {line_of(command, file, *overrides) for command in ("check", "simulate", "loopback", side)}
    assert len(told) == 1
    advice = next(each.advice[0] for each in survey().drivers if each.driver == f"needy_{group}")
    assert told.pop().endswith(advice)
    tested = CliRunner().invoke(app, ["device", "test", f"needy_{group}"])
    assert (tested.exit_code, tested.stderr) == (2, f"weberlink: {advice}\n")


@pytest.mark.parametrize("part", FAULTS)
def test_driver_that_cannot_be_built_is_one_line(part: str, folder: Path) -> None:
    where, name, text = FAULTS[part]
    for command in ("check", "simulate", "loopback"):
        line = line_of(
            command, "loopback.yaml", f"{where}={{driver: {name}, where: __init__}}", "link.security=session"
        )
        assert f"{where}: {text}" in line


@pytest.mark.parametrize("where", ["open", "latest", "command"])
@pytest.mark.parametrize("part", FAULTS)
def test_driver_that_raises_in_virtual_time_is_the_verdict(part: str, where: str, folder: Path) -> None:
    at, name, text = FAULTS[part]
    overrides = [*KEYED, "--set", f"{at}={{driver: {name}, where: {where}}}"]
    result = CliRunner().invoke(
        app, ["simulate", str(CONFIGS / "loopback.yaml"), "--duration", "2", "--json", "-", *overrides]
    )
    assert (result.exit_code, result.stderr) == (1, "")
    report = json.loads(result.stdout)
    assert [cause["name"] for cause in report["verdict"]["causes"] if cause["level"] == "failed"] == [part]
    assert report["outcome"].startswith(f"failed: {text}")
    if where != "open":
        assert 250 <= report["ticks"]["master"]["count"] <= 300, "the ticks before the fault count"


@pytest.mark.realtime
@pytest.mark.parametrize(("part", "where"), [("robot", "command")])
def test_driver_that_raises_in_a_session_is_the_verdict_and_its_trace_is_logged(
    part: str, where: str, folder: Path
) -> None:
    at, name, text = FAULTS[part]
    log = folder / "session.log"
    with Program(
        "loopback", *PATIENT, *KEYED, "--set", f"{at}={{driver: {name}, where: {where}}}", "--duration", 30,
        "--json", "-", "--log", log,
    ) as program:  # fmt: skip
        status, output, errors = program.finish()
    causes = document(output)["verdict"]["causes"]
    side = "master" if part == "device" else "slave"
    assert status == 1
    told = next(cause["text"] for cause in causes if cause["name"] == part)
    assert told.startswith(text)
    assert [line for line in errors.splitlines() if ": note: " not in line] == [f"weberlink {side}: {told}"]
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    traced = [line["entry"] for line in lines if line["event"] == "trace" and line["side"] == side]
    assert traced[0] == "Traceback (most recent call last):"
    assert any(entry.endswith('return things["there"]\n           ~~~~~~^^^^^^^^^') for entry in traced)
    assert traced[-1] == "KeyError: 'there'"


def test_log_has_the_trace_of_a_part_that_cannot_be_imported(folder: Path) -> None:
    log = folder / "session.log"
    for group, (file, override) in GROUPS.items():
        log.unlink(missing_ok=True)
        given = ["--set", override.format(f"needy_{group}"), "--log", str(log)]
        assert CliRunner().invoke(app, ["loopback", str(CONFIGS / file), *given]).exit_code == 2
        entries = [json.loads(line)["entry"] for line in log.read_text(encoding="utf-8").splitlines()]
        assert any("needy.py" in entry for entry in entries), group
        assert entries[-1] == "ModuleNotFoundError: No module named 'no_such_package_at_all'"
