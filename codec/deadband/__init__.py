"""Deadbands: the prediction error at which a sample is sent. docs/deadbands.md helps to choose one.

To add one for forces, write a file in this folder and a line here, or an entry point of the group
`weberlink.deadbands`.
"""

from typing import Any

from weberlink.codec.deadband.contract import Deadband, DeadbandSetup, Reference
from weberlink.codec.deadband.isotropic import ForceDeadband, PositionDeadband
from weberlink.registry import Registry, check_overrides


def _check(name: str, entry: Any) -> None:
    if not (isinstance(entry, type) and issubclass(entry, Deadband) and entry.name == name):
        raise ValueError(f"deadband {name!r}: its entry point must name a subclass of Deadband called {name!r}")
    check_overrides(f"deadband {name}", entry, Deadband, "configured", "bound", "error")


ISOTROPIC = "isotropic"
DEADBANDS: Registry[type[Deadband]] = Registry("deadband", {ISOTROPIC: ForceDeadband}, "weberlink.deadbands", _check)
"""The deadbands of a force, by name."""

__all__ = ["DEADBANDS", "ISOTROPIC", "Deadband", "DeadbandSetup", "ForceDeadband", "PositionDeadband", "Reference"]
