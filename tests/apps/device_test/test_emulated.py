"""`device test` of emulated hardware, through the drivers, by a person who tells the truth."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
import yaml

from tests.apps.device_test.people import Keyboard
from tests.wait import until
from weberlink.apps.device_test import DeviceTestError, Dialog, run
from weberlink.apps.device_test.master import PUSH_N
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale
from weberlink.hardware.emulator import PtyDevice
from weberlink.master import devices, emulators

HASTE = 20.0
"""How much faster than a person's the time of these tests is."""
STEP_M = 0.008


class Emulated:
    """An emulated device in a hand, which carries the handle about and feels what pushes it."""

    def __init__(self, emulator: Any) -> None:
        self._emulator = emulator
        self._handle = emulator.handle if hasattr(emulator, "handle") else emulator._body.handle
        self._felt: list[Vector] = []
        self._questions = 0
        receive = emulator.receive

        def listen(data: bytes, now: float) -> None:
            self._questions += 1
            receive(data, now)

        emulator.receive = listen

    def pause(self, seconds: float) -> None:
        sleep(seconds / HASTE)
        self._felt.append(self._emulator.force)

    def carried(self, *to: float, is_open: bool = True) -> tuple[Callable[[], None], str]:
        """In steps, each of which the driver has seen: a machine that stalls makes no jump."""
        x, y, z = to

        def carry() -> None:
            start = self._handle.position
            steps = max(1, ceil(distance(start, (x, y, z)) / STEP_M))
            for step in range(1, steps + 1):
                share = step / steps
                self._handle.carry(add(scale(start, 1.0 - share), scale((x, y, z), share)))
                until(lambda: self._handle.arrived, "the handle to arrive")
                if is_open:  # who asks for the third time has had an answer to the second, which was asked after that
                    third = self._questions + 3
                    until(lambda number=third: self._questions >= number, "answers")  # type: ignore[misc]

        return carry, ""

    def feeling(self, axis: str, keyboard: Keyboard) -> list[Any]:
        """Enter, and what there is to say of the push that came: again, if nothing came through."""

        def calm() -> None:
            until(lambda: norm(self._emulator.force) == 0.0, "no force")
            self._felt.clear()

        def answer() -> str:
            strongest = max(self._felt or [ZERO], key=norm)
            if norm(strongest) < 0.7 * PUSH_N:
                keyboard.left[:0] = self.feeling(axis, keyboard)
                return "r"
            return "y" if strongest["xyz".index(axis)] > 0.9 * norm(strongest) else "n"

        return [(calm, ""), answer]

    def check(self, name: str, axes: str, *overrides: str) -> tuple[str, str]:
        """The whole test: what is on the screen, and the complaint if there is one."""
        screen, began = io.StringIO(), monotonic()
        keyboard = Keyboard(screen, "", "")
        for axis in axes:
            keyboard.left += [self.carried(0.0, 0.0, 0.0), self.carried(*(0.025 * (axis == each) for each in "xyz"))]
        keyboard.left += ["yes", self.carried(0.0, 0.0, 0.0, is_open=False)]
        for axis in axes:
            keyboard.left += self.feeling(axis, keyboard)
        clock = lambda: began + HASTE * (monotonic() - began)  # noqa: E731
        try:
            run(name, Dialog(keyboard, screen, clock=clock, pause=self.pause, poll=0.02), None, overrides)
        except DeviceTestError as error:
            return screen.getvalue(), str(error)
        return screen.getvalue(), ""


@contextmanager
def emulated(name: str, folder: Path, **options: Any) -> Iterator[tuple[Emulated, str]]:
    """A device behind a serial port, and what its driver is told of it."""
    emulator = emulators.load(name)
    device = emulator(emulator.Options(**options))
    with PtyDevice(device, folder / name) as wire:
        yield Emulated(device), f"port={wire.path}"
        until(lambda: norm(device.force) == 0.0, "no force")


def gives_force(name: str, screen: str, *overrides: str) -> bool:
    """Whether a driver with these options and the printed fingerprint has force."""
    (line,) = (line for line in screen.splitlines() if line.strip().startswith("signs_checked:"))
    driver: Any = devices.load(name)
    options = {key: yaml.safe_load(value) for key, _, value in (each.partition("=") for each in overrides)}
    return bool(driver(driver.Options(**options, **yaml.safe_load(line)), 0.001).spec.force_feedback)


@pytest.mark.parametrize("wrong", ["encoder", "motor"])
def test_reversed_phantom_fails_and_passes_as_advised(wrong: str, tmp_path: Path) -> None:
    """An encoder is reversed without its motor, and a motor without its encoder."""
    model, advice = "model=vintage_phantom", f"{wrong}_directions=[1, 1, -1]"
    with emulated("polhem_serial", tmp_path, **{f"{wrong}_signs": (-1, 1, 1)}) as (device, port):
        screen, error = device.check("polhem_serial", "xyz", port, model)
        assert f"reverse y (the first of {wrong}_directions), and test it again" in error
        assert "signs_checked: " not in screen
        screen, error = device.check("polhem_serial", "xyz", port, model, advice)
        assert error == "", screen
        assert gives_force("polhem_serial", screen, port, model, advice)
        assert not gives_force("polhem_serial", screen, port, model)
