"""The `device emulate` command: emulates a device on a port or HID node, with faults on request."""

from weberlink.cli.emulate.run import run

__all__ = ["run"]
