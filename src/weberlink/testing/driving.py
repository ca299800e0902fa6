"""A device that is driven at the tick in real time until something is so."""

from collections.abc import Callable
from time import monotonic
from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceFault
from weberlink.testing.time import TICK, until


def drive(device: Any, is_so: Callable[[], object], force: Vector = ZERO) -> None:
    """Read and command, tick by tick."""

    def tick() -> bool:
        now = monotonic()
        device.latest(now)
        device.command(force, now)
        return bool(is_so())

    until(tick, "what the device leads to", pause=TICK)


def fault_of(device: Any, force: Vector = (0.2, -0.4, 0.8)) -> str:
    """The fault that ends the session, in one line."""
    with pytest.raises(DeviceFault) as caught:
        drive(device, lambda: False, force)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def refusal(device: Any) -> str:
    """Why it cannot be opened, in one line."""
    with pytest.raises(DeviceFault) as caught:
        device.open(monotonic())
    assert "\n" not in str(caught.value)
    return str(caught.value)
