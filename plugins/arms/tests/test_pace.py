"""Whether a bus is fast enough: the best of many readings counts, so that a busy host is no slow adapter."""

import pytest

from weberlink.hardware.fault import HardwareFault
from weberlink_arms.servo.pace import TRIES, check_pace

RATE_HZ = 256.0
PERIOD_S = 1.0 / RATE_HZ
SLOW = 2.0 * PERIOD_S


class Bus:
    """Readings that take given times, the last one for ever."""

    def __init__(self, *takes: float) -> None:
        self.now, self.reads, self._takes = 100.0, 0, takes

    def read(self) -> None:
        self.now += self._takes[min(self.reads, len(self._takes) - 1)]
        self.reads += 1

    def check(self) -> None:
        check_pace(self.read, RATE_HZ, lambda: self.now, "/dev/bus", lambda: "lower its latency")


@pytest.mark.parametrize(("takes", "reads"), [((0.0,), 1), ((PERIOD_S,), 1), ((SLOW, SLOW, PERIOD_S), 3)])
def test_one_reading_within_the_period_is_enough(takes: tuple[float, ...], reads: int) -> None:
    bus = Bus(*takes)
    bus.check()
    assert bus.reads == reads


@pytest.mark.parametrize("takes", [(SLOW,), (SLOW, PERIOD_S + 2.0**-30), (SLOW,) * TRIES + (0.0,)])
def test_a_slow_bus_is_refused_with_its_best(takes: tuple[float, ...]) -> None:
    bus = Bus(*takes)
    with pytest.raises(HardwareFault, match=rf"^/dev/bus: .*{min(takes[:TRIES]) * 1e3:.1f} ms.*; lower its latency"):
        bus.check()
    assert bus.reads == TRIES
