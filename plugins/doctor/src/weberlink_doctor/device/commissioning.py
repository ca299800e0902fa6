"""The `device test` command: a person tests one device or robot before it is used in a session.

A device: readings, then a check of signs without force, then a gentle force along each axis. A robot: readings, then a
small slow motion along each axis and back.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, inf, pi
from pathlib import Path
from textwrap import wrap
from typing import Any

import yaml
from pydantic import BaseModel

from weberlink.cli.output import CommandError
from weberlink.config import MASTER, SIDES, ConfigurationError, load
from weberlink.config.document import override
from weberlink.config.loading import DRIVERS, SECTIONS, Part, load_part
from weberlink.config.model import DriverSettings
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale, subtract
from weberlink.installation import absence
from weberlink.master.devices.contract import Device, DeviceFault, DeviceReading, DeviceSpec
from weberlink.registry import is_hardware
from weberlink.session.composition.link import build_driver
from weberlink.slave.robots.contract import Robot, RobotFault, RobotReading, RobotSpec
from weberlink_doctor.device.dialog import Dialog, StoppedByUser, View, uninterrupted

RATE_HZ = 1000.0  # rate of the loop that the driver is built for, if there is no file


def run(name: str, dialog: Dialog, file: Path | None = None, overrides: Sequence[str] = ()) -> None:
    """Test a device or a robot, with the options of a file, or else its defaults, and "key=value" overrides of them; a
    key may have the full path.

    Raises:
        ConfigurationError: there is no such driver, or its options are wrong.
        CommandError: the test failed, or the person stopped. The force is zero and the device closed.
    """
    hands, arms = ({side: DRIVERS[SECTIONS[side]][place] for side in SIDES} for place in (0, 1))
    if any(name in each for each in arms.values()):
        raise ConfigurationError(
            f"{name}: this test moves one handle or one tool, and knows no arms; start as docs/arms/ says"
        )
    side = next((side for side, each in hands.items() if name in each), None)
    if side is None:
        absent = {each: guest for table in (*hands.values(), *arms.values()) for each, guest in table.absent().items()}
        if name in absent:
            raise ConfigurationError(absence(f"driver {name!r}", absent[name]))
        known = ", ".join(name for each in hands.values() for name in sorted(each))
        raise ConfigurationError(f"{name}: there is no such driver; there are {known}")
    section = SECTIONS[side]
    part, tick_period = _part(name, side, file, [text.removeprefix(f"{section}.") for text in overrides])
    driver, options = part.driver, part.options
    try:
        if side == MASTER:
            try_master(driver, options, lambda options: build_driver(section, driver, options, tick_period), dialog)
        else:
            try_robot(driver, lambda: build_driver(section, driver, options, None, tick_period), dialog)
    except (DeviceFault, RobotFault) as fault:
        raise CommandError(str(fault)) from None
    except (StoppedByUser, KeyboardInterrupt):
        dialog.tell("")
        left = "; the force is off" if side == MASTER else ""
        raise CommandError(f"{name}: stopped before the end{left}") from None


def _part(name: str, side: str, file: Path | None, overrides: Sequence[str]) -> tuple[Part, float]:
    """The driver of a configuration, or with its defaults, and the tick period [s]."""
    section = SECTIONS[side]
    if file is None:
        content: dict[str, Any] = {}
        for text in overrides:
            override(content, text)
        settings = DriverSettings(driver=name, **content)
        return load_part(DRIVERS[section][0], settings, section, Path.cwd(), ()), 1.0 / RATE_HZ
    loaded = load(file, [f"{section}.{text}" for text in overrides], sides=[side])
    is_master, system = side == MASTER, loaded.system
    part = loaded.device if is_master else loaded.robot
    assert part is not None
    named = (system.master.device if is_master else system.slave.robot).driver
    if named != name:
        raise ConfigurationError(f"{file}: {section}.driver: is {named}, not {name}")
    return part, loaded.system.tick_period


def described(spec: DeviceSpec | RobotSpec) -> Iterator[str]:
    """Lines to show before a device or robot is opened."""
    (x0, y0, z0), (x1, y1, z1) = spec.workspace_m
    box = " x ".join(f"{(high - low) * 1e3:.0f}" for low, high in ((x0, x1), (y0, y1), (z0, z1)))
    yield f"{spec.name}: axes {spec.axes}, workspace {box} mm, at most {spec.force_n:g} N"
    if spec.note:
        yield from wrap(f"Note: {spec.note}", 78)


# --- a haptic device

Frame = Mapping[str, str]  # direction of each positive axis, as the person before the device sees it
FRAME: Frame = {"x": "toward you", "y": "to the right", "z": "up"}  # the default; drivers may give another
UNITS: Mapping[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEAST_M = 0.015  # shorter motions are ignored: a hand that holds still moves by millimetres
MAINLY = 0.8  # share of the motion that one axis must have: within 37 degrees of it
TRIES = 3  # unclear motions in a row until the test fails
PUSH_N = 0.3  # felt by everybody, and too weak to hurt or to throw a handle that is held
RAMP_S = 0.5
HOLD_S = 0.5
GIVES_WAY_M = 0.03  # a handle that nobody holds moves farther; the push ends there
READY = "Move the handle to its start pose of a session."
# Option of drivers that give no force until a person has checked their directions. Its value is printed only after the
# last axis was felt: a correct position does not show that the motors are correct.
SIGNS = "signs_checked"


def try_master(driver: Any, options: BaseModel, build: Callable[[BaseModel], Device], dialog: Dialog) -> None:
    """Test a haptic device of a driver, which `build` makes from options. However it ends, the force is zero."""
    frame: Frame = {**FRAME, **getattr(driver, "FRAME", {})}
    is_real = is_hardware(driver)
    fingerprint: str | None = driver.fingerprint(options) if hasattr(driver, "fingerprint") else None
    idle, armed = (
        build(options.model_copy(update={SIGNS: signs}) if SIGNS in type(options).model_fields else options)
        for signs in (None, fingerprint)
    )
    dialog.tell(*described(armed.spec))
    if is_real:
        dialog.tell(READY)
        dialog.ask("Press Enter to open it, without force: ")
    with _opened(idle, dialog) as device:
        dialog.watch(_view_of(device), "Press Enter to continue: ")
        if is_real:
            _check_signs(device, frame, getattr(driver, "SIGN_OPTIONS", {}), dialog)
        else:
            dialog.tell("This device is simulated: it has no handle to move and no signs to check.")
    if not armed.spec.force_feedback:
        dialog.tell("With these options the device gives no force; the test is done.")
        return
    push_n, seconds = min(PUSH_N, armed.spec.force_n), 2.0 * RAMP_S + HOLD_S
    dialog.tell("", f"Check of force: a push of {push_n:g} N along each axis in turn, for {seconds:g} s each.")
    if not dialog.agrees("Type yes to feel it: "):
        dialog.tell("The force is not tested.")
        if fingerprint is not None:
            dialog.tell(f"The signs of the motors are not checked, so {SIGNS} is not printed.")
        return
    if is_real:
        dialog.tell(READY)
        dialog.ask("Hold it, then press Enter to open it, with force: ")
    with _opened(armed, dialog) as device:
        gives_way = GIVES_WAY_M if is_real else inf  # a simulated handle moves by itself
        _check_force(device, push_n, frame, getattr(driver, "FORCE_OPTIONS", {}), dialog, gives_way)
    if fingerprint is not None:
        # Quoted if YAML would read a number.
        quoted = fingerprint if yaml.safe_load(fingerprint) == fingerprint else f'"{fingerprint}"'
        dialog.tell("Put this line under master.device:", f"  {SIGNS}: {quoted}")
    examine = getattr(armed, "examine", None)  # of drivers that find out what becomes of a force on its way to the hand
    if examine is not None:
        dialog.ask(f"\nHold it, then press Enter for a few short pushes of {push_n:g} N up: ")
        dialog.tell(*examine((0.0, 0.0, push_n)))


@contextmanager
def _opened(device: Device, dialog: Dialog) -> Iterator[Device]:
    """An open device; whatever ends the block, the force is at zero and the device closed."""
    try:
        device.open(dialog.now())
        yield device
    finally:
        with uninterrupted():
            device.command(ZERO, dialog.now())
            device.close()


def _view_of(device: Device) -> View:
    """Position, rate, age, orientation, buttons and trouble of an open device."""
    buttons = device.spec.buttons

    def details(reading: DeviceReading) -> Iterator[str]:
        if reading.orientation is not None:
            yield "orientation (w, x, y, z) " + " ".join(f"{part:+.3f}" for part in reading.orientation)
        if buttons:
            pressed = [str(button) for button in range(buttons) if reading.buttons >> button & 1]
            yield f"buttons pressed: {', '.join(pressed) or 'none'} (of 0 to {buttons - 1})"
        if trouble := getattr(device, "trouble", None):
            yield trouble

    return View(device.latest, details, lambda: getattr(device, "round_trip_s", None))


@dataclass(frozen=True)
class ObservedMotion:
    """The axis along which a handle moved."""

    asked: str  # axis along which the hand moved, in the positive direction
    axis: str  # axis along which the position changed
    way_m: float  # signed distance

    @property
    def right(self) -> bool:
        return self.axis == self.asked and self.way_m > 0.0


def classify_motion(asked: str, moved: Vector, frame: Frame) -> ObservedMotion | str:
    """Find the axis of a motion [m], or the reason why that is unclear; the frame is for the text."""
    way = norm(moved)
    if way < LEAST_M:
        return f"The position changed by {way * 1e3:.0f} mm, which is too little: move it by about 5 cm."
    axis, along = max(zip("xyz", moved, strict=True), key=lambda pair: abs(pair[1]))
    if abs(along) < MAINLY * way:
        x, y, z = (f"{component * 1e3:+.0f}" for component in moved)
        return f"The position changed by ({x}, {y}, {z}) mm, not along one axis: move it straight {frame[asked]}."
    return ObservedMotion(asked, axis, along)


def _check_signs(device: Device, frame: Frame, options: Mapping[str, str], dialog: Dialog) -> None:
    """Ask for a motion along every axis: with a wrong sign, a wall would push instead of resist."""
    dialog.tell("", "Check of signs: you move the handle; there is no force.")
    motions = [_motion(axis, device, frame, dialog) for axis in device.spec.axes]
    dialog.tell("")
    for each in motions:
        what = "right" if each.right else "WRONG AXIS" if each.axis != each.asked else "WRONG DIRECTION"
        dialog.tell(f"  +{each.asked} ({frame[each.asked]}): {each.way_m * 1e3:+.0f} mm along {each.axis}: {what}")
    crossed = [f"{each.asked} comes out as {each.axis}" for each in motions if each.axis != each.asked]
    if crossed:
        raise CommandError(
            f"{device.spec.name}: axes are interchanged ({', '.join(crossed)}), so there must be no force: "
            "check that the options name the right model, and the cables"
        )
    flips = [f"{each.asked} ({options.get(each.asked, 'its direction')})" for each in motions if not each.right]
    if flips:
        raise CommandError(
            f"{device.spec.name}: moves the wrong way, so there must be no force; in the options, reverse "
            f"{', '.join(flips)}, and test it again"
        )


def _motion(axis: str, device: Device, frame: Frame, dialog: Dialog) -> ObservedMotion:
    for _ in range(TRIES):
        dialog.ask("\nHold the handle in the middle of its workspace, then Enter: ")
        start = device.latest(dialog.now()).position
        dialog.watch(_view_of(device), f"Move it {frame[axis]} by about 5 cm, hold it there, then Enter: ")
        found = classify_motion(axis, subtract(device.latest(dialog.now()).position, start), frame)
        if isinstance(found, ObservedMotion):
            return found
        dialog.tell(found)
    raise CommandError(
        f"{device.spec.name}: no clear motion along {axis}; check that it is at its home pose when it is "
        "homed, and that the options name the right model"
    )


def _check_force(
    device: Device, push_n: float, frame: Frame, options: Mapping[str, str], dialog: Dialog, gives_way: float
) -> None:
    """Push a little along every axis. Raises CommandError if that was felt in another direction, or not at all."""
    spec, wrong = device.spec, []
    for axis in spec.axes:
        answer = "r"
        while answer == "r":
            dialog.ask(f"\nPress Enter for a push {frame[axis]}: ")
            _push(scale(UNITS[axis], push_n), device, gives_way, dialog)
            answer = dialog.choose(f"Did it push {frame[axis]}? y, n, or r to repeat it: ", ("y", "n", "r"))
        if answer == "n":
            wrong.append(axis)
    if wrong:
        advice = ", ".join(f"{axis} ({options.get(axis, 'the direction of its motor')})" for axis in wrong)
        raise CommandError(
            f"{spec.name}: the force is wrong along {', '.join(wrong)}: leave signs_checked out of the file; check "
            f"that the options name the right model; where it pushes the other way, reverse {advice}, and test it again"
        )
    dialog.tell("The force is right.")


def _push(force: Vector, device: Device, gives_way: float, dialog: Dialog) -> None:
    """Ramp up, hold, ramp down; stop at once if the handle moves farther than `gives_way` [m]."""
    began = dialog.now()
    start = device.latest(began).position
    is_held = True

    def tick(now: float) -> None:
        nonlocal is_held
        is_held = is_held and distance(device.latest(now).position, start) <= gives_way
        elapsed = now - began
        into = min(elapsed, 2.0 * RAMP_S + HOLD_S - elapsed) / RAMP_S
        share = 0.5 - 0.5 * cos(pi * min(1.0, max(0.0, into)))  # half a cosine up and down
        device.command(scale(force, share) if is_held else ZERO, now)

    try:
        dialog.wait(2.0 * RAMP_S + HOLD_S, tick)
    finally:
        with uninterrupted():
            device.command(ZERO, dialog.now())
    if not is_held:
        dialog.tell(f"The handle moved by {gives_way * 1e3:.0f} mm, so the force ended: hold it, and repeat the push.")


# --- a robot

WAY_M = 0.01
LEG_S = 1.0
REST_S = 0.5  # pause at either end, for the robot to arrive
FOLLOWS = 0.5  # least share of the way that counts as following
FORCE_CHANGE_N = 5.0  # a larger change is a contact; the motion ends there


def try_robot(driver: Any, build: Callable[[], Robot], dialog: Dialog) -> None:
    """Test the robot of a driver. However that ends, it stays where it is."""
    robot = build()
    newtons, share = robot.spec.force_error
    error = f"    (+-{newtons:g} N and {share * 100:g} %)" if newtons or share else ""

    def force(reading: RobotReading) -> Iterator[str]:
        if robot.spec.force_sensing:
            components = zip("xyz", reading.force, strict=True)
            yield "  ".join(f"{axis} {component:+7.2f}" for axis, component in components) + f" N{error}"

    dialog.tell(*described(robot.spec))
    if is_hardware(driver):
        dialog.ask("Support the arm if it is limp: its motors switch on. Press Enter to open it: ")
    try:
        robot.open(dialog.now())
        dialog.watch(View(robot.latest, force), "Press Enter to continue: ")
        _check_motion(robot, dialog)
    finally:
        with uninterrupted():
            robot.close()


def _check_motion(robot: Robot, dialog: Dialog) -> None:
    """Move a little along every axis and back. Raises CommandError if it does not follow, or meets something."""
    spec = robot.spec
    dialog.tell("", f"Check of motion: {WAY_M * 1e3:g} mm along each axis and back, {LEG_S:g} s each way.")
    if not dialog.agrees("Is the workspace free? Type yes to move it: "):
        dialog.tell("The motion is not tested.")
        return
    position = robot.latest(dialog.now()).position
    signs = {axis: _direction("xyz".index(axis), position, spec) for axis in spec.axes}  # all, before any motion
    went = {axis: _out_and_back("xyz".index(axis), sign, robot, dialog) for axis, sign in signs.items()}
    wrong = [axis for axis, way_m in went.items() if way_m < FOLLOWS * WAY_M]
    if wrong:
        raise CommandError(
            f"{spec.name}: does not follow along {', '.join(wrong)}; check that the file describes this robot"
        )
    dialog.tell("The motion is right.")


def _out_and_back(index: int, sign: float, robot: Robot, dialog: Dialog) -> float:
    """Move along one axis in a direction, +1 or -1; returns the greatest distance along the way [m]."""
    began = dialog.now()
    start = robot.latest(began)
    way = scale(UNITS["xyz"[index]], sign * WAY_M)
    went_m, back_m, change_n = -inf, 0.0, 0.0

    def tick(now: float) -> None:
        nonlocal went_m, back_m, change_n
        reading = robot.latest(now)
        went_m = max(went_m, sign * (reading.position[index] - start.position[index]))
        back_m = distance(reading.position, start.position)
        change_n = max(change_n, norm(subtract(reading.force, start.force)))
        if change_n > FORCE_CHANGE_N:
            robot.command(reading.position, now)
            raise CommandError(f"{robot.spec.name}: met {change_n:.1f} N along {'xyz'[index]} and was stopped")
        elapsed = now - began  # minimum jerk out, rest, back, rest
        along = elapsed / LEG_S if elapsed < LEG_S + REST_S else (2.0 * LEG_S + REST_S - elapsed) / LEG_S
        share = min(1.0, max(0.0, along))
        share = share * share * share * (10.0 + share * (6.0 * share - 15.0))
        robot.command(add(start.position, scale(way, share)), now)

    dialog.wait(2.0 * (LEG_S + REST_S), tick)
    dialog.tell(
        f"  {'+' if sign > 0.0 else '-'}{'xyz'[index]}: went {went_m * 1e3:.1f} mm, "
        f"came back to within {back_m * 1e3:.1f} mm"
        + (f", force changed by {change_n:.2f} N" if robot.spec.force_sensing else "")
    )
    return went_m


def _direction(index: int, position: Vector, spec: RobotSpec) -> float:
    """Direction with room in the workspace, +1 or -1. Raises CommandError if there is none."""
    there, lower, upper = (vector[index] for vector in (position, *spec.workspace_m))
    for sign in (1.0, -1.0):
        if lower <= there + sign * WAY_M <= upper:
            return sign
    raise CommandError(
        f"{spec.name}: is at {there * 1e3:.0f} mm along {'xyz'[index]}, outside of its workspace of "
        f"{lower * 1e3:.0f} to {upper * 1e3:.0f} mm: move it inside by hand, or set another workspace"
    )
