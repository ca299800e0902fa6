"""The pointer device in virtual time: the contract of a driver, and how its hand follows a target and lets go."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import sin
from pathlib import Path
from typing import Any

import pytest

from plugins.pointer.tests.targets import Targets, Way
from weberlink.geometry.rotation import IDENTITY, vector
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.testing.devices import DeviceBench, DeviceContract
from weberlink.testing.time import TICK, virtual_time
from weberlink_pointer.device import PointerDevice, PointerIntention, PointerOptions
from weberlink_pointer.target_link import PointerTarget

HOME: Vector = (0.0, 0.0, 0.03)
LEFT, RIGHT = (-0.05, 0.0, 0.03), (0.05, 0.0, 0.03)


class TestPointer(DeviceContract):
    NAME = "pointer"

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        swing = Targets(lambda time: ((0.05 * sin(3.0 * time), 0.0, 0.02), True))
        yield DeviceBench(PointerDevice(PointerOptions(**options), TICK, swing), virtual_time())


def readings(
    path: Way, seconds: float, force: Vector = ZERO, rate_hz: float = 60.0, **options: object
) -> list[DeviceReading]:
    device = PointerDevice(PointerOptions.model_validate(options), TICK, Targets(path, rate_hz))
    device.open(10.0)
    device.command(force, 10.0)
    return [device.latest(10.0 + (tick + 1) * TICK) for tick in range(round(seconds / TICK))]


def speeds(positions: list[Vector]) -> list[float]:
    return [distance(a, b) / TICK for a, b in pairwise(positions)]


@pytest.mark.parametrize(
    ("rate_hz", "target", "force", "rests_at"),
    [
        (30.0, LEFT, ZERO, LEFT),
        (125.0, LEFT, ZERO, LEFT),
        (60.0, LEFT, (0.0, 0.0, 3.0), (LEFT[0], 0.0, LEFT[2] + 3.0 / 150.0)),
        (60.0, (1e300, -1.0, 0.07), ZERO, (0.06, -0.06, 0.06)),
    ],
)
def test_handle_comes_to_rest_at_the_target_and_yields_to_the_force(
    rate_hz: float, target: Vector, force: Vector, rests_at: Vector
) -> None:
    last = readings(lambda _: (target, True), 1.5, force, rate_hz)[-1]
    assert last.position == pytest.approx(rests_at, abs=1e-5)
    assert (last.buttons, last.ended) == (1, False)


def test_jumping_target_moves_the_handle_at_bounded_speed() -> None:
    seen = readings(lambda time: (LEFT if time % 0.8 < 0.4 else RIGHT, True), 3.0)
    fastest = max(speeds([reading.position for reading in seen]))
    assert 0.4 < fastest <= 0.5 * (1 + 1e-9)
    assert max(reading.position[0] for reading in seen) == pytest.approx(RIGHT[0], abs=1e-3)


def test_the_hand_means_to_be_no_farther_from_the_handle_than_its_reach() -> None:
    intention = PointerIntention(PointerOptions(reach_m=0.04))
    for _ in range(1000):
        intention.follow(LEFT, RIGHT, TICK)
        assert distance(intention.position, RIGHT) <= 0.04 * (1 + 1e-9)
    assert intention.position == pytest.approx((RIGHT[0] - 0.04, 0.0, RIGHT[2]), abs=1e-6)


def test_release_clears_the_button_stops_the_hand_and_lets_go_of_its_pull() -> None:
    seen = readings(lambda time: (LEFT, time < 0.105), 1.0)
    released = next(i for i, reading in enumerate(seen) if i > 50 and not reading.buttons)
    assert 0.105 <= released * TICK <= 0.105 + 1 / 60 + TICK
    assert speeds([reading.position for reading in seen[released - 2 : released]])[0] > 0.2, "it was on its way"
    assert distance(seen[released].position, seen[-1].position) < 0.02
    assert speeds([reading.position for reading in seen[-100:]])[0] < 1e-4
    assert not any(reading.buttons for reading in seen[released:])
    # A force that held the handle 20 mm from the target moves it on, when nothing pulls any more, by 20 mm.
    pressed = readings(lambda time: (LEFT, time < 1.0), 2.0, force=(0.0, 0.0, -3.0))
    assert pressed[999].position[2] - pressed[-1].position[2] == pytest.approx(0.02, abs=1e-4)


@pytest.mark.parametrize("silence_ms", [100.0, 300.0])
def test_silent_pointer_has_let_go_in_time(silence_ms: float) -> None:
    seen = readings(lambda time: (LEFT, True) if time < 0.5 else None, 1.0, silence_ms=silence_ms)
    silent = next(i for i, reading in enumerate(seen) if i > 50 and not reading.buttons)
    assert silence_ms * 1e-3 + 0.5 - 1 / 60 <= silent * TICK <= silence_ms * 1e-3 + 0.5 + TICK


def test_wrist_follows_turned_targets_at_bounded_speed() -> None:
    targets = Targets(lambda _: (HOME, True))
    newest = targets.newest

    def with_rotation() -> PointerTarget | None:
        arrived, time = newest(), targets.time
        turn = ZERO if time < 0.5 else (0.0, 0.0, 2.0) if time < 1.5 else (1.0, 0.0, 0.0)
        return None if arrived is None else arrived._replace(rotation=turn)

    targets.newest = with_rotation  # type: ignore[method-assign]
    device = PointerDevice(PointerOptions.model_validate({"wrist": {"tremor_rad": 0.0}}), TICK, targets)
    device.open(10.0)
    seen = [vector(device.latest(10.0 + (tick + 1) * TICK).orientation or IDENTITY) for tick in range(3000)]
    assert seen[400] == ZERO
    assert seen[1499] == pytest.approx((0.0, 0.0, 2.0), abs=1e-3)
    assert seen[-1] == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)
    half = next(tick for tick, rotation in enumerate(seen) if rotation[2] > 1.0)
    assert 0.5 + 1.0 / 3.0 <= half * TICK < 0.5 + 1.0 / 3.0 + 0.1, "3 rad/s, and the lag of filter and wrist"


@pytest.mark.parametrize("sent", [None, (LEFT, False)])
def test_nothing_moves_before_the_first_target_that_is_held(sent: tuple[Vector, bool] | None) -> None:
    assert {(reading.position, reading.buttons) for reading in readings(lambda _: sent, 0.5)} == {(HOME, 0)}


def test_script_moves_the_hand_until_it_is_held() -> None:
    operator = OperatorDevice(OperatorOptions(hand=PointerOptions().hand, tremor_m=0.0), TICK)
    operator.open(10.0)
    seen = readings(lambda time: (LEFT, time < 2.5) if time > 2.0 else (RIGHT, False), 4.0, scripted=True)
    for tick, reading in enumerate(seen[:1999]):
        assert (reading.position, reading.buttons) == (operator.latest(10.0 + (tick + 1) * TICK).position, 1)
    taken = [reading.position for reading in seen[1950:2450]]
    assert max(speeds(taken)) <= 0.5 * (1 + 1e-9)
    assert distance(taken[-1], LEFT) < 1e-3
    assert not any(reading.buttons for reading in seen[2550:]), "and never again"
    assert abs(seen[-1].position[0] - LEFT[0]) < 1e-3


def test_pointer_without_a_socket_is_a_fault() -> None:
    class Broken(Targets):
        def open(self) -> None:
            raise OSError(28, "No space left on device")

    device = PointerDevice(PointerOptions(), TICK, Broken(lambda _: None))
    with pytest.raises(DeviceFault, match="pointer: its socket cannot be opened: No space left on device"):
        device.open(0.0)
