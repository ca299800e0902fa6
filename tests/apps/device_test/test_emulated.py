"""`device test` of emulated hardware, through the drivers."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
import yaml

from tests.apps.device_test.people import Keyboard, complaint
from tests.master.devices.force_dimension.fake import Devices, FakeDevice
from tests.master.devices.touch.fake_hd import Board, library, plugged
from tests.system.processes import PATIENCE
from weberlink.apps.device_test import DeviceTestError, DeviceTestRequest, Dialog, run
from weberlink.apps.device_test.master import PUSH_N
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master import devices, emulators

HASTE = 20.0
"""How much faster than a person's the time of these tests is."""
STEP_M = 0.008


def soon(condition: Callable[[], bool]) -> None:
    """Wait for what comes within milliseconds, if the machine does not stall."""
    gives_up = monotonic() + PATIENCE
    while not condition():
        assert monotonic() < gives_up
        sleep(0.001)


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
                soon(lambda: self._handle.arrived)
                if is_open:  # who asks for the third time has had an answer to the second, which was asked after that
                    third = self._questions + 3
                    soon(lambda number=third: self._questions >= number)  # type: ignore[misc]

        return carry, ""

    def feeling(self, axis: str, keyboard: Keyboard) -> list[Any]:
        """Enter, and what there is to say of the push that came: again, if nothing came through."""

        def calm() -> None:
            soon(lambda: norm(self._emulator.force) == 0.0)
            self._felt.clear()

        def answer() -> str:
            index = "xyz".index(axis)
            strongest = max(self._felt or [ZERO], key=norm)
            if norm(strongest) < 0.7 * PUSH_N:
                keyboard.left[:0] = self.feeling(axis, keyboard)
                return "r"
            return "y" if strongest[index] > 0.9 * norm(strongest) else "n"

        return [(calm, ""), answer]

    def check(self, name: str, port: Path | str | None, axes: str, *overrides: str) -> tuple[str, str]:
        """The whole test by a person who tells the truth: what is on the screen, and the complaint if there is one."""
        screen, began = io.StringIO(), monotonic()
        keyboard = Keyboard(screen, "", "")
        for axis in axes:
            keyboard.left += [self.carried(0.0, 0.0, 0.0), self.carried(*(0.025 * (axis == each) for each in "xyz"))]
        keyboard.left += ["yes", self.carried(0.0, 0.0, 0.0, is_open=False)]
        for axis in axes:
            keyboard.left += self.feeling(axis, keyboard)
        keyboard.left += [""] * hasattr(devices.load(name), "examine")

        def clock() -> float:
            return began + HASTE * (monotonic() - began)

        dialog = Dialog(keyboard, screen, clock=clock, pause=self.pause, poll=0.02)
        try:
            where = [] if port is None else [f"port={port}"]
            run(DeviceTestRequest(name, None, [*where, *overrides]), dialog)
        except DeviceTestError as error:
            return screen.getvalue(), str(error)
        return screen.getvalue(), ""


class HeldHandle:
    """The handle of a device behind a library, in place of an emulator's."""

    def __init__(self, device: FakeDevice) -> None:
        self._device = device
        self.handle = self
        self.arrived = True

    @property
    def force(self) -> Vector:
        return self._device.wrench[0]

    @property
    def position(self) -> Vector:
        return self._device["x"], self._device["y"], self._device["z"]

    def carry(self, to: Vector) -> None:
        for axis, value in zip("xyz", to, strict=True):
            self._device[axis] = value
        sleep(0.01)  # the driver reads every 2 ms

    def receive(self, data: bytes, now: float) -> None: ...


class HeldStylus(HeldHandle):
    """The same of a Touch, whose library has x to the right, y up and z toward the operator, in mm."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self.handle = self
        self.arrived = True

    @property
    def force(self) -> Vector:
        right, up, near = self._board.force
        return near, right, up

    @property
    def position(self) -> Vector:
        right, up, near = self._board.centre
        return 1e-3 * near, 1e-3 * right, 1e-3 * up

    def carry(self, to: Vector) -> None:
        near, right, up = to
        self._board.centre[:] = 1e3 * right, 1e3 * up, 1e3 * near
        sleep(0.01)


class BehindLibrary(Emulated):
    """A device whose messages nobody sees."""

    def carried(self, *to: float, is_open: bool = True) -> tuple[Callable[[], None], str]:
        return super().carried(*to, is_open=False)


class Counted(Emulated):
    """A device behind a service: the messages of all its clients are its questions."""

    def __init__(self, service: Any) -> None:
        self._emulator = service
        self._handle = service.handle
        self._felt: list[Vector] = []

    @property
    def _questions(self) -> int:
        return int(self._emulator.messages)


@contextmanager
def emulated(name: str, folder: Path, **options: Any) -> Iterator[tuple[Emulated, Path]]:
    emulator = emulators.load(name)
    device = emulator(emulator.Options(**options))
    with PtyDevice(device, folder / name) as wire:
        yield Emulated(device), wire.path
        soon(lambda: norm(device.force) == 0.0)


def gives_force(screen: str, **options: Any) -> bool:
    """Whether a phantom with the printed fingerprint and these options has force."""
    (line,) = (line for line in screen.splitlines() if line.strip().startswith("signs_checked:"))
    driver: Any = devices.load("polhem_serial")
    options = {"model": "vintage_phantom", **yaml.safe_load(line), **options}
    return bool(driver(driver.Options(**options), 0.001).spec.force_feedback)


def test_emulated_phantom_passes_and_its_fingerprint_gives_force(tmp_path: Path) -> None:
    with emulated("polhem_serial", tmp_path) as (device, port):
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom")
    assert error == "", screen
    assert "The force is right.\n" in screen
    assert gives_force(screen)


def test_emulated_planar_device_passes_with_two_axes(tmp_path: Path) -> None:
    with emulated("haply_2diy", tmp_path) as (device, port):
        screen, error = device.check("haply_2diy", port, "xy")
    assert error == "", screen
    assert "The force is right.\n" in screen


@pytest.mark.parametrize("model", ["omega.3", "novint_falcon"])
def test_device_behind_library_passes_and_gets_force(model: str, tmp_path: Path) -> None:
    fake = Devices(tmp_path / "devices")
    device = BehindLibrary(HeldHandle(fake[0].plug({"omega.3": 33, "novint_falcon": 60}[model])))
    options = {"library": str(fake.library), "model": model}
    screen, error = device.check("force_dimension", None, "xyz", *(f"{key}={value}" for key, value in options.items()))
    assert error == "", screen
    assert "The force is right.\n" in screen
    (line,) = (line for line in screen.splitlines() if line.strip().startswith("signs_checked:"))
    driver: Any = devices.load("force_dimension")
    assert driver(driver.Options(**options, **yaml.safe_load(line)), 0.001).spec.force_feedback


def test_touch_passes_and_gets_force(tmp_path: Path) -> None:
    driver: Any = devices.load("touch")
    with plugged(tmp_path) as (board,):
        board.radius, path = 0.0, f"{library()}"
        screen, error = BehindLibrary(HeldStylus(board)).check("touch", None, "xyz", f"library={path}")
    assert error == "", screen
    assert "The force is right.\n" in screen
    (line,) = (line for line in screen.splitlines() if line.strip().startswith("signs_checked:"))
    assert driver(driver.Options(library=path, **yaml.safe_load(line)), 0.001).spec.force_feedback


def test_emulated_inverse3_passes_and_its_service_is_examined() -> None:
    emulator: Any = emulators.load("inverse3")
    service = emulator(emulator.Options(time_out_ms=7.0))
    with WebSocketDevice(service) as wire:
        screen, error = Counted(service).check("inverse3", wire.address, "xyz")
    assert error == "", screen
    assert "The force is right.\n" in screen
    assert "the service keeps a force for" in screen
    assert "  force_gate: 0.3\n" in screen


@pytest.mark.parametrize("wrong", ["encoder", "motor"])
def test_reversed_phantom_fails_and_passes_as_advised(wrong: str, tmp_path: Path) -> None:
    """An encoder is reversed without its motor, and a motor without its encoder."""
    with emulated("polhem_serial", tmp_path, **{f"{wrong}_signs": (-1, 1, 1)}) as (device, port):
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom")
        assert f"reverse y (the first of {wrong}_directions), and test it again" in error
        assert "signs_checked: " not in screen
    with emulated("polhem_serial", tmp_path, **{f"{wrong}_signs": (-1, 1, 1)}) as (device, port):
        advice = f"{wrong}_directions=[1, 1, -1]"
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom", advice)
    assert error == "", screen
    assert gives_force(screen, **{f"{wrong}_directions": (1, 1, -1)})
    assert not gives_force(screen)


def test_unplugged_phantom_ends_the_test_in_one_line(tmp_path: Path) -> None:
    emulator = emulators.load("polhem_serial")
    with PtyDevice(emulator(emulator.Options()), tmp_path / "port") as wire:

        def unplug() -> None:
            wire.unplug()
            sleep(0.5)

        said = complaint(DeviceTestRequest("polhem_serial", None, [f"port={wire.path}"]), "", (unplug, ""), "")
    assert said == f"polhem_serial: {wire.path}: unplugged"
