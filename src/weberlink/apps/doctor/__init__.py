"""The `doctor` command: check this machine for real-time problems and suggest fixes.

Each check reads the machine through a `Machine` and compares it with a `Needs`. No check changes anything.
"""

from weberlink.apps.doctor.findings import Finding, Grade
from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.report import DoctorReport, examine

__all__ = ["DoctorReport", "Finding", "Grade", "Machine", "Needs", "examine"]
