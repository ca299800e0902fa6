"""What the contracts of all drivers share."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import pytest


class FaultContract:
    """A test with the argument `fault` runs once for each of `FAULTS`."""

    FAULTS: ClassVar[Sequence[str]]  # those of its bench that end a session

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        if "fault" in metafunc.fixturenames:
            metafunc.parametrize("fault", self.FAULTS)


def assert_is_read_while_open(driver: Any, command: Any, tick: Callable[[], float], fault: type[Exception]) -> None:
    """Only while it is open; it may be closed and commanded at any time, and a second session is like the first."""

    def is_not_open() -> None:
        driver.command(command, tick())
        with pytest.raises(fault, match=driver.spec.name):
            driver.latest(tick())

    driver.close()
    for _ in range(2):
        is_not_open()
        now = tick()
        driver.open(now)
        assert driver.latest(tick()).at >= now
        driver.close()
        driver.close()
    is_not_open()
