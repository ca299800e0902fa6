"""What a session needs of its host and link, what is found there, and the report."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import partial
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import Any

from rich.console import Console
from rich.text import Text

from weberlink.config import MASTER, SIDES, SLAVE, System
from weberlink.config.model import LinkSettings, RealtimeSettings, split_address
from weberlink.protocol.aio.sockets import numeric

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
