"""What the tests of a driver need: contracts that every driver keeps, and the time of ticks; needs pytest.

A distribution with a driver inherits from the contract of its family, and gives it a bench:

    class TestAcme(HardwareRobotContract):
        FAULTS = ("unplug",)

        @pytest.fixture
        def bench(self, tmp_path): ...
"""

import pytest

pytest.register_assert_rewrite("weberlink.testing.robots")
