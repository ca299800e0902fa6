"""What a session needs of the machine, the table of checks that compare the two, and the report of their findings."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from functools import partial
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from weberlink.cli.doctor.machine import Machine, Unreadable
from weberlink.config import MASTER, SIDES, SLAVE, Configuration, ConfigurationError, System
from weberlink.config.model import LinkSettings, RealtimeSettings, split_address
from weberlink.protocol.aio.sockets import numeric
from weberlink.protocol.keys import KeyFileError
from weberlink.registry import Registry
from weberlink.session.advice import advise, dry_run

USUAL = System(link=LinkSettings(listen="127.0.0.1:0", slave="127.0.0.1:0", security="session"))
INDENT = 10


@dataclass(frozen=True, slots=True)
class Needs:
    """What the machine is compared with: the settings of a file, or the usual ones, for the sides that run here."""

    system: System = USUAL
    sides: Sequence[str] = SIDES
    file: Path | None = None

    @property
    def rate_hz(self) -> float:
        return self.system.rate_hz

    @property
    def period_us(self) -> float:
        return 1e6 / self.rate_hz

    @property
    def realtime(self) -> RealtimeSettings:
        return self.system.realtime

    @property
    def pinned(self) -> dict[str, int]:
        """The processor that each local side is pinned to; empty where the file pins none."""
        cpus = self.realtime.cpus
        return {} if cpus is None else {side: cpus[SIDES.index(side)] for side in self.sides}

    @property
    def listen(self) -> tuple[str, int] | None:
        """What the slave binds; None if it does not run here, or for any free port."""
        return self._address(SLAVE, self.system.link.listen)

    @property
    def slave(self) -> tuple[str, int] | None:
        """What the master calls; None if it does not run here."""
        return self._address(MASTER, self.system.link.slave)

    def _address(self, side: str, text: str) -> tuple[str, int] | None:
        address = split_address(text)
        return address if side in self.sides and address[1] else None

    @property
    def drivers(self) -> dict[str, str]:
        """Those that a file names, by side."""
        named = {MASTER: self.system.master.device.driver, SLAVE: self.system.slave.robot.driver}
        return {} if self.file is None else {side: named[side] for side in self.sides}

    @property
    def document(self) -> dict[str, Any]:
        """For JSON; of the key it says only whether one is used."""
        link = self.system.link
        return {
            "file": None if self.file is None else str(self.file),
            "sides": list(self.sides),
            "rate_hz": self.rate_hz,
            **self.realtime.model_dump(mode="json"),
            "listen": None if self.listen is None else numeric(self.listen),
            "slave": None if self.slave is None else numeric(self.slave),
            "encrypted": link.security != "none",
            "silence_s": 1e-3 * link.silence_ms,
            "drivers": self.drivers,
        }


class Grade(StrEnum):
    """How well the machine suits a session in one respect."""

    OK = "ok"
    ADVICE = "advice"  # a session runs, but the fix would make it more punctual or easier to operate
    PROBLEM = "problem"  # the session does not work as configured, or not in time
    UNKNOWN = "unknown"  # it could not be read; the text says why


COLOURS = {Grade.OK: "green", Grade.ADVICE: "yellow", Grade.PROBLEM: "bold red", Grade.UNKNOWN: "magenta"}


@dataclass(frozen=True, slots=True)
class Finding:
    """One result."""

    grade: Grade
    found: str
    fix: str | None = None  # a command, or a line of a configuration; None where nothing is to be done
    check: str = ""  # short name, the same on every machine
    area: str = ""  # heading of the report that it stands under


def ok(found: str, check: str = "") -> Finding:
    return Finding(Grade.OK, found, None, check)


advice, problem, unknown = (partial(Finding, grade) for grade in (Grade.ADVICE, Grade.PROBLEM, Grade.UNKNOWN))
"""Of what was found, the fix and the check."""


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
        for area, findings in groupby(self.findings, lambda each: each.area):
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


EXAMINATIONS: Registry[Callable[..., DoctorReport]] = Registry(
    "examination of a link", {}, "weberlink.link_examinations"
)
"""Of other distributions: functions of a file, overrides, a peer, and the time to measure [s]."""

# --- the table of checks

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


def examine(needs: Needs, machine: Machine | None = None, checks: Sequence[Check] = CHECKS) -> DoctorReport:
    """Run the checks on a machine; default: this one."""
    here = machine or Machine()
    return DoctorReport(needs, [each for row in checks for each in _findings(row, here, needs)])


def advised(configuration: Configuration) -> list[Finding]:
    """What `check` and every run say of a file, too."""
    try:
        lines = advise(dry_run(configuration))
    except (ConfigurationError, KeyFileError) as error:
        return [replace(unknown(f"advice on the file: {error}", check="advice"), area="file")]
    parts = (line.rpartition("; ") for line in lines)
    found = [advice(what or remedy, remedy, "advice") for what, _, remedy in parts]
    return [replace(each, area="file") for each in found or [ok("nothing in the file hinders what is felt", "advice")]]


def _findings(row: Check, machine: Machine, needs: Needs) -> Iterator[Finding]:
    """The findings of a row; an error becomes the last of them, so that it hides no other row."""
    try:
        found = row.judge(machine, needs)
        for each in [found] if isinstance(found, Finding) else found or ():
            fix = each.fix or (row.fix if each.grade in (Grade.ADVICE, Grade.PROBLEM) else None)
            yield replace(each, area=row.area, check=each.check or row.name, fix=fix)
    except Exception as error:  # a machine that no test covers must not stop the report
        kind = "" if isinstance(error, Unreadable) else f"{type(error).__name__}: "
        yield Finding(Grade.UNKNOWN, f"{row.name}: {kind}{' '.join(str(error).split())}", None, row.name, row.area)
