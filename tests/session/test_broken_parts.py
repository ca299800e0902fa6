"""Parts of other distributions that cannot be imported, or raise in a run.

Each is one line that names it, the same in every command.
"""

import os
from pathlib import Path

import pytest

from tests.program import PATIENT, Program, document, weberlink
from tests.session.packages import add_drivers, install
from tests.session.systems import ARMS, CONFIGS, HAS_ARMS

DISTRIBUTION = "breaking-parts"
GROUPS = {
    "devices": ("loopback.yaml", "master.device.driver={}"),
    "robots": ("loopback.yaml", "slave.robot.driver={}"),
    "leaders": (ARMS, "master.device.driver={}"),
    **({"followers": (ARMS, "slave.robot.driver={}")} if HAS_ARMS else {}),
    "predictors": ("loopback.yaml", "codec.force.predictor={}"),
    "deadbands": ("loopback.yaml", "codec.force.deadband={{shape: {}}}"),
    "integrators": ("scene-simulated-robot.yaml", "slave.robot.integrator={}"),
    "shapes": ("loopback.yaml", "slave.scene=[{{shape: {}}}]"),
}
"""By group of entry points: a shipped file, and the override by which it names a part."""
MISTAKES = {
    "needy": ("import no_such_package_at_all", "ModuleNotFoundError: No module named 'no_such_package_at_all'"),
    "raising": ("raise RuntimeError('no\\ncalibration')", "RuntimeError: no calibration"),
    "empty": ("", "AttributeError: module 'empty' has no attribute 'Part'"),
}
"""By module: its source, and what its import raises."""
CLUMSY = """
from weberlink.master.devices.operator import OperatorDevice
from weberlink.slave.robots.computed import PointRobot


def stumble(things):
    return things["there"]


def clumsy(base):
    class Clumsy(base):
        COMPUTED = True

        class Options(base.Options):
            where: str = ""

        def __init__(self, options, *others):
            self.where, self.calls = options.where, 0
            self.meet("__init__")
            super().__init__(options, *others)

        def meet(self, where):
            if where == self.where:
                self.calls += 1
                if self.calls == 300 or where in ("__init__", "open"):
                    stumble({})

    for name in ("open", "latest", "command"):

        def method(self, *arguments, name=name):
            self.meet(name)
            return getattr(base, name)(self, *arguments)

        setattr(Clumsy, name, method)
    return Clumsy


Hand, Tool = clumsy(OperatorDevice), clumsy(PointRobot)
"""
"""Drivers that raise in one of their methods, at its 300th call or at once."""
ENTRY_POINTS = {group: "\n".join(f"{name}_{group} = {name}:Part" for name in MISTAKES) for group in GROUPS}
ENTRY_POINTS["devices"] += "\nhand = clumsy:Hand"
ENTRY_POINTS["robots"] += "\ntool = clumsy:Tool"
FAULTS = {
    "device": ("master.device", "hand", "device fault: hand of breaking-parts: KeyError: 'there' (clumsy.py:"),
    "robot": ("slave.robot", "tool", "robot fault: tool of breaking-parts: KeyError: 'there' (clumsy.py:"),
}
KEYED = "link.security=session"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    text = "\n".join(f"[weberlink.{group}]\n{lines}" for group, lines in ENTRY_POINTS.items())
    sources = {name: source for name, (source, _) in MISTAKES.items()}
    install(tmp_path, DISTRIBUTION, sources | {"clumsy": CLUMSY}, text)
    add_drivers(tmp_path, monkeypatch)
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([*filter(None, paths), str(tmp_path)]))
    return tmp_path


def sets(*overrides: str) -> list[str]:
    return [part for each in overrides for part in ("--set", each)]


def line_of(command: str, file: str | Path, *overrides: str) -> str:
    """The one line of a command that fails and prints nothing else."""
    status, output, errors = weberlink(command, CONFIGS / file, *sets(*overrides))
    assert (status, output) == (2, ""), errors
    (line,) = errors.splitlines()
    return line


@pytest.mark.parametrize("group", GROUPS)
def test_part_that_cannot_be_imported_is_one_line(group: str) -> None:
    file, override = GROUPS[group]
    for name, (_, error) in MISTAKES.items():
        line = line_of("check", file, override.format(f"{name}_{group}"))
        assert f"{name}_{group} of {DISTRIBUTION}" in line and line.endswith(error)


@pytest.mark.parametrize("where", ["__init__", "open", "latest", "command"])
@pytest.mark.parametrize("part", FAULTS)
def test_driver_that_raises_in_virtual_time_is_the_verdict(part: str, where: str) -> None:
    at, name, text = FAULTS[part]
    override = f"{at}={{driver: {name}, where: {where}}}"
    if where == "__init__":
        assert f"{at}: {text}" in line_of("simulate", "loopback.yaml", override, KEYED)
        return
    arguments = ("--duration", "0.6", "--json", "-", *sets(override, KEYED))
    status, output, errors = weberlink("simulate", CONFIGS / "loopback.yaml", *arguments)
    assert (status, errors) == (1, "")
    report = document(output)
    assert [cause["name"] for cause in report["verdict"]["causes"] if cause["level"] == "failed"] == [part]
    assert report["outcome"].startswith(f"failed: {text}")
    if where != "open":
        assert 250 <= report["ticks"]["master"]["count"] <= 300, "the ticks before the fault count"


@pytest.mark.realtime
def test_driver_that_raises_in_a_session_is_the_verdict() -> None:
    at, name, text = FAULTS["robot"]
    overrides = sets(f"{at}={{driver: {name}, where: command}}", KEYED)
    with Program("loopback", *PATIENT, *overrides, "--json", "-") as program:
        status, output, errors = program.finish()
    assert status == 1
    told = next(cause["text"] for cause in document(output)["verdict"]["causes"] if cause["name"] == "robot")
    assert told.startswith(text)
    assert [line for line in errors.splitlines() if ": note: " not in line] == [f"weberlink slave: {told}"]
