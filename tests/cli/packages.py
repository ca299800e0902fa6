"""Makes drivers of other packages visible to this process, which has read the installed ones before."""

from pathlib import Path

import pytest

from weberlink.master.devices import DEVICES
from weberlink.slave.robots import ROBOTS


def add_drivers(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the packages of a folder for one test."""
    monkeypatch.syspath_prepend(str(folder))
    for table in (DEVICES, ROBOTS):
        monkeypatch.setattr(table, "_loaded", dict(table._loaded))
