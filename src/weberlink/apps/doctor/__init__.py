"""The `doctor` command: what this machine grants a real-time session, what stands in its way, and the line that helps.

One kind of check a module; each reads the machine through a `Host` and asks what is needed of a `Needs`. No check
changes anything, and none raises: what cannot be read is a finding too.
"""

from weberlink.apps.doctor.examination import Examination, examine
from weberlink.apps.doctor.finding import Finding, Grade
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs

__all__ = ["Examination", "Finding", "Grade", "Host", "Needs", "examine"]
