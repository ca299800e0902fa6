"""The `device emulate` command: emulates a device on a port or HID node, with faults on request."""

from weberlink.apps.emulate.run import names, run

__all__ = ["names", "run"]
