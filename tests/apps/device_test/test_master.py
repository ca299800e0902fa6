"""`device test` of a haptic device: order of the steps, signs, force, and zero force at every end."""

import io
from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

import pytest
import yaml
from pydantic import BaseModel, ConfigDict

from tests.apps.device_test.people import Clock, sitting
from weberlink.apps.device_test import DeviceTestError, DeviceTestRequest, run
from weberlink.apps.device_test.dialog import StoppedByUser
from weberlink.apps.device_test.master import (
    FRAME,
    GIVES_WAY_M,
    LEAST_M,
    PUSH_N,
    ObservedMotion,
    classify_motion,
    try_master,
)
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale
from weberlink.hardware.discovery import PluggedDevice
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec

WIDTH = 80
BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))
PRINT = "a1b2c3d4"


class HandleOptions(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    signs_checked: str | None = None


class Handle:
    """A device whose handle a test moves; `turn` is its fault. Without the right `signs_checked` it has no force."""

    Options = HandleOptions
    SIGN_OPTIONS: ClassVar[dict[str, str]] = {"x": "the second of directions"}
    FORCE_OPTIONS: ClassVar[dict[str, str]] = {"y": "the first of motor_directions"}
    AXES = "xyz"
    hand: ClassVar[Vector]
    turn: ClassVar[Callable[[Vector], Vector]]
    log: ClassVar[list[tuple[str, Any]]]
    fails_at: ClassVar[float | None]
    round_trip_s = 0.00025

    @classmethod
    def reset(cls) -> None:
        cls.hand, cls.turn, cls.log, cls.fails_at = ZERO, staticmethod(lambda hand: hand), [], None

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return []

    @classmethod
    def fingerprint(cls, options: HandleOptions) -> str:
        return PRINT

    def __init__(self, options: HandleOptions) -> None:
        self._armed = options.signs_checked == self.fingerprint(options)
        self._open = False
        self.spec = DeviceSpec(
            "handle", self.AXES, 3.0 if self._armed else 0.0, 1000.0, BOX, 1000.0, self._armed,
            buttons=2, orientation=True, note="hold it at home when it is opened",
        )  # fmt: skip

    def open(self, now: float) -> None:
        self._open = True
        self.log.append(("open", self._armed))

    def latest(self, now: float) -> DeviceReading:
        if not self._open or (self.fails_at is not None and now >= self.fails_at):
            raise DeviceFault("handle: unplugged")
        turned = type(self).turn(Handle.hand)
        return DeviceReading(now - 0.0004, turned, orientation=(1.0, 0.0, 0.0, 0.0), buttons=0b10)

    def command(self, force: Vector, now: float) -> None:
        if self._open:
            self.log.append(("force", force))

    def close(self) -> None:
        if self._open:
            self.log.append(("close", None))
        self._open = False


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Handle.reset()


def moved(x: float, y: float, z: float) -> tuple[Callable[[], None], str]:
    """The hand moves there [m], then presses Enter."""

    def move() -> None:
        Handle.hand = (x, y, z)

    return move, ""


CENTRE = moved(0.0, 0.0, 0.0)
SIGNS = (CENTRE, moved(0.05, 0.004, 0.0), CENTRE, moved(0.0, 0.05, -0.01), CENTRE, moved(0.01, 0.0, 0.05))
"""The hand goes to the middle and along an axis, three times."""
OPEN = ("", "")
"""Enter to open, Enter to go on."""
PUSHES = ("yes", "", "", "y", "", "y", "", "y")
"""Agree, open, and three times Enter and the answer."""
ALL = (*OPEN, *SIGNS, *PUSHES)


def outcome_of(
    *lines: Any, driver: Any = Handle, clock: Clock | None = None, yes: bool = False
) -> tuple[str, DeviceTestError | None]:
    """The screen of a person who types this, and the error at the end; force and device are off then."""
    screen, error = io.StringIO(), None
    dialog, keyboard = sitting(clock or Clock(), screen, *lines, yes=yes)
    try:
        try_master(driver, driver.Options(), driver, dialog)
    except DeviceTestError as caught:
        error = caught
        assert "\n" not in str(error)
    assert keyboard.left == []
    assert_safe()
    return screen.getvalue(), error


def forces() -> list[Vector]:
    return [what for kind, what in Handle.log if kind == "force"]


def assert_safe() -> None:
    """Whatever was opened got zero force last, and was closed."""
    kinds = [kind for kind, _ in Handle.log]
    assert kinds.count("open") == kinds.count("close") > 0
    for index, kind in enumerate(kinds):
        if kind == "close":
            assert Handle.log[index - 1] == ("force", ZERO)


def test_good_device_passes_with_gentle_smooth_pushes() -> None:
    screen, error = outcome_of(*ALL)
    assert error is None
    assert screen.endswith(f"The force is right.\nPut this line under master.device:\n  signs_checked: {PRINT}\n")
    assert screen.count(": right\n") == 3
    for part in ("Note: hold it at home when it is opened", "100/s", "trip 0.25 ms"):
        assert part in screen
    assert max(map(len, screen.splitlines())) <= WIDTH
    pushes = forces()
    assert max(map(norm, pushes)) == pytest.approx(PUSH_N, rel=1e-3)
    for axis in range(3):
        along = [force[axis] for force in pushes]
        assert max(along) == pytest.approx(PUSH_N, rel=1e-3)
        assert min(along) >= 0.0
        assert all(sum(component != 0.0 for component in force) <= 1 for force in pushes)
        assert max(abs(b - a) for a, b in pairwise(along)) < 0.02


@pytest.mark.parametrize("signs_checked", [None, PRINT], ids=["unchecked", "checked before"])
def test_without_yes_no_force(signs_checked: str | None) -> None:
    screen = io.StringIO()
    dialog, _ = sitting(Clock(), screen, *OPEN, *SIGNS, "y")  # not the whole word
    try_master(Handle, HandleOptions(signs_checked=signs_checked), Handle, dialog)
    assert "The force is not tested." in screen.getvalue()
    assert "signs_checked: " not in screen.getvalue()
    assert [armed for kind, armed in Handle.log if kind == "open"] == [False]
    assert set(forces()) == {ZERO}


def test_yes_may_be_given_in_advance() -> None:
    screen, error = outcome_of(*OPEN, *SIGNS, *PUSHES[1:], yes=True)
    assert error is None
    assert "Type yes to feel it: yes (--yes)\n" in screen


def test_push_is_repeated_on_request() -> None:
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", "", "r", "", "maybe", "y", "", "y", "", "y")
    assert error is None
    assert screen.count("Did it push toward you?") == 3
    assert "Please type one of y, n, r, and Enter." in screen


@pytest.mark.parametrize("wrong", "xyz")
def test_wrong_force_fails_without_fingerprint(wrong: str) -> None:
    answers = [each for axis in "xyz" for each in ("", "n" if axis == wrong else "y")]
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", *answers)
    assert f"the force is wrong along {wrong}: leave signs_checked out" in str(error)
    advice = Handle.FORCE_OPTIONS.get(wrong, "the direction of its motor")
    assert f"reverse {wrong} ({advice}), and test it again" in str(error)
    assert "signs_checked" not in screen


def test_push_ends_when_the_handle_gives_way() -> None:
    clock = Clock()

    def yields(now: float) -> None:
        if any(force != ZERO for force in forces()):
            Handle.hand = add(Handle.hand, (0.0005, 0.0, 0.0))

    clock.on_pause = yields
    screen, _ = outcome_of(*OPEN, *SIGNS, "yes", "", "", "y", CENTRE, "y", CENTRE, "y", clock=clock)
    assert f"The handle moved by {GIVES_WAY_M * 1e3:.0f} mm" in screen
    assert len([force for force in forces() if force[0] > 0.0]) <= GIVES_WAY_M / 0.0005 + 2


def unlisted(**attributes: object) -> Any:
    """A driver as `Handle`, without the optional `plugged`."""
    left_out = ("plugged", "__dict__", "__weakref__")
    own = {name: value for name, value in vars(Handle).items() if name not in left_out}
    return type("Unlisted", (), own | attributes)


def test_driver_that_lists_no_devices_is_tested_as_hardware() -> None:
    screen, error = outcome_of(*ALL, driver=unlisted())
    assert error is None
    assert screen.endswith(f"  signs_checked: {PRINT}\n")
    Handle.reset()
    Handle.turn = staticmethod(lambda p: (-p[0], p[1], p[2]))
    screen, error = outcome_of(*OPEN, *SIGNS, driver=unlisted())
    assert "reverse x" in str(error)
    assert set(forces()) == {ZERO}


@pytest.mark.parametrize("make", [lambda: Handle, unlisted], ids=["plugged", "unlisted"])
def test_loose_handle_is_not_pushed_away(make: Callable[[], Any]) -> None:
    clock, furthest = Clock(), 0.0

    def runs(_now: float) -> None:
        nonlocal furthest
        if forces() and forces()[-1] != ZERO:
            Handle.hand = add(Handle.hand, scale(forces()[-1], 0.001 / norm(forces()[-1])))
            furthest = max(furthest, norm(Handle.hand))

    clock.on_pause = runs
    pushes = [part for answer in "yyy" for part in (CENTRE, answer)]
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", *pushes, driver=make(), clock=clock)
    assert error is None
    assert screen.count("The handle moved by") == 3
    assert furthest <= GIVES_WAY_M + 0.002


def test_driver_that_says_it_is_computed_needs_no_sign_check() -> None:
    screen, error = outcome_of("", *PUSHES[:1], *PUSHES[2:], driver=unlisted(COMPUTED=True))
    assert error is None
    assert "This device is simulated" in screen


def test_simulated_device_needs_no_sign_check() -> None:
    screen = io.StringIO()
    run(DeviceTestRequest("operator"), sitting(Clock(), screen, "", "yes", "", "y", "", "y", "", "y")[0])
    assert "no signs to check" in screen.getvalue()
    assert screen.getvalue().endswith("The force is right.\n")


@pytest.mark.parametrize(
    ("turn", "expected"),
    [
        (lambda p: (-p[0], p[1], p[2]), "reverse x (the second of directions), and test it again"),
        (lambda p: (p[0], -p[1], -p[2]), "reverse y (its direction), z (its direction), and test it again"),
        (lambda p: (p[1], p[0], p[2]), "axes are interchanged (x comes out as y, y comes out as x)"),
        (lambda p: (-p[2], p[1], p[0]), "axes are interchanged (x comes out as z, z comes out as x)"),
    ],
    ids=["one reversed", "two reversed", "two exchanged", "exchanged and reversed"],
)
def test_wrong_sign_ends_before_any_force(turn: Callable[[Vector], Vector], expected: str) -> None:
    Handle.turn = staticmethod(turn)
    screen, error = outcome_of(*OPEN, *SIGNS)
    assert expected in str(error)
    assert "WRONG" in screen
    assert "signs_checked" not in screen
    assert set(forces()) == {ZERO}


def test_unclear_motion_is_asked_for_again() -> None:
    small, askew = moved(0.01, 0.0, 0.0), moved(0.04, 0.04, 0.0)
    screen, error = outcome_of(*OPEN, CENTRE, small, CENTRE, askew, *SIGNS, *PUSHES)
    assert error is None
    assert "The position changed by 10 mm, which is too little: move it by about 5 cm." in screen
    assert "(+40, +40, +0) mm, not along one axis: move it straight toward you." in screen
    _, error = outcome_of(*OPEN, *((CENTRE, askew) * 3))
    assert "no clear motion along x" in str(error)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("way", [-0.05, 0.05])
def test_motion_is_classified_by_its_largest_component(axis: int, way: float) -> None:
    components = [0.2 * way] * 3
    components[axis] = way
    found = classify_motion("x", (components[0], components[1], components[2]), FRAME)
    assert found == ObservedMotion("x", "xyz"[axis], way)
    assert found.right == (axis == 0 and way > 0.0)
    assert isinstance(classify_motion("z", (0.0, 0.0, LEAST_M * 0.99), FRAME), str)
    assert isinstance(classify_motion("z", (0.0, 0.0, LEAST_M * 1.01), FRAME), ObservedMotion)


def test_driver_defines_axes_and_their_directions() -> None:
    class Flat(Handle):
        AXES = "xy"
        FRAME: ClassVar[dict[str, str]] = {"x": "to the right", "y": "away from you"}

    screen, error = outcome_of(*OPEN, *SIGNS[:4], "yes", "", "", "y", "", "y", driver=Flat)
    assert error is None
    assert "Move it away from you by about 5 cm" in screen
    assert "Did it push to the right?" in screen
    assert "up" not in screen


def test_numeric_fingerprint_is_printed_as_text() -> None:
    class Digits(Handle):
        @classmethod
        def fingerprint(cls, options: HandleOptions) -> str:
            return "12345678"

    screen, _ = outcome_of(*ALL, driver=Digits)
    (line,) = (line for line in screen.splitlines() if "signs_checked" in line)
    assert yaml.safe_load(line) == {"signs_checked": "12345678"}


def test_device_without_force_gets_no_fingerprint() -> None:
    class Weak(Handle):
        def __init__(self, options: HandleOptions) -> None:
            super().__init__(HandleOptions())

    screen, error = outcome_of(*OPEN, *SIGNS, driver=Weak)
    assert error is None
    assert "signs_checked" not in screen
    assert "With these options the device gives no force" in screen


@pytest.mark.parametrize("lines", range(1, len(ALL)))
def test_end_of_input_leaves_the_device_safe(lines: int) -> None:
    with pytest.raises(StoppedByUser):
        outcome_of(*ALL[:lines])
    assert_safe()


@pytest.mark.parametrize("after_s", [0.5, 2.2, 8.1, 8.6, 9.4, 10.2])
def test_ctrl_c_and_faults_leave_the_device_safe(after_s: float) -> None:
    clock = Clock()

    def interrupt(now: float) -> None:
        if now > 100.0 + after_s:
            raise KeyboardInterrupt

    clock.on_pause = interrupt
    with pytest.raises(KeyboardInterrupt):
        outcome_of(*ALL, clock=clock)
    assert_safe()
    Handle.reset()
    Handle.fails_at = 100.0 + after_s
    with pytest.raises(DeviceFault, match="handle: unplugged"):
        outcome_of(*ALL)
    assert_safe()
