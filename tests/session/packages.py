"""Packages of others, as pip would leave them: modules and a .dist-info beside each other in a folder."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from weberlink.master.devices import DEVICES
from weberlink.slave.robots import ROBOTS


def install(folder: Path, name: str, modules: Mapping[str, str], entry_points: str) -> Path:
    """Put a distribution, with its modules by name, into a folder, which becomes one of `sys.path`."""
    for module, source in modules.items():
        (folder / f"{module}.py").write_text(source, encoding="utf-8")
    information = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (information / "entry_points.txt").write_text(entry_points, encoding="utf-8")
    return folder


def said(folder: Path, script: str, argument: str) -> Any:
    """What a script says as JSON, in a process that finds the packages of a folder."""
    ended = subprocess.run(
        [sys.executable, "-c", script, argument],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def add_drivers(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the packages of a folder for one test."""
    monkeypatch.syspath_prepend(str(folder))
    for table in (DEVICES, ROBOTS):
        monkeypatch.setattr(table, "_loaded", dict(table._loaded))
