"""The driver `touch` on the fake library: limits, what the library complains of, and two devices."""

import os
import signal
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from math import inf, nan
from pathlib import Path
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, strategies as st

from plugins.devices.tests.touch.fake_hd import Board, library, plugged
from tests.test_child_process import executed  # noqa: F401
from tests.wait import until
from weberlink.geometry.rotation import Quaternion, turned, unit_quaternion
from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.hardware_device import RAMP_S
from weberlink.testing.devices import armed, drive, fault_of
from weberlink.testing.time import ahead_of_other_work
from weberlink_devices.touch import hdapi
from weberlink_devices.touch.device import pose
from weberlink_devices.touch.exchange import BEFORE_FIRST, MEMORY_SIZE, Phase, ServoMemory
from weberlink_devices.touch.hdapi import HdError
from weberlink_devices.touch.process import ServoProcess
from weberlink_devices.touch.servo import ERRORS_MOST, LONGEST_S, ServoLoop, ServoOrder

TICK = 0.001
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@contextmanager
def opened(**options: Any) -> Iterator[Any]:
    touch: Any = armed("touch", **{"library": str(library()), "calibration_s": 0.2, **options})
    with closing(touch):
        with ahead_of_other_work():  # a servo process that waits for a processor is silent
            touch.open(monotonic())
        yield touch


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    with plugged(tmp_path) as (board,):
        yield board


def ours(vector: Vector) -> Vector:
    """From x right, y up, z toward the operator to x toward the operator, y right, z up."""
    x, y, z = vector
    return (z, x, y)


@pytest.mark.parametrize(("characters", "kept"), [(998, 998), (999, 899)])
def test_a_report_is_heard_once_and_cut_only_where_it_does_not_fit(characters: int, kept: int) -> None:
    """1000 bytes of JSON, of which two are the quotation marks."""
    memory = ServoMemory(bytearray(MEMORY_SIZE))
    memory.say(Phase.FAILED, "x" * characters)
    assert memory.heard() == (Phase.FAILED, "x" * kept)
    assert memory.heard() is None


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(a * a for a in q) > 0.01))
def test_orientation_turns_handle_axes_as_transform_does(parts: Quaternion) -> None:
    unit = unit_quaternion(parts)
    assert unit is not None
    axes = (turned(unit, X), turned(unit, Y), turned(unit, Z))
    found = pose(BEFORE_FIRST._replace(axes=axes))
    assert found is not None
    for axis, to in zip((X, Y, Z), axes, strict=True):
        assert turned(found[1], ours(axis)) == pytest.approx(ours(to), abs=1e-9)
    for wrong in ({"position": (inf, 0.0, 0.0), "axes": axes}, {"axes": (X, X, X)}, {"axes": ((nan, 0.0, 0.0),) * 3}):
        assert pose(BEFORE_FIRST._replace(**wrong)) is None


def test_frames_without_valid_pose_repeat_the_last_reading(board: Board) -> None:
    with opened() as touch:
        reading = touch.latest(monotonic())
        board.rotation[0] = 0.5
        drive(touch, lambda: touch.trouble is not None, (0.0, 0.0, 0.0))
        last = touch.latest(monotonic())
        sleep(0.01)
        assert touch.latest(monotonic()).at == last.at >= reading.at
        assert touch.trouble == "the library gives a transform that cannot be"


def test_limit_of_the_device_holds_where_lower(board: Board) -> None:
    board.max_force = 1.0
    with opened(force_n=3.0) as touch:
        drive(touch, lambda: board.displayed == pytest.approx(1.0), (0.0, 0.0, 3.0))
        assert max(force for _, force in board.forces) <= 1.0 + 1e-9


NEEDS_HAND = {"calibration": hdapi.CALIBRATION_NEEDS_HAND}


@pytest.mark.parametrize(
    ("wrong", "options", "says"),
    [
        ({"unlicensed": 1}, {}, "HD_INVALID_LICENSE (0x0600, internal -28); the licence of OpenHaptics is missing"),
        ({"unplugged": 1}, {}, "HD_COMM_ERROR (0x0302, internal -28); check its cable"),
        ({"jammed": 1}, {}, "HD_COMM_CONFIG_ERROR (0x0303, internal -28); a program that was killed"),
        (NEEDS_HAND | {"style": hdapi.INKWELL_STYLE}, {}, "put the stylus into its inkwell"),
        (NEEDS_HAND | {"style": hdapi.AUTO_STYLE}, {}, "move the handle about"),
        ({}, {"name": "middle"}, "middle cannot be initialized: HD_COMM_ERROR"),
        ({}, {"reach_m": 0.2}, "reaches 0.21 m"),
        ({"max_force": 0.0}, {}, "its largest force is 0 N"),
        ({}, {"library": "libno-such-HD.so"}, "install OpenHaptics"),
        ({}, {"library": "libc.so.6"}, "has no hdInitDevice"),
    ],
)
def test_unusable_device_is_a_fault_with_advice(
    board: Board, wrong: dict[str, Any], options: dict[str, Any], says: str
) -> None:
    for name, value in wrong.items():
        setattr(board, name, value)
    with pytest.raises(DeviceFault) as caught, opened(**options):
        pass
    assert str(caught.value).startswith("touch: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert (board.owner, board.displayed) == (0, 0.0)


@pytest.mark.parametrize("jams", [0, 1])
def test_force_that_a_dead_servo_process_left_is_taken_off_or_told(board: Board, jams: int) -> None:
    """The device of a killed program may refuse the next one, as users report; where it does not, the force ends."""
    with opened() as touch:
        drive(touch, lambda: board.displayed > 1.9, (0.0, 0.0, 2.0))
        board.jams = jams
        os.kill(touch.servo_pid, signal.SIGKILL)
        assert fault_of(touch, (0.0, 0.0, 2.0)) == "touch: its servo process was killed by SIGKILL"
        touch.close()
        assert board.displayed == pytest.approx(2.0 * jams, rel=0.05)
        assert ("died with a force on the hand: switch the device off" in str(touch.trouble)) == bool(jams)


def test_force_error_is_told_and_ramps_again(board: Board) -> None:
    with opened() as touch:
        drive(touch, lambda: board.displayed > 1.99, (0.0, 0.0, 2.0))
        seen = board.logged
        board.error, board.errors_left = 0x0200, ERRORS_MOST - 10
        drive(touch, lambda: touch.trouble is not None, (0.0, 0.0, 2.0))
        assert "HD_WARM_MOTORS" in str(touch.trouble)
        drive(touch, lambda: touch.trouble is None and board.displayed > 1.99, (0.0, 0.0, 2.0))
        assert min(force for _, force in board.forces[seen:]) <= 2.0 * LONGEST_S / RAMP_S * 1.01


class Library(SimpleNamespace):
    """In place of the maker's, and what it is told before a frame ends; a broken one raises while a frame is open."""

    def __init__(self, *, broken: bool) -> None:
        def get(name: int, values: Any) -> None:
            if broken:
                raise ArithmeticError("lost")

        super().__init__(force=[], ended=0, hdGetDoublev=get)
        self.hdBeginFrame = self.hdCheckCalibration = self.hdGetIntegerv = lambda *_: 0
        self.hdGetError = lambda: HdError(0, 0)
        self.hdSetDoublev = lambda _, values: setattr(self, "force", list(values))
        self.hdEndFrame = lambda _: setattr(self, "ended", self.ended + 1)


def test_a_loop_that_stood_still_starts_from_zero_with_a_command_as_fresh_as_any() -> None:
    """The daemon may have stood still with it: its first command is a new one."""
    library: Any = Library(broken=False)
    memory = ServoMemory(bytearray(MEMORY_SIZE))
    loop = ServoLoop(library, 0, memory, 0.05, RAMP_S)
    loop.rests = False

    def frame() -> float:
        memory.force.write(monotonic(), 2.0, 0.0, 0.0, 0)
        loop.frame()
        return library.force[0]

    until(lambda: frame() == 2.0, "the force", pause=TICK)
    sleep(0.06)
    forces = [frame() for _ in range(20)]
    assert forces[0] == 0.0
    assert max(b - a for a, b in pairwise(forces)) <= 2.0 * LONGEST_S / RAMP_S * (1 + 1e-9)
    assert forces[-1] > 0.0


def test_error_in_the_callback_sends_zero_and_goes_on() -> None:
    broken: Any = Library(broken=True)
    memory = ServoMemory(bytearray(MEMORY_SIZE))
    loop = ServoLoop(broken, 0, memory, 0.01, RAMP_S)
    loop.rests = False
    memory.force.write(monotonic(), 1.0, 0.0, 0.0, 0)
    assert loop.frame() == hdapi.CONTINUE
    assert (broken.force, broken.ended) == ([0.0, 0.0, 0.0], 1)
    assert loop.fault == "internal error: ArithmeticError('lost')"
    assert (memory.newest_state() or BEFORE_FIRST).frames == 0


def test_servo_imports_nothing_from_the_working_directory(executed: Path) -> None:  # noqa: F811 - the fixture
    arguments = ServoOrder("libnowhere.so", None, force=False, stale_s=0.01, ramp_s=0.1, calibration_s=1.0)
    process = ServoProcess(arguments)
    with pytest.raises(HardwareFault, match=r"libnowhere\.so"):
        process.start()
