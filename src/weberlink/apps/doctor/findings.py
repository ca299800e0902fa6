"""Results of the checks: a grade, what was found, and a command that fixes it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs


class Grade(StrEnum):
    """How well the machine suits a session in one respect."""

    OK = "ok"
    ADVICE = "advice"
    """A session runs, but the fix would make it more punctual or easier to operate."""
    PROBLEM = "problem"
    """The session does not work as configured, or not in time."""
    UNKNOWN = "unknown"
    """It could not be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One result.

    Args:
        check: short name, the same on every machine; empty for the name of the check function.
        grade: how good it is.
        found: what was found.
        fix: a command, or a line of a configuration; None where nothing is to be done.
    """

    check: str
    grade: Grade
    found: str
    fix: str | None = None


Check = Callable[[Machine, Needs], Finding | Iterable[Finding]]


def ok(found: str, check: str = "") -> Finding:
    return Finding(check, Grade.OK, found)


def advice(found: str, fix: str, check: str = "") -> Finding:
    return Finding(check, Grade.ADVICE, found, fix)


def problem(found: str, fix: str, check: str = "") -> Finding:
    return Finding(check, Grade.PROBLEM, found, fix)


def unknown(found: str, fix: str | None = None, check: str = "") -> Finding:
    return Finding(check, Grade.UNKNOWN, found, fix)
