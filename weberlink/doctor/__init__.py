"""The `doctor` command: what this machine grants a real-time session, what stands in its way, and the line that helps.

One kind of check a module; each reads the machine through a `Host` and asks what is needed of a `Needs`. No check
changes anything, and none raises: what cannot be read is a finding too.
"""

from weberlink.doctor.examination import Examination, examine
from weberlink.doctor.finding import Finding, Grade
from weberlink.doctor.host import Host
from weberlink.doctor.needs import Needs

__all__ = ["Examination", "Finding", "Grade", "Host", "Needs", "examine"]
