"""Findings on a machine or a link, and the report that shows them as text or JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from itertools import groupby
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from weberlink.cli.doctor.needs import Needs


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
        grade: how good it is.
        found: what was found.
        fix: a command, or a line of a configuration; None where nothing is to be done.
        check: short name, the same on every machine.
        area: heading of the report that it stands under.
    """

    grade: Grade
    found: str
    fix: str | None = None
    check: str = ""
    area: str = ""


def ok(found: str, check: str = "") -> Finding:
    return Finding(Grade.OK, found, None, check)


def advice(found: str, fix: str | None = None, check: str = "") -> Finding:
    return Finding(Grade.ADVICE, found, fix, check)


def problem(found: str, fix: str | None = None, check: str = "") -> Finding:
    return Finding(Grade.PROBLEM, found, fix, check)


def unknown(found: str, fix: str | None = None, check: str = "") -> Finding:
    return Finding(Grade.UNKNOWN, found, fix, check)


INDENT = 10
COLOURS = {Grade.OK: "green", Grade.ADVICE: "yellow", Grade.PROBLEM: "bold red", Grade.UNKNOWN: "magenta"}


@dataclass(frozen=True, slots=True)
class DoctorReport:
    """Findings in the order of their areas, the needs that they were compared with, and further figures for JSON."""

    needs: Needs
    findings: Sequence[Finding]
    measured: Mapping[str, Any] = field(default_factory=dict)

    def count(self, grade: Grade) -> int:
        return sum(each.grade is grade for each in self.findings)

    @property
    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "needs": self.needs.document,
            "findings": [asdict(each) for each in self.findings],
            "counts": {grade.value: self.count(grade) for grade in Grade},
            **self.measured,
        }

    def show(self, console: Console) -> None:
        """Print each finding, and below it its fix, unwrapped so that it can be copied."""
        width = console.width - INDENT
        for area, findings in groupby(self.findings, lambda each: each.area):
            console.print(Text(area, style="bold"))
            for each in findings:
                first, *others = wrap(each.found, width, break_long_words=False, break_on_hyphens=False)
                head = Text.assemble("  ", (f"{each.grade.value:{INDENT - 2}}", COLOURS[each.grade]), first)
                console.print(head, *(Text(" " * INDENT + line) for line in others), sep="\n", soft_wrap=True)
                if each.fix is not None:
                    console.print(Text.assemble(" " * INDENT, ("-> ", "dim"), each.fix), soft_wrap=True)
        problems, tips, dark = (self.count(grade) for grade in (Grade.PROBLEM, Grade.ADVICE, Grade.UNKNOWN))
        summary = f"{problems} problem{'' if problems == 1 else 's'}, {tips} advice, {dark} unknown"
        console.print(Text(summary, style="bold red" if problems else "bold green"))
