"""The report on this host, and the advice on a file."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from weberlink.config import Configuration, ConfigurationError
from weberlink.protocol.keys import KeyFileError
from weberlink.session.advice import advise, dry_run
from weberlink_doctor.host import (
    kernel as _kernel,  # noqa: F401 - the first checks of the table
    network as _network,  # noqa: F401 - and the others
)
from weberlink_doctor.host.checks import CHECKS, Check
from weberlink_doctor.host.machine import Machine, Unreadable
from weberlink_doctor.report import DoctorReport, Finding, Grade, Needs, advice, ok, unknown


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
