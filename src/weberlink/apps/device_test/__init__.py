"""The `device test` command: a person tests one device or robot before it is used in a session."""

from weberlink.apps.device_test.dialog import DeviceTestError, Dialog
from weberlink.apps.device_test.run import DeviceTestRequest, run

__all__ = ["DeviceTestError", "DeviceTestRequest", "Dialog", "run"]
