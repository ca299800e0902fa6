"""The `emulate` command: a device that is not there, on a port or node of its own, with faults on request.

What a device does is the business of the emulators; how it hangs on this host, of `hardware`.
"""

from weberlink.apps.emulate.session import names, run

__all__ = ["names", "run"]
