"""Interpreter, event loop, extras and tools."""

import tomllib
from pathlib import Path

import pytest

from tests.apps.doctor.machine import look, machine, only
from weberlink.apps.doctor import Grade
from weberlink.apps.doctor.software import event_loop, extras, interpreter, judged_build, optional, tools

PYPROJECT = Path(__file__).parents[3] / "pyproject.toml"


@pytest.mark.parametrize(
    ("is_debug", "is_free_threaded", "is_dev_mode", "grade"),
    [
        (False, False, False, Grade.OK),
        (True, False, False, Grade.PROBLEM),
        (False, True, False, Grade.ADVICE),
        (False, False, True, Grade.ADVICE),
    ],
)
def test_builds_of_python(is_debug: bool, is_free_threaded: bool, is_dev_mode: bool, grade: Grade) -> None:
    found = judged_build("3.14.0", is_debug=is_debug, is_free_threaded=is_free_threaded, is_dev_mode=is_dev_mode)
    assert found.grade is grade
    assert (found.fix is None) == (grade is Grade.OK)


def test_this_interpreter_and_its_event_loop_are_named(tmp_path: Path) -> None:
    host = machine(tmp_path)
    assert "Python 3." in only(interpreter, host).found
    assert only(event_loop, host).grade is Grade.OK


def test_the_extras_are_those_of_the_project(tmp_path: Path) -> None:
    declared = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    known = optional()
    assert set(known) <= set(declared) - {"dev"}
    assert known["recording"] == ["mcap", "zstandard"]
    assert only(extras, machine(tmp_path)).grade is Grade.OK


def test_missing_tools_come_with_their_package(tmp_path: Path) -> None:
    assert only(tools, machine(tmp_path, which=lambda name: f"/usr/bin/{name}")).grade is Grade.OK
    found = look(tools, machine(tmp_path, which=lambda name: name if name == "sockperf" else None))[0]
    assert (found.grade, found.fix) == (Grade.ADVICE, "sudo apt install rt-tests")
