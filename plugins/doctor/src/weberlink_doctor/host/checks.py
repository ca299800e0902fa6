"""The table of checks, which `kernel` and `network` fill."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from weberlink_doctor.host.machine import Machine
from weberlink_doctor.report import Finding, Needs

Judge = Callable[[Machine, Needs], Finding | Iterable[Finding] | None]


@dataclass(frozen=True, slots=True)
class Check:
    """One row of the table."""

    area: str
    name: str  # of the row; its findings have the same, or one of their own
    judge: Judge  # reads the machine and compares it with the needs, without changing anything
    fix: str | None = None  # of advice and problems for which `judge` names no other


CHECKS: list[Check] = []  # in the order of the report, filled by `check`


def check(area: str, name: str, fix: str | None = None) -> Callable[[Judge], Judge]:
    """Add a function to the table; arguments as of `Check`."""

    def add(judge: Judge) -> Judge:
        CHECKS.append(Check(area, name, judge, fix))
        return judge

    return add
