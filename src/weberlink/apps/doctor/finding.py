"""What a check says: one thing found, how good that is, and what to do about it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs


class Grade(StrEnum):
    """How good something is for a session."""

    OK = "ok"
    ADVICE = "advice"
    """A session runs; it would be better, or easier to operate, otherwise."""
    PROBLEM = "problem"
    """What was asked for does not work, or not in time."""
    UNKNOWN = "unknown"
    """It could not be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of what was found, and one of what to do.

    Args:
        check: a short name, the same on every machine.
        grade: how good it is.
        found: what was found.
        fix: a command, or a line of a file; None where nothing is to be done.
    """

    check: str
    grade: Grade
    found: str
    fix: str | None = None


Check = Callable[[Host, Needs], Iterator[Finding]]
"""Looks at one kind of thing."""


def ok(check: str, found: str) -> Finding:
    return Finding(check, Grade.OK, found)


def advice(check: str, found: str, fix: str) -> Finding:
    return Finding(check, Grade.ADVICE, found, fix)


def problem(check: str, found: str, fix: str) -> Finding:
    return Finding(check, Grade.PROBLEM, found, fix)


def unknown(check: str, why: str, fix: str | None = None) -> Finding:
    return Finding(check, Grade.UNKNOWN, why, fix)
