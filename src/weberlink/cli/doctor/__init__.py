"""The `doctor` command: check this machine for real-time problems and suggest fixes.

Each row of `checks.CHECKS` reads the machine through a `Machine` and compares it with a `Needs`. None changes anything.
"""

from weberlink.cli.doctor.checks import CHECKS, Check, examine
from weberlink.cli.doctor.machine import Machine
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import DoctorReport, Finding, Grade

__all__ = ["CHECKS", "Check", "DoctorReport", "Finding", "Grade", "Machine", "Needs", "examine"]
