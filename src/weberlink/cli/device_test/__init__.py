"""The `device test` command: a person tests one device or robot before it is used in a session."""

from weberlink.cli.device_test.dialog import DeviceTestError, Dialog
from weberlink.cli.device_test.run import run

__all__ = ["DeviceTestError", "Dialog", "run"]
