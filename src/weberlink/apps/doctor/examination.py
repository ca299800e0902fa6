"""All checks in the order of a report, and what came of them. A check that fails is a finding, never an error."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from weberlink.apps.doctor import clocks, drivers, firewall, kernel, key, memory, network, processors, rights, software
from weberlink.apps.doctor.finding import Check, Finding, Grade, unknown
from weberlink.apps.doctor.host import Host, Unreadable
from weberlink.apps.doctor.needs import Needs

CHECKS: Mapping[str, tuple[Check, ...]] = {
    "kernel": kernel.CHECKS,
    "clocks": clocks.CHECKS,
    "processors": processors.CHECKS,
    "rights": rights.CHECKS,
    "memory": memory.CHECKS,
    "network": (*network.CHECKS, *firewall.CHECKS),
    "key": key.CHECKS,
    "devices": drivers.CHECKS,
    "software": software.CHECKS,
}
"""By the heading of the report that they stand under."""

INDENT = 10
COLOURS = {Grade.OK: "green", Grade.ADVICE: "yellow", Grade.PROBLEM: "bold red", Grade.UNKNOWN: "magenta"}


@dataclass(frozen=True, slots=True)
class Examination:
    """What was asked for, and what was found of it, by heading."""

    needs: Needs
    findings: Mapping[str, tuple[Finding, ...]]

    def count(self, grade: Grade) -> int:
        return sum(each.grade is grade for found in self.findings.values() for each in found)

    @property
    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "needs": self.needs.document,
            "findings": [
                {"area": area, **asdict(each)} for area, findings in self.findings.items() for each in findings
            ],
            "counts": {grade.value: self.count(grade) for grade in Grade},
        }

    def show(self, console: Console) -> None:
        """A line of what was found and, below it, the line that helps, which is not broken: it is to be copied."""
        for area, findings in self.findings.items():
            console.print(Text(area, style="bold"))
            for each in findings:
                first, *others = wrap(
                    each.found, console.width - INDENT, break_long_words=False, break_on_hyphens=False
                )
                head = Text.assemble("  ", (f"{each.grade.value:{INDENT - 2}}", COLOURS[each.grade]), first)
                console.print(head, *(Text(" " * INDENT + line) for line in others), sep="\n", soft_wrap=True)
                if each.fix is not None:
                    console.print(Text.assemble(" " * INDENT, ("-> ", "dim"), each.fix), soft_wrap=True)
        problems, tips, dark = (self.count(grade) for grade in (Grade.PROBLEM, Grade.ADVICE, Grade.UNKNOWN))
        summary = f"{problems} problem{'' if problems == 1 else 's'}, {tips} advice, {dark} unknown"
        console.print(Text(summary, style="bold red" if problems else "bold green"))


def examine(needs: Needs, host: Host | None = None, checks: Mapping[str, tuple[Check, ...]] = CHECKS) -> Examination:
    """Look at everything."""
    here = host or Host()
    return Examination(
        needs,
        {
            area: tuple(each for check in group for each in guarded(check, here, needs))
            for area, group in checks.items()
        },
    )


def guarded(check: Check, host: Host, needs: Needs) -> Iterator[Finding]:
    """The findings of a check; what stops it is the last of them."""
    name = check.__name__.replace("_", " ")
    try:
        yield from check(host, needs)
    except Unreadable as error:
        yield unknown(name, f"{name}: {error}")
    except Exception as error:  # a machine that no test knows must not hide the other findings
        yield unknown(name, f"{name}: {type(error).__name__}: {' '.join(str(error).split())}")
