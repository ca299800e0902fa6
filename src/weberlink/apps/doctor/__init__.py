"""The `doctor` command: check this machine for real-time problems and suggest fixes.

Each row of `checks.CHECKS` reads the machine through a `Machine` and compares it with a `Needs`. None changes anything.
"""

from weberlink.apps.doctor.checks import CHECKS, Check, examine
from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.report import DoctorReport, Finding, Grade

__all__ = ["CHECKS", "Check", "DoctorReport", "Finding", "Grade", "Machine", "Needs", "examine"]
