"""The driver of docs/how-to/driver.md: its code is installed as another package, and run."""

import re
import sys
import tomllib
from collections.abc import Callable, Iterator
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.apps.packages import add_drivers
from tests.master.devices import test_contract as contract
from tests.master.devices.benches import TICK, Bench, real_time
from tests.system.packages import install
from tests.system.systems import CONFIGS
from weberlink.hardware.emulator import PtyDevice, WireFaults
from weberlink.master import devices

PAGE = (CONFIGS.parent / "docs" / "how-to" / "driver.md").read_text(encoding="utf-8")
SWING_M = 0.02
YIELDS_M_N = 0.0003


def block(language: str, containing: str = "") -> str:
    """The one block of the page in a language that contains something."""
    (found,) = (text for text in re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S) if containing in text)
    return str(found)


class Paddle:
    """An emulated paddle in a hand that swings to and fro and yields a little.

    Its motor stops by itself when it has not heard a line for 50 ms.
    """

    def __init__(self) -> None:
        self.faults = WireFaults()
        self._commanded_n = 0.0
        self._answers: list[bytes] = []
        self._heard_at = -inf
        self._text = b""
        self._origin: float | None = None

    def force_n(self, now: float) -> float:
        """That its motor makes [N]."""
        return self._commanded_n if now - self._heard_at <= 0.05 else 0.0

    def receive(self, data: bytes, now: float) -> None:
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            self._commanded_n, self._heard_at = 1e-3 * int(line), now
            self._answers.append(b"%d\n" % round(1e6 * self._position(now)))

    def advance(self, now: float) -> None:
        pass

    def replies(self, now: float) -> list[bytes]:
        answers, self._answers = self._answers, []
        return answers

    def next_timer(self) -> float | None:
        return None

    def _position(self, now: float) -> float:
        self._origin = self._origin or now
        phase = (now - self._origin) % 2.0
        return SWING_M * (1.0 - 2.0 * abs(phase - 1.0)) + YIELDS_M_N * self.force_n(now)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The package of the page as pip would leave it."""
    project = tomllib.loads(block("toml"))
    groups = project["project"]["entry-points"]
    entry_points = "\n".join(
        f"[{group}]\n" + "\n".join(f"{name} = {value}" for name, value in entries.items())
        for group, entries in groups.items()
    )
    return install(tmp_path, project["project"]["name"], {"paddle": block("python")}, entry_points)


@pytest.fixture
def driver(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    add_drivers(folder, monkeypatch)
    yield devices.load("paddle")
    sys.modules.pop("paddle", None)


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(Paddle(), tmp_path / "port") as wire:
        yield wire


@pytest.fixture
def bench(driver: Any, wire: PtyDevice) -> Iterator[Bench]:
    device = driver(driver.Options(port=str(wire.path)), TICK)
    emulator: Any = wire.emulator
    faults: dict[str, Callable[[], None]] = {
        "unplug": wire.unplug,
        "silent": lambda: setattr(emulator.faults, "silent", True),
        "late": lambda: setattr(emulator.faults, "late_s", 0.2),
        "garbled": lambda: setattr(emulator.faults, "garble", 1_000_000),
    }
    yield Bench(device, real_time(), lambda: abs(emulator.force_n(monotonic())), faults)
    device.close()


# --- the driver


def test_driver_fulfils_the_contract_of_devices(bench: Bench) -> None:
    contract.test_the_spec_is_there_before_opening("paddle", bench)
    contract.test_only_open_device_is_read_close_is_idempotent("paddle", bench)


@pytest.mark.parametrize(
    "check",
    [
        contract.test_readings_advance_without_jumps,
        contract.test_force_that_is_not_finite_raises,
        contract.test_motors_follow_commands_within_limit_until_close,
        contract.test_silent_loop_ends_the_force,
    ],
)
def test_open_driver_fulfils_the_contract(check: Callable[[Bench], None], bench: Bench) -> None:
    check(bench)


@pytest.mark.parametrize("fault", ["unplug", "silent", "late", "garbled"])
def test_fault_ends_the_session_without_force(fault: str, bench: Bench) -> None:
    contract.test_fault_ends_session_with_reason_without_force("paddle", fault, bench)
