"""SpaceMouse: published reports, frame, silence, light, and the emulator that says the same."""

from math import radians

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.hardware.discovery import PluggedDevice
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.rate_control import Deflection
from weberlink.master.devices.spacemouse.device import PuckExchange, SpaceMouseDevice, SpaceMouseOptions
from weberlink.master.emulators.spacemouse import SpaceMouseEmulator, SpaceMouseEmulatorOptions


class Port:
    """Reports that a test has put there."""

    def __init__(self, light: bool = True) -> None:
        self.waiting: list[bytes] = []
        self.written: list[tuple[int, bytes]] = []
        self.has_light = light
        self.closed = 0

    def write(self, report: bytes, number: int = 0) -> None:
        if not self.has_light:
            raise HardwareFault("refused")
        self.written.append((number, report))

    def read_all(self, until: float) -> list[bytes]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def close(self) -> None:
        self.closed += 1


def exchange_on(port: Port, clock: list[float], **options: object) -> PuckExchange:
    plugged = [PluggedDevice("hid:1")]
    exchange = PuckExchange(
        SpaceMouseOptions(**options),  # type: ignore[arg-type]
        lambda: plugged,
        lambda path: port,
        lambda: clock[0],
    )
    assert exchange.open() == Deflection()
    return exchange


def test_directions_are_those_of_the_operator() -> None:
    port, clock = Port(), [0.0]
    exchange = exchange_on(port, clock, spin_deg_s=90.0)
    port.waiting = [bytes.fromhex("01 5e01 0000 0000"), bytes.fromhex("02 0000 0000 5e01")]
    assert exchange.exchange(ZERO) == Deflection((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)), "right, and turned about down"
    port.waiting = [bytes.fromhex("01 0000 5e01 0000")]
    assert exchange.exchange(ZERO).move == (1.0, 0.0, 0.0), "toward the operator"
    port.waiting = [bytes.fromhex("01 0000 0000 5e01")]
    assert exchange.exchange(ZERO).move == (0.0, 0.0, -1.0), "down"


def test_options_reverse_and_leave_out() -> None:
    port, clock = Port(), [0.0]
    exchange = exchange_on(port, clock, directions=(-1, 1, 1), full_counts=700)
    port.waiting = [bytes.fromhex("01 0000 5e01 0000"), bytes.fromhex("02 0000 0000 5e01")]
    assert exchange.exchange(ZERO) == Deflection((-0.5, 0.0, 0.0))


def test_silence_releases_the_puck_but_not_the_buttons() -> None:
    port, clock = Port(), [0.0]
    exchange = exchange_on(port, clock, release_s=0.5)
    port.waiting = [bytes.fromhex("01 5e01 0000 0000"), b"\x03\x01"]
    assert exchange.exchange(ZERO) == Deflection((0.0, 1.0, 0.0), ZERO, 1)
    clock[0] = 0.4
    assert exchange.exchange(ZERO).move == (0.0, 1.0, 0.0)
    clock[0] = 0.6
    assert exchange.exchange(ZERO) == Deflection(buttons=1)


@pytest.mark.parametrize("light", [True, False])
def test_light_is_on_while_open_and_optional(light: bool) -> None:
    port, clock = Port(light), [0.0]
    exchange = exchange_on(port, clock)
    exchange.close()
    exchange.close()
    assert port.written == ([(4, b"\x01"), (4, b"\x00")] if light else [])
    assert port.closed == 1


@pytest.mark.parametrize("product", ["spacenavigator", "wireless"])
def test_driver_understands_the_emulator(product: str) -> None:
    emulator = SpaceMouseEmulator(SpaceMouseEmulatorOptions(product=product, turn=(0.0, 0.0, 0.5)))  # type: ignore[arg-type]
    port, clock = Port(), [0.0]
    exchange = exchange_on(port, clock, spin_deg_s=90.0)
    for word, value in (("x", 40.0), ("y", -100.0), ("z", 20.0), ("buttons", 2.0)):
        emulator.inject(word, value)
    emulator.advance(0.1)
    port.waiting = emulator.replies(0.1)
    heard = exchange.exchange(ZERO)
    assert heard.move == pytest.approx((0.4, -1.0, 0.2), abs=2e-3)
    assert heard.turn == pytest.approx((0.0, 0.0, 0.5), abs=2e-3)
    assert heard.buttons == 2


def test_emulator_is_silent_once_released() -> None:
    emulator = SpaceMouseEmulator()
    emulator.advance(0.0)
    assert emulator.replies(0.0)
    emulator.inject("release")
    emulator.advance(0.01)
    last = emulator.replies(0.01)
    assert [report[1:] for report in last] == [bytes(6), bytes(6)]
    emulator.advance(0.02)
    assert emulator.replies(0.02) == []


def test_orientation_only_with_a_rate_of_turning() -> None:
    assert not SpaceMouseDevice(SpaceMouseOptions(), 0.001).spec.orientation
    turning = SpaceMouseDevice(SpaceMouseOptions(spin_deg_s=90.0), 0.001)
    assert turning.spec.orientation
    assert radians(90.0) == turning._spin
