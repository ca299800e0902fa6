"""`weberlink device test`: a person at a keyboard, a hand on the handle, and what must never be left switched on."""

import io
import os
import pty
import re
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import ceil
from pathlib import Path
from time import monotonic, sleep
from typing import Any, ClassVar

import pytest
import yaml
from pydantic import BaseModel, ConfigDict
from typer.testing import CliRunner

from tests.system.processes import PATIENCE
from tests.system.systems import CONFIGS
from weberlink.apps.device_test import DeviceTestError, Dialog, Request, run
from weberlink.apps.device_test.dialog import Left
from weberlink.apps.device_test.force_check import GIVES_WAY_M, PUSH_N
from weberlink.apps.device_test.gauge import Gauge
from weberlink.apps.device_test.master import try_master
from weberlink.apps.device_test.outcome import uninterrupted
from weberlink.apps.device_test.robot import WAY_M, RobotView, try_robot
from weberlink.apps.device_test.sense import FRAME, LEAST_M, Sense, sense
from weberlink.cli import app
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale
from weberlink.hardware.discovery import PluggedDevice
from weberlink.hardware.emulator import PtyDevice
from weberlink.master import devices, emulators
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec
from weberlink.slave import emulators as robot_emulators
from weberlink.slave import robots
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.system.configuration import ConfigurationError

WIDTH = 80
EDGE = 0.1
BOX = ((-EDGE, -EDGE, -EDGE), (EDGE, EDGE, EDGE))


class Clock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now = 100.0
        self.on_pause: Callable[[float], None] = lambda now: None

    def pause(self, seconds: float) -> None:
        self.now += seconds
        self.on_pause(self.now)


class Keyboard(io.StringIO):
    """Types these lines, each after the hand did what it does before that Enter; then the input ends.

    A line may be a function, for an answer that depends on what was felt.
    """

    def __init__(self, screen: io.StringIO, *lines: str | tuple[Callable[[], None], str] | Callable[[], str]) -> None:
        super().__init__()
        self._screen = screen
        self._lines = list(lines)

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        if not self._lines:
            return ""
        line = self._lines.pop(0)
        if isinstance(line, tuple):
            line[0]()
            line = line[1]
        elif callable(line):
            line = line()
        self._screen.write(f"{line}\n")  # as a terminal shows it
        return f"{line}\n"

    def then(self, *lines: Any) -> None:
        self._lines += lines

    def next(self, *lines: Any) -> None:
        self._lines[:0] = lines

    @property
    def left(self) -> int:
        """Lines that nobody asked for."""
        return len(self._lines)


def sitting(clock: Clock, screen: io.StringIO, *lines: Any, yes: bool = False) -> tuple[Dialog, Keyboard]:
    """A person who types this, and looks at the device a hundred times a second: a thousand takes tests longer."""
    keyboard = Keyboard(screen, *lines)
    return Dialog(keyboard, screen, yes=yes, clock=lambda: clock.now, pause=clock.pause, poll=0.01), keyboard


class HandleOptions(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    signs_checked: str | None = None


class Handle:
    """A haptic device whose handle a test moves: `turn` is what is wrong with it, `log` what was done to it.

    It gives force only with the right `signs_checked`, as the drivers of hardware do.
    """

    Options = HandleOptions
    SIGN_OPTIONS: ClassVar[dict[str, str]] = {"x": "the second of directions"}
    FORCE_OPTIONS: ClassVar[dict[str, str]] = {"y": "the first of motor_directions"}
    hand: ClassVar[Vector] = ZERO
    turn: ClassVar[Callable[[Vector], Vector]]
    log: ClassVar[list[tuple[str, Any]]]
    fails_at: ClassVar[float | None]
    buttons = 2

    @classmethod
    def reset(cls) -> None:
        cls.hand, cls.turn, cls.log, cls.fails_at = ZERO, staticmethod(lambda hand: hand), [], None

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return []

    @classmethod
    def fingerprint(cls, options: HandleOptions) -> str:
        return "a1b2c3d4"

    def __init__(self, options: HandleOptions, tick_period: float) -> None:
        self._armed = options.signs_checked == "a1b2c3d4"
        self._open = False
        self.spec = DeviceSpec(
            "handle", "xyz", 3.0 if self._armed else 0.0, 1000.0, BOX, 1000.0, self._armed,
            buttons=self.buttons, orientation=True, note="hold it at home when it is opened",
        )  # fmt: skip

    round_trip_s = 0.00025

    def open(self, now: float) -> None:
        self._open = True
        self.log.append(("open", self._armed))

    def latest(self, now: float) -> DeviceReading:
        if not self._open:
            raise DeviceFault("handle: not open")
        if self.fails_at is not None and now >= self.fails_at:
            raise DeviceFault("handle: unplugged")
        turned = type(self).turn(self.hand)
        return DeviceReading(now - 0.0004, turned, orientation=(1.0, 0.0, 0.0, 0.0), buttons=0b10)

    def command(self, force: Vector, now: float) -> None:
        if self._open:
            self.log.append(("force", force))

    def close(self) -> None:
        if self._open:
            self.log.append(("close", None))
        self._open = False


def build(options: BaseModel, driver: Any = Handle) -> Any:
    return driver(options, 0.001)


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Handle.reset()
    Arm.reset()


def moved(x: float, y: float, z: float) -> Callable[[], None]:
    """The hand goes there [m] before Enter is pressed."""

    def move() -> None:
        Handle.hand = (x, y, z)

    return move


CENTRE = (moved(0.0, 0.0, 0.0), "")
TO = {"x": (moved(0.05, 0.004, 0.0), ""), "y": (moved(0.0, 0.05, -0.01), ""), "z": (moved(0.01, 0.0, 0.05), "")}
SIGNS = (CENTRE, TO["x"], CENTRE, TO["y"], CENTRE, TO["z"])
"""The hand goes to the middle, along an axis, and back, three times."""
OPEN = ("", "")
"""Enter to open, Enter to go on."""
PUSHES = ("yes", "", "", "y", "", "y", "", "y")
"""Agree, open, and three times Enter and the answer."""


def at_the_bench(
    *lines: Any, driver: Any = Handle, clock: Clock | None = None, yes: bool = False
) -> tuple[str, DeviceTestError | None]:
    """What is on the screen of a person who types this, and the complaint at the end."""
    screen = io.StringIO()
    dialog, keyboard = sitting(clock or Clock(), screen, *lines, yes=yes)
    error = None
    try:
        try_master(driver, driver.Options(), lambda options: build(options, driver), dialog)
    except DeviceTestError as caught:
        error = caught
        assert "\n" not in str(error)
    assert keyboard.left == 0, "nobody asked for the rest"
    return screen.getvalue(), error


def forces() -> list[Vector]:
    return [what for kind, what in Handle.log if kind == "force"]


def assert_safe() -> None:
    """Whatever was opened was given zero force last, and closed."""
    kinds = [kind for kind, _ in Handle.log]
    assert kinds.count("open") == kinds.count("close") > 0
    for index, kind in enumerate(kinds):
        if kind == "close":
            assert Handle.log[index - 1] == ("force", ZERO)


# --- the whole of it


def test_a_good_device_from_the_first_reading_to_the_last_push() -> None:
    screen, error = at_the_bench(*OPEN, *SIGNS, *PUSHES)
    assert error is None
    assert screen.endswith("The force is right.\nPut this line under master.device:\n  signs_checked: a1b2c3d4\n")
    assert screen.count(": right\n") == 3
    assert "Note: hold it at home when it is opened" in screen
    assert "100/s" in screen
    assert "trip 0.25 ms" in screen
    assert max(map(len, screen.splitlines())) <= WIDTH
    assert_safe()


def test_before_the_yes_nothing_is_opened_with_force() -> None:
    screen, error = at_the_bench(*OPEN, *SIGNS, "y")  # not the word
    assert error is None
    assert "No force, then." in screen
    assert "signs_checked: " not in screen
    assert [armed for kind, armed in Handle.log if kind == "open"] == [False]
    assert set(forces()) == {ZERO}


def test_the_force_is_gentle_rises_and_falls_smoothly_and_leads_along_each_axis() -> None:
    at_the_bench(*OPEN, *SIGNS, *PUSHES)
    pushes = forces()
    assert max(map(norm, pushes)) == pytest.approx(PUSH_N, rel=1e-3)
    for axis in range(3):
        along = [force[axis] for force in pushes]
        assert max(along) == pytest.approx(PUSH_N, rel=1e-3)
        assert min(along) >= 0.0
        assert all(sum(component != 0.0 for component in force) <= 1 for force in pushes)
        assert max(abs(b - a) for a, b in pairwise(along)) < 0.02


def test_a_push_is_felt_again_on_request_and_a_wrong_answer_is_asked_again() -> None:
    screen, error = at_the_bench(*OPEN, *SIGNS, "yes", "", "", "r", "", "maybe", "y", "", "y", "", "y")
    assert error is None
    assert screen.count("Did it push toward you?") == 3
    assert "Please type one of y, n, r, and Enter." in screen


@pytest.mark.parametrize("wrong", "xyz")
def test_a_force_that_is_felt_elsewhere_fails_without_a_licence(wrong: str) -> None:
    answers = [each for axis in "xyz" for each in ("", "n" if axis == wrong else "y")]
    screen, error = at_the_bench(*OPEN, *SIGNS, "yes", "", *answers)
    assert f"its force is not felt along {wrong} as it should be: leave signs_checked out" in str(error)
    advice = Handle.FORCE_OPTIONS.get(wrong, "the direction of its motor")
    assert f"turn round {wrong} ({advice}), and test it again" in str(error)
    assert "signs_checked" not in screen
    assert_safe()


def test_the_yes_may_be_given_on_the_command_line() -> None:
    screen, error = at_the_bench(*OPEN, *SIGNS, *PUSHES[1:], yes=True)
    assert error is None
    assert "Type yes to feel it: yes (--yes)\n" in screen


def test_a_handle_that_gives_way_ends_the_push_at_once() -> None:
    clock = Clock()

    def yields(now: float) -> None:
        if any(force != ZERO for force in forces()):
            Handle.hand = add(Handle.hand, (0.0005, 0.0, 0.0))

    clock.on_pause = yields
    screen, _ = at_the_bench(*OPEN, *SIGNS, "yes", "", "", "y", CENTRE, "y", CENTRE, "y", clock=clock)
    assert f"The handle gave way by {GIVES_WAY_M * 1e3:.0f} mm" in screen
    assert len([force for force in forces() if force[0] > 0.0]) <= GIVES_WAY_M / 0.0005 + 2
    assert_safe()


def test_a_device_that_moves_by_itself_has_no_handle_to_check() -> None:
    screen = io.StringIO()
    dialog, _ = sitting(Clock(), screen, "", "yes", "", "y", "", "y", "", "y")
    run(Request("operator"), dialog)
    assert "no sign to check" in screen.getvalue()
    assert screen.getvalue().endswith("The force is right.\n")


# --- signs


@pytest.mark.parametrize(
    ("turn", "complaint"),
    [
        (lambda p: (-p[0], p[1], p[2]), "turn round x (the second of directions), and test it again"),
        (lambda p: (p[0], -p[1], -p[2]), "turn round y (its direction), z (its direction), and test it again"),
        (lambda p: (p[1], p[0], p[2]), "axes are interchanged (x comes out as y, y comes out as x)"),
        (lambda p: (-p[2], p[1], p[0]), "axes are interchanged (x comes out as z, z comes out as x)"),
    ],
    ids=["one reversed", "two reversed", "two exchanged", "exchanged and reversed"],
)
def test_a_wrong_direction_is_named_and_ends_before_any_force(turn: Callable[[Vector], Vector], complaint: str) -> None:
    Handle.turn = staticmethod(turn)
    screen, error = at_the_bench(*OPEN, *SIGNS)
    assert complaint in str(error)
    assert "WRONG" in screen
    assert "signs_checked" not in screen
    assert set(forces()) == {ZERO}
    assert_safe()


def test_a_motion_that_says_nothing_is_asked_for_again() -> None:
    small, askew = (moved(0.01, 0.0, 0.0), ""), (moved(0.04, 0.04, 0.0), "")
    screen, error = at_the_bench(*OPEN, CENTRE, small, CENTRE, askew, *SIGNS, *PUSHES)
    assert error is None
    assert "The position changed by 10 mm, which is too little: move it by about 5 cm." in screen
    assert "(+40, +40, +0) mm, along no one axis: move it straight toward you." in screen
    assert "signs_checked: a1b2c3d4" in screen


def test_a_position_that_never_follows_one_axis_is_another_fault() -> None:
    askew = (moved(0.04, 0.04, 0.0), "")
    _, error = at_the_bench(*OPEN, *((CENTRE, askew) * 3))
    assert "no motion along x could be told" in str(error)
    assert_safe()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("way", [-0.05, 0.05])
def test_the_sense_of_a_motion_is_its_greatest_component(axis: int, way: float) -> None:
    components = [0.2 * way] * 3
    components[axis] = way
    found = sense("x", (components[0], components[1], components[2]), FRAME)
    assert found == Sense("x", "xyz"[axis], way)
    assert found.right == (axis == 0 and way > 0.0)


def test_a_motion_below_the_threshold_says_nothing() -> None:
    assert isinstance(sense("z", (0.0, 0.0, LEAST_M * 0.99), FRAME), str)
    assert isinstance(sense("z", (0.0, 0.0, LEAST_M * 1.01), FRAME), Sense)


def test_a_driver_may_have_axes_that_lead_elsewhere() -> None:
    class Sideways(Handle):
        FRAME: ClassVar[dict[str, str]] = {"x": "to the right", "y": "away from you"}

    screen, error = at_the_bench(*OPEN, *SIGNS, *PUSHES, driver=Sideways)
    assert error is None
    assert "Move it away from you by about 5 cm" in screen
    assert "Did it push to the right?" in screen


def test_only_the_axes_that_a_device_has_are_asked_for() -> None:
    class Flat(Handle):
        def __init__(self, options: HandleOptions, tick_period: float) -> None:
            super().__init__(options, tick_period)
            self.spec = DeviceSpec("flat", "xy", 3.0, 1000.0, BOX, 1000.0, self._armed)

    screen, error = at_the_bench(*OPEN, *SIGNS[:4], "yes", "", "", "y", "", "y", driver=Flat)
    assert error is None
    assert "up" not in screen


def test_digits_alone_are_printed_so_that_a_file_takes_them_for_text() -> None:
    class Digits(Handle):
        @classmethod
        def fingerprint(cls, options: HandleOptions) -> str:
            return "12345678"

        def __init__(self, options: HandleOptions, tick_period: float) -> None:
            super().__init__(HandleOptions(signs_checked="a1b2c3d4" if options.signs_checked else None), tick_period)

    screen, _ = at_the_bench(*OPEN, *SIGNS, *PUSHES, driver=Digits)
    (line,) = (line for line in screen.splitlines() if "signs_checked" in line)
    assert yaml.safe_load(line) == {"signs_checked": "12345678"}


def test_without_force_for_another_reason_no_line_is_promised() -> None:
    class Weak(Handle):
        def __init__(self, options: HandleOptions, tick_period: float) -> None:
            super().__init__(HandleOptions(), tick_period)

    screen, error = at_the_bench(*OPEN, *SIGNS, driver=Weak)
    assert error is None
    assert "signs_checked" not in screen
    assert "There is no force to feel with these options" in screen


def test_a_check_of_an_earlier_day_does_not_give_force_before_this_one() -> None:
    dialog, _ = sitting(Clock(), io.StringIO(), *OPEN, *SIGNS, "no")
    try_master(Handle, HandleOptions(signs_checked="a1b2c3d4"), build, dialog)
    assert [armed for kind, armed in Handle.log if kind == "open"] == [False]


# --- every way out leaves the force at zero


ALL = (*OPEN, *SIGNS, *PUSHES)


@pytest.mark.parametrize("lines", range(1, len(ALL)))
def test_the_end_of_input_at_any_question_leaves_nothing_switched_on(lines: int) -> None:
    with pytest.raises(Left):
        at_the_bench(*ALL[:lines])
    assert_safe()


@pytest.mark.parametrize("after_s", [0.5, 2.2, 8.1, 8.6, 9.4, 10.2])
def test_ctrl_c_at_any_time_leaves_nothing_switched_on(after_s: float) -> None:
    clock = Clock()

    def interrupt(now: float) -> None:
        if now > 100.0 + after_s:
            raise KeyboardInterrupt

    clock.on_pause = interrupt
    with pytest.raises(KeyboardInterrupt):
        at_the_bench(*ALL, clock=clock)
    assert_safe()


@pytest.mark.parametrize("after_s", [0.5, 2.2, 8.6, 10.2])
def test_a_fault_at_any_time_leaves_nothing_switched_on(after_s: float) -> None:
    Handle.fails_at = 100.0 + after_s
    with pytest.raises(DeviceFault, match="handle: unplugged"):
        at_the_bench(*ALL)
    assert_safe()


def test_ctrl_c_while_a_device_is_made_safe_waits() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        os.kill(os.getpid(), signal.SIGINT)
        done.append("the rest")
    assert done == ["the rest"]


def test_threads_that_are_never_interrupted_need_no_protection() -> None:
    done: list[str] = []

    def safely() -> None:
        with uninterrupted():
            done.append("there")

    thread = threading.Thread(target=safely)
    thread.start()
    thread.join()
    assert done == ["there"]


# --- emulated hardware, through the drivers


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
                keyboard.next(*self.feeling(axis, keyboard))
                return "r"
            return "y" if strongest[index] > 0.9 * norm(strongest) else "n"

        return [(calm, ""), answer]

    def check(self, name: str, port: Path, axes: str, *overrides: str) -> tuple[str, str]:
        """The whole test by a person who tells the truth: what is on the screen, and the complaint if there is one."""
        screen, began = io.StringIO(), monotonic()
        keyboard = Keyboard(screen, *OPEN)
        for axis in axes:
            keyboard.then(self.carried(0.0, 0.0, 0.0), self.carried(*(0.025 * (axis == each) for each in "xyz")))
        keyboard.then("yes", self.carried(0.0, 0.0, 0.0, is_open=False))
        for axis in axes:
            keyboard.then(*self.feeling(axis, keyboard))

        def clock() -> float:
            return began + HASTE * (monotonic() - began)

        dialog = Dialog(keyboard, screen, clock=clock, pause=self.pause, poll=0.02)
        try:
            run(Request(name, None, [f"port={port}", *overrides]), dialog)
        except DeviceTestError as error:
            return screen.getvalue(), str(error)
        return screen.getvalue(), ""


@contextmanager
def emulated(name: str, folder: Path, **options: Any) -> Iterator[tuple[Emulated, Path]]:
    emulator = emulators.load(name)
    device = emulator(emulator.Options(**options))
    with PtyDevice(device, folder / name) as wire:
        yield Emulated(device), wire.path
        soon(lambda: norm(device.force) == 0.0)


def test_an_emulated_phantom_passes_and_its_line_gives_force(tmp_path: Path) -> None:
    with emulated("polhem_serial", tmp_path) as (device, port):
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom")
    assert error == "", screen
    assert "The force is right.\n" in screen
    (line,) = (line for line in screen.splitlines() if "signs_checked" in line and ": " in line)
    driver: Any = devices.load("polhem_serial")
    options = driver.Options(model="vintage_phantom", **yaml.safe_load(line))
    assert driver(options, 0.001).spec.force_feedback


def test_an_emulated_planar_device_is_asked_for_two_axes(tmp_path: Path) -> None:
    with emulated("haply_2diy", tmp_path) as (device, port):
        screen, error = device.check("haply_2diy", port, "xy")
    assert error == "", screen
    assert "The force is right.\n" in screen


@pytest.mark.parametrize(
    ("built", "complaint"),
    [
        ({"encoder_signs": (-1, 1, 1)}, "turn round y (the first of encoder_directions), and test it again"),
        ({"motor_signs": (-1, 1, 1)}, "turn round y (the first of motor_directions), and test it again"),
    ],
    ids=["a body turns the other way", "a motor pulls the other way"],
)
def test_an_emulated_phantom_that_is_built_otherwise_fails(
    built: dict[str, Any], complaint: str, tmp_path: Path
) -> None:
    with emulated("polhem_serial", tmp_path, **built) as (device, port):
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom")
    assert complaint in error
    assert "signs_checked: " not in screen


@pytest.mark.parametrize("wrong", ["encoder", "motor"])
def test_its_advice_makes_a_phantom_right(wrong: str, tmp_path: Path) -> None:
    """An encoder is turned round without its motor, and a motor without its encoder."""
    with emulated("polhem_serial", tmp_path, **{f"{wrong}_signs": (-1, 1, 1)}) as (device, port):
        advice = f"{wrong}_directions=[1, 1, -1]"
        screen, error = device.check("polhem_serial", port, "xyz", "model=vintage_phantom", advice)
    assert error == "", screen
    (line,) = (line for line in screen.splitlines() if line.strip().startswith("signs_checked:"))
    driver: Any = devices.load("polhem_serial")
    settings = {"model": "vintage_phantom", **yaml.safe_load(line)}
    assert driver(driver.Options(**settings, **{f"{wrong}_directions": (1, 1, -1)}), 0.001).spec.force_feedback
    assert not driver(driver.Options(**settings), 0.001).spec.force_feedback


def test_a_phantom_that_is_unplugged_ends_it_in_one_line(tmp_path: Path) -> None:
    emulator = emulators.load("polhem_serial")
    with PtyDevice(emulator(emulator.Options()), tmp_path / "port") as wire:

        def unplug() -> None:
            wire.unplug()
            sleep(0.5)

        said = complaint(Request("polhem_serial", None, [f"port={wire.path}"]), "", (unplug, ""), "")
    assert said == f"polhem_serial: {wire.path}: unplugged"


# --- a robot


class Arm:
    """A robot that follows by `gain`, and feels `force`."""

    Options = HandleOptions
    gain: ClassVar[float]
    force: ClassVar[Callable[[Vector], Vector]]
    start: ClassVar[Vector]
    log: ClassVar[list[tuple[str, Any]]]

    @classmethod
    def reset(cls) -> None:
        cls.gain, cls.start, cls.log = 1.0, (0.02, 0.0, EDGE - 0.001), []
        cls.force = staticmethod(lambda position: (0.0, 0.0, -1.0))

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return []

    def __init__(self, options: HandleOptions, scene: None, tick_period: float) -> None:
        self.spec = RobotSpec("arm", "xyz", 20.0, 1000.0, BOX, 1000.0, True, force_error=(0.5, 0.2))
        self._open = False
        self._position = self.start

    def open(self, now: float) -> None:
        self._open = True
        self.log.append(("open", None))

    def command(self, position: Vector, now: float) -> None:
        if self._open:
            self.log.append(("command", position))
            x, y, z = (a + self.gain * (b - a) for a, b in zip(self.start, position, strict=True))
            self._position = (x, y, z)

    def latest(self, now: float) -> RobotReading:
        if not self._open:
            raise RobotFault("arm: not open")
        return RobotReading(now, self._position, type(self).force(self._position))

    def close(self) -> None:
        if self._open:
            self.log.append(("close", None))
        self._open = False


def moved_robot(*lines: str) -> tuple[str, DeviceTestError | None]:
    screen = io.StringIO()
    dialog, keyboard = sitting(Clock(), screen, *lines)
    error = None
    try:
        try_robot(Arm, lambda: Arm(HandleOptions(), None, 0.001), dialog)
    except DeviceTestError as caught:
        error = caught
    assert Arm.log[-1] == ("close", None)
    assert keyboard.left == 0
    return screen.getvalue(), error


def commands() -> list[Vector]:
    return [what for kind, what in Arm.log if kind == "command"]


def test_a_good_robot_goes_a_little_along_each_axis_and_back_slowly() -> None:
    screen, error = moved_robot("", "", "yes")
    assert error is None
    assert screen.endswith("The motion is right.\n")
    assert "  +x: went 10.0 mm, came back to within 0.0 mm, force changed by 0.00 N" in screen
    assert "  -z: went 10.0 mm" in screen, "there is no room above"
    assert "(+-0.5 N and 20 %)" not in screen, "a plain line has the position alone"
    assert max(map(len, screen.splitlines())) <= WIDTH
    there = commands()
    assert max(norm(add(at, (-0.02, 0.0, 0.001 - EDGE))) for at in there) == pytest.approx(WAY_M, rel=1e-3)
    assert max(norm(add(b, (-a[0], -a[1], -a[2]))) for a, b in pairwise(there)) < 0.0005


def test_without_a_yes_a_robot_does_not_move() -> None:
    screen, error = moved_robot("", "", "sure")
    assert error is None
    assert "No motion, then." in screen
    assert commands() == []


@pytest.mark.parametrize("gain", [0.0, 0.3, -1.0], ids=["not at all", "too little", "the other way"])
def test_a_robot_that_does_not_follow_fails(gain: float) -> None:
    Arm.gain = gain
    _, error = moved_robot("", "", "yes")
    assert "arm: does not follow along x, y, z" in str(error)


def test_a_robot_that_meets_something_stops_where_it_is() -> None:
    Arm.gain = 0.8
    Arm.force = staticmethod(lambda p: (-1000.0 * max(0.0, p[0] - 0.022), 0.0, -1.0))
    _, error = moved_robot("", "", "yes")
    assert re.fullmatch(r"arm: met 5\.\d N along x and was stopped", str(error))
    assert commands()[-1][0] == pytest.approx(0.0272, abs=5e-4)
    assert commands()[-2][0] > 0.0285, "it was on its way farther"


def test_a_robot_without_room_does_not_move() -> None:
    Arm.start = (0.0, 0.0, 0.2)
    _, error = moved_robot("", "", "yes")
    assert "arm: is at 200 mm along z, outside of its workspace of -100 to 100 mm" in str(error)


def test_an_arm_of_250_hz_is_not_said_to_be_faster(tmp_path: Path) -> None:
    """Its readings are interpolated: each look finds another moment, but not another sample."""
    driver = robots.load("dynamixel")
    emulator = robot_emulators.load("dynamixel")
    with PtyDevice(emulator(), tmp_path / "arm") as wire:
        patient = {"timeout_ms": 100.0, "bus_watchdog_ms": 2000.0}  # for a machine that pauses
        robot = driver(driver.Options(port=str(wire.path), **patient), None, 0.001)
        view = RobotView(robot)
        robot.open(monotonic())
        try:
            until = monotonic() + 0.5
            while monotonic() < until:
                view.look(monotonic())
                sleep(0.001)
        finally:
            robot.close()
    (rate,) = re.findall(r"(\d+)/s", view.lines()[0])
    assert 0 < int(rate) <= 265


def test_point_is_a_robot_too() -> None:
    screen = io.StringIO()
    run(Request("point"), sitting(Clock(), screen, "", "yes")[0])
    assert screen.getvalue().endswith("The motion is right.\n")


# --- the command


def complaint(request: Request, *lines: Any) -> str:
    dialog, _ = sitting(Clock(), io.StringIO(), *lines)
    with pytest.raises((ConfigurationError, DeviceTestError)) as caught:
        run(request, dialog)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_wrong_names_and_options_are_one_line() -> None:
    assert complaint(Request("phantom")).startswith("phantom: there is no such driver; there are ")
    assert complaint(Request("operator", None, ["foce_n=1"])) == "operator.foce_n: unknown key; did you mean force_n?"
    assert "greater than 0" in complaint(Request("operator", None, ["force_n=0"]))
    assert "is operator, not replay" in complaint(Request("replay", CONFIGS / "loopback.yaml"))
    assert "no such file" in complaint(Request("operator", CONFIGS / "none.yaml"))
    assert complaint(Request("replay")) == "replay.trace: is missing"


def test_options_come_from_the_file_and_then_from_the_command_line() -> None:
    screen = io.StringIO()
    request = Request("operator", CONFIGS / "loopback.yaml", ["force_n=2.5", "master.device.workspace_m=0.05"])
    run(request, sitting(Clock(), screen, "", "no")[0])
    assert "operator: axes xyz, workspace 100 x 100 x 100 mm, at most 2.5 N" in screen.getvalue()


def test_who_stops_is_told_that_the_force_is_off() -> None:
    assert complaint(Request("operator"), "") == "operator: stopped before the end; the force is off"
    assert complaint(Request("point"), "") == "point: stopped before the end"


# --- rate and age


def test_the_rate_is_that_of_new_samples_and_the_age_the_greatest_of_the_last_second() -> None:
    gauge = Gauge()
    for tick in range(3000):
        now = tick * 0.001
        at = (tick // 4) * 0.004
        gauge.note(now, at - (0.05 if tick < 500 else 0.0))
    assert gauge.rate_hz == pytest.approx(250.0, rel=0.01)
    assert gauge.oldest_s == pytest.approx(0.003)
    assert gauge.in_words(0.0004) == "250/s, age 3.0 ms, trip 0.40 ms"


def test_interpolated_readings_count_once_per_sample() -> None:
    """A loop of 1 kHz looks at an arm of 250 Hz, whose readings are of every moment."""
    gauge = Gauge()
    for tick in range(3000):
        now = tick * 0.001
        gauge.note(now, now - 0.006, sampled_at=(tick // 4) * 0.004)
    assert gauge.rate_hz == pytest.approx(250.0, rel=0.01)
    assert gauge.oldest_s == pytest.approx(0.006)


def test_before_anything_is_known_the_gauge_says_zero() -> None:
    gauge = Gauge()
    assert gauge.in_words() == "0/s, age 0.0 ms"
    gauge.note(1.0, 0.9)
    assert gauge.rate_hz == 0.0


# --- a terminal


@pytest.fixture
def terminal() -> Iterator[tuple[int, io.TextIOWrapper]]:
    """Both ends of a pseudo-terminal: that of the person, and that of the program."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        yield ours, stream
    os.close(ours)


class Counting:
    """Presses Enter after 150 looks."""

    def __init__(self, enter: Callable[[], object]) -> None:
        self.looks = 0
        self._enter = enter

    def look(self, now: float) -> None:
        self.looks += 1
        if self.looks == 150:
            self._enter()

    def lines(self) -> list[str]:
        return [f"look {self.looks}", "below"]


def test_on_a_terminal_readings_are_live_until_enter(
    terminal: tuple[int, io.TextIOWrapper], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    ours, stream = terminal
    view = Counting(lambda: os.write(ours, b"\n"))
    os.write(ours, b"typed too early\n")
    Dialog(stream, stream).watch(view, "Enter to go on: ")
    shown = b""
    while select.select([ours], [], [], 0.3)[0]:
        shown += os.read(ours, 65536)
    text = shown.decode()
    assert view.looks >= 150, "what was typed before does not count"
    assert text.count("Enter to go on: ") >= 2, "drawn anew"
    assert text.rstrip().endswith("below")
    assert "look 1\r\nbelow" in text


def test_ctrl_c_in_a_process_is_one_line_and_exit_status_1() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "weberlink", "device", "test", "operator"], cwd=CONFIGS.parent, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        while not process.stdout.readline().startswith("x "):
            pass
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert errors == "weberlink: operator: stopped before the end; the force is off\n"
    assert process.returncode == 1


@pytest.mark.parametrize(
    ("arguments", "status"),
    [(["nobody"], 2), (["operator", "--set", "force_n=-1"], 2), (["operator", "--config", "none.yaml"], 2)],
    ids=["no such driver", "a wrong option", "no such file"],
)
def test_what_is_wrong_with_the_arguments_is_one_line(arguments: list[str], status: int) -> None:
    result = CliRunner().invoke(app, ["device", "test", *arguments])
    assert (result.exit_code, result.stdout) == (status, "")
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("weberlink: ")
