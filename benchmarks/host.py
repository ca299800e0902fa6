"""Facts of this host that influence lateness, as `weberlink doctor` finds them, with its load and its steal time."""

import os
from collections.abc import Mapping
from typing import Any

from weberlink_doctor.host.checks import CHECKS
from weberlink_doctor.host.examination import examine
from weberlink_doctor.host.machine import Machine
from weberlink_doctor.report import Needs
from weberlink_figures.host import Steal

NAMES = {"preemption", "throttling", "clock source", "isolation", "governor", "idle states"}
"""Checks of doctor that a figure is printed with."""


def host(needs: Needs, machine: Machine | None = None) -> dict[str, Any]:
    """Findings by the name of their check, and the load averages."""
    report = examine(needs, machine or Machine(), [row for row in CHECKS if row.name in NAMES])
    return {"findings": {each.check: each.found for each in report.findings}, "load_average": list(os.getloadavg())}


def in_words(facts: Mapping[str, Any]) -> str:
    """The facts as one line."""
    load = "/".join(f"{value:.2f}" for value in facts["load_average"])
    return "; ".join([*facts["findings"].values(), f"load before {load}"])


def steal() -> Steal | None:
    """Time of all processors that the host of a virtual machine took; None where the kernel does not count it."""
    return Steal.read(range(os.cpu_count() or 1))


def share_between(before: Steal | None, after: Steal | None) -> float | None:
    """Share of the processors' time that the host took between two readings; None if unknown."""
    return None if before is None or after is None else after.share_since(before)


def during(share: float | None) -> str:
    """What disturbed a run, as a few words."""
    taken = "unknown" if share is None else f"{100 * share:.2f} %"
    return f"steal during the run {taken}; load after {os.getloadavg()[0]:.2f}"
