"""Emulated HID devices for the real hidapi, by umockdev: no kernel module, no privilege, for chosen processes alone.

umockdev redirects what a process sees of /sys and /dev by a library loaded before all others. `service` runs in the
system's Python, which has the bindings, and keeps /sys; the nodes in /dev are pseudo terminals of ours, served like
those of serial devices. A process started with `Testbed.environment` finds the devices there; no other does.
"""

from weberlink.hardware.umockdev.description import HidIdentity
from weberlink.hardware.umockdev.node import HidNode
from weberlink.hardware.umockdev.testbed import Testbed, missing

__all__ = ["HidIdentity", "HidNode", "Testbed", "missing"]
