"""The `device test` command: a person and one device, before anything else is connected to it.

Owns the order of the questions and what counts as right. Knows the contract of drivers and no driver.
"""

from weberlink.apps.device_test.dialog import Dialog
from weberlink.apps.device_test.outcome import DeviceTestError
from weberlink.apps.device_test.session import Request, run

__all__ = ["DeviceTestError", "Dialog", "Request", "run"]
