"""What the tests of a driver need: contracts that every driver keeps, wires, and the time of ticks.

Contracts need pytest; `weberlink device emulate` uses `serving` without. A distribution with a driver
inherits from the contract of its family, and gives it a bench:

    class TestAcme(ForceDeviceContract):
        FAULTS = ("unplug", "silent", "late", "garbled")

        def make_bench(self, folder, /, **options):
            return on_a_pty("acme", folder, **options)
"""

import sys
from pkgutil import iter_modules

if "pytest" in sys.modules:
    import pytest

    pytest.register_assert_rewrite(*(f"{__name__}.{module.name}" for module in iter_modules(__path__)))
