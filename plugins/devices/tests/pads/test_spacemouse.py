"""SpaceMouse: published reports, frame, silence, light, and the emulator that says the same."""

from typing import Any

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.hardware.discovery import PluggedDevice
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.rate_control import Deflection
from weberlink_devices.spacemouse.device import PuckExchange, SpaceMouseDevice, SpaceMouseOptions
from weberlink_devices.spacemouse.emulator import SpaceMouseEmulator, SpaceMouseEmulatorOptions


class Port:
    """Reports that a test has put there, and its clock."""

    def __init__(self) -> None:
        self.now = 0.0
        self.waiting: list[bytes] = []
        self.done: list[object] = []

    def write(self, report: bytes, number: int = 0) -> None:
        self.done.append((number, report))
        raise HardwareFault("refused")  # some have no light

    def read_all(self, until: float) -> list[bytes]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def close(self) -> None:
        self.done.append("closed")

    def opened(self, **options: Any) -> PuckExchange:
        there = [PluggedDevice("hid:1")]
        exchange = PuckExchange(SpaceMouseOptions(**options), lambda: there, lambda path: self, lambda: self.now)
        assert exchange.open() == Deflection()
        return exchange


RIGHT, NEAR, DOWN = "01 5e01 0000 0000", "01 0000 5e01 0000", "01 0000 0000 5e01"
TURNED = "02 0000 0000 5e01"


@pytest.mark.parametrize(
    ("options", "reports", "seen"),
    [
        ({"spin_deg_s": 90.0}, (RIGHT, TURNED), Deflection((0.0, 1.0, 0.0), (0.0, 0.0, -1.0))),
        ({}, (NEAR,), Deflection((1.0, 0.0, 0.0))),
        ({}, (DOWN,), Deflection((0.0, 0.0, -1.0))),
        ({"directions": (-1, 1, 1), "full_counts": 700}, (NEAR, TURNED), Deflection((-0.5, 0.0, 0.0))),
    ],
)
def test_directions_are_those_of_the_operator(options: Any, reports: tuple[str, ...], seen: Deflection) -> None:
    port = Port()
    exchange = port.opened(**options)
    port.waiting = list(map(bytes.fromhex, reports))
    assert exchange.exchange(ZERO) == seen
    assert SpaceMouseDevice(SpaceMouseOptions(**options), 0.001).spec.orientation == ("spin_deg_s" in options)


def test_silence_releases_the_puck_but_not_the_buttons() -> None:
    port = Port()
    exchange = port.opened(release_s=0.5)
    port.waiting = [bytes.fromhex(RIGHT), b"\x03\x01"]
    assert exchange.exchange(ZERO) == Deflection((0.0, 1.0, 0.0), ZERO, 1)
    port.now = 0.4
    assert exchange.exchange(ZERO).move == (0.0, 1.0, 0.0)
    port.now = 0.6
    assert exchange.exchange(ZERO) == Deflection(buttons=1)
    exchange.close()
    exchange.close()
    assert port.done == [(4, b"\x01"), (4, b"\x00"), "closed"], "its light"


@pytest.mark.parametrize("product", ["spacenavigator", "wireless"])
def test_driver_understands_the_emulator(product: Any) -> None:
    emulator = SpaceMouseEmulator(SpaceMouseEmulatorOptions(product=product, turn=(0.0, 0.0, 0.5)))
    port = Port()
    exchange = port.opened(spin_deg_s=90.0)
    for word, value in (("x", 40.0), ("y", -100.0), ("z", 20.0), ("buttons", 2.0)):
        emulator.inject(word, value)
    emulator.advance(0.1)
    port.waiting = emulator.replies(0.1)
    heard = exchange.exchange(ZERO)
    assert heard.move == pytest.approx((0.4, -1.0, 0.2), abs=2e-3)
    assert heard.turn == pytest.approx((0.0, 0.0, 0.5), abs=2e-3)
    assert heard.buttons == 2
    emulator.inject("release")
    emulator.advance(0.2)
    port.waiting = emulator.replies(0.2)
    assert exchange.exchange(ZERO).move == ZERO
