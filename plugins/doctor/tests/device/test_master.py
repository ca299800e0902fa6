"""`device test` of a haptic device: order of the steps, signs, force, and zero force at every end."""

import io
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, ClassVar

import pytest
from pydantic import BaseModel

from plugins.doctor.tests.device.people import Clock, sitting
from weberlink.cli.output import CommandError
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec
from weberlink_doctor.device.commissioning import GIVES_WAY_M, PUSH_N, StoppedByUser, try_master

BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))
PRINT = "a1b2c3d4"


class HandleOptions(BaseModel):
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

    @classmethod
    def reset(cls) -> None:
        cls.hand, cls.turn, cls.log, cls.fails_at = ZERO, staticmethod(lambda hand: hand), [], None

    @classmethod
    def fingerprint(cls, options: HandleOptions) -> str:
        return PRINT

    def __init__(self, options: HandleOptions) -> None:
        self._armed = options.signs_checked == self.fingerprint(options)
        self._open = False
        self.spec = DeviceSpec("handle", self.AXES, 3.0 if self._armed else 0.0, 1000.0, BOX, 1000.0, self._armed)

    def open(self, now: float) -> None:
        self._open = True
        self.log.append(("open", self._armed))

    def latest(self, now: float) -> DeviceReading:
        if not self._open or (self.fails_at is not None and now >= self.fails_at):
            raise DeviceFault("handle: unplugged")
        return DeviceReading(now - 0.0004, type(self).turn(Handle.hand))

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
OPEN = ("", "")  # enter to open, Enter to go on
PUSHES = ("yes", "", "", "y", "", "y", "", "y")  # agree, open, and three times Enter and the answer
ALL = (*OPEN, *SIGNS, *PUSHES)


def outcome_of(
    *lines: Any, driver: Any = Handle, clock: Clock | None = None, yes: bool = False
) -> tuple[str, CommandError | None]:
    """The screen of a person who types this, and the error at the end; force and device are off then."""
    screen, error = io.StringIO(), None
    dialog, keyboard = sitting(clock or Clock(), screen, *lines, yes=yes)
    try:
        try_master(driver, driver.Options(), driver, dialog)
    except CommandError as caught:
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
    at_rest: list[Vector] = []
    answer = (lambda: at_rest.append(forces()[-1]), "y")
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", "", answer, "", answer, "", answer)
    assert error is None
    assert screen.endswith(f"\n  signs_checked: {PRINT}\n")
    assert at_rest == [ZERO] * 3, "each push is over before the question"
    pushes = forces()
    assert max(map(norm, pushes)) <= PUSH_N <= 0.3
    assert all(sum(component != 0.0 for component in force) <= 1 for force in pushes)
    for axis in range(3):
        along = [force[axis] for force in pushes]
        assert (max(along), min(along)) == (pytest.approx(PUSH_N, rel=1e-3), 0.0)
        assert max(abs(b - a) for a, b in pairwise(along)) < 0.02


@pytest.mark.parametrize("signs_checked", [None, PRINT], ids=["unchecked", "checked before"])
def test_without_yes_no_force(signs_checked: str | None) -> None:
    screen = io.StringIO()
    dialog, _ = sitting(Clock(), screen, *OPEN, *SIGNS, "y")  # not the whole word
    try_master(Handle, HandleOptions(signs_checked=signs_checked), Handle, dialog)
    assert "signs_checked: " not in screen.getvalue()
    assert ([armed for kind, armed in Handle.log if kind == "open"], set(forces())) == ([False], {ZERO})


def varied(**attributes: object) -> Any:
    """A driver as `Handle`, with other attributes."""
    return type("Varied", (Handle,), attributes)


FLAT = varied(AXES="xy", FRAME={"x": "to the right", "y": "away from you"})
WEAK = varied(__init__=lambda self, options: Handle.__init__(self, HandleOptions()))


@pytest.mark.parametrize(
    ("driver", "lines", "yes", "passes"),
    [
        (Handle, (*OPEN, *SIGNS, "yes", "", "", "r", "", "maybe", "y", "", "y", "", "y"), False, True),
        (Handle, (*OPEN, *SIGNS, *PUSHES[1:]), True, True),
        (varied(COMPUTED=True), ("", *PUSHES[:1], *PUSHES[2:]), False, True),  # its signs are not checked
        (FLAT, (*OPEN, *SIGNS[:4], *PUSHES[:-2]), False, True),
        (WEAK, (*OPEN, *SIGNS), False, False),  # without force there is nothing to push
    ],
    ids=["repeated", "yes in advance", "computed", "flat", "weak"],
)
def test_dialog_follows_the_driver(driver: Any, lines: Sequence[Any], yes: bool, passes: bool) -> None:
    screen, error = outcome_of(*lines, driver=driver, yes=yes)
    assert error is None
    assert (f"  signs_checked: {PRINT}\n" in screen) is ("signs_checked: " in screen) is passes
    assert screen.count("Did it push") == len([line for line in lines if line in ("y", "r", "maybe")])


@pytest.mark.parametrize(
    ("wrong", "motor"), [("x", "the direction of its motor"), ("y", "the first of motor_directions")]
)
def test_wrong_force_fails_without_fingerprint(wrong: str, motor: str) -> None:
    answers = [each for axis in "xyz" for each in ("", "n" if axis == wrong else "y")]
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", *answers)
    assert f"reverse {wrong} ({motor}" in str(error)
    assert "signs_checked" not in screen


def test_loose_handle_is_not_pushed_away_and_not_again() -> None:
    clock, furthest, ended_at = Clock(), 0.0, 0

    def runs(_now: float) -> None:
        nonlocal furthest, ended_at
        if forces() and forces()[-1] != ZERO:
            Handle.hand = add(Handle.hand, scale(forces()[-1], 0.001 / norm(forces()[-1])))
            furthest = max(furthest, norm(Handle.hand))
        elif norm(Handle.hand) > GIVES_WAY_M:  # it springs back
            Handle.hand = ZERO
            ended_at = len(forces())

    clock.on_pause = runs
    pushes = [part for answer in "yyy" for part in (CENTRE, answer)]
    screen, error = outcome_of(*OPEN, *SIGNS, "yes", "", *pushes, clock=clock)
    assert (error, screen.count("The handle moved by"), furthest <= GIVES_WAY_M + 0.002) == (None, 3, True)
    assert set(forces()[ended_at:]) == {ZERO}, "it does not begin again"


@pytest.mark.parametrize(
    ("turn", "advice"),
    [
        (lambda p: (-p[0], p[1], p[2]), "reverse x (the second of directions)"),
        (lambda p: (p[0], -p[1], -p[2]), "reverse y (its direction), z (its direction)"),
        (lambda p: (p[1], p[0], p[2]), "(x comes out as y, y comes out as x)"),
    ],
    ids=["one reversed", "two reversed", "two exchanged"],
)
def test_wrong_sign_ends_before_any_force(turn: Callable[[Vector], Vector], advice: str) -> None:
    Handle.turn = staticmethod(turn)
    screen, error = outcome_of(*OPEN, *SIGNS)
    assert advice in str(error)
    assert ("signs_checked" in screen, set(forces())) == (False, {ZERO})


@pytest.mark.parametrize("unclear", [(0.01, 0.0, 0.0), (0.04, 0.04, 0.0)], ids=["small", "askew"])
def test_unclear_motion_is_asked_for_again_twice(unclear: Vector) -> None:
    assert outcome_of(*OPEN, *((CENTRE, moved(*unclear)) * 2), *SIGNS, *PUSHES)[1] is None
    _, error = outcome_of(*OPEN, *((CENTRE, moved(*unclear)) * 3))
    assert "along x" in str(error)


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
