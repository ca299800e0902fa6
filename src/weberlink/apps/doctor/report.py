"""Runs all checks and shows their findings as text or JSON."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from weberlink.apps.doctor import host, kernel, network, processors, rights, software
from weberlink.apps.doctor.findings import Check, Finding, Grade, unknown
from weberlink.apps.doctor.machine import Machine, Unreadable
from weberlink.apps.doctor.needs import Needs

CHECKS: Mapping[str, tuple[Check, ...]] = {
    "kernel": (kernel.preemption, kernel.timers, kernel.throttling),
    "clocks": (kernel.clock_source, kernel.wall_clock),
    "processors": (
        processors.processors,
        processors.isolation,
        processors.governor,
        processors.idle_states,
        processors.cpu_quota,
    ),
    "rights": (rights.rights,),
    "host": (host.host,),
    "memory": (rights.swap, rights.huge_pages, rights.shared_memory),
    "network": (network.receive_buffer, network.port, network.slave_address, network.firewall),
    "key": (network.key_file,),
    "devices": (software.devices,),
    "software": (software.python, software.compiled, software.uvloop, software.extras),
}
"""Checks by the heading of the report that they stand under."""

INDENT = 10
COLOURS = {Grade.OK: "green", Grade.ADVICE: "yellow", Grade.PROBLEM: "bold red", Grade.UNKNOWN: "magenta"}


@dataclass(frozen=True, slots=True)
class DoctorReport:
    """Findings by heading, the needs that they were compared with, and further figures for JSON."""

    needs: Needs
    findings: Mapping[str, tuple[Finding, ...]]
    measured: Mapping[str, Any] = field(default_factory=dict)

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
            **self.measured,
        }

    def show(self, console: Console) -> None:
        """Print each finding, and below it its fix, unwrapped so that it can be copied."""
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


def examine(
    needs: Needs, machine: Machine | None = None, checks: Mapping[str, tuple[Check, ...]] = CHECKS
) -> DoctorReport:
    """Run the checks."""
    here = machine or Machine()
    return DoctorReport(
        needs,
        {area: tuple(each for check in group for each in run(check, here, needs)) for area, group in checks.items()},
    )


def run(check: Check, machine: Machine, needs: Needs) -> Iterator[Finding]:
    """The findings of a check; an error becomes the last finding, so that it hides no other check."""
    name = check.__name__.replace("_", " ")
    try:
        found = check(machine, needs)
        for each in [found] if isinstance(found, Finding) else found:
            yield replace(each, check=each.check or name)
    except Unreadable as error:
        yield unknown(f"{name}: {error}", check=name)
    except Exception as error:  # a machine that no test covers must not stop the report
        yield unknown(f"{name}: {type(error).__name__}: {' '.join(str(error).split())}", check=name)
