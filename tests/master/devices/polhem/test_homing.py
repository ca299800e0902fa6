"""Which encoder counts are plausible, and the calibration button."""

from math import sin
from time import sleep

import pytest

from weberlink.geometry.vector import Vector, distance
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.homing import PositionValidator, await_press, zeroed
from weberlink.master.devices.polhem.parameters import PARAMETERS

WOODY = PARAMETERS["woodenhaptics_2015"]
HOME = (0, 0, 0, 0, 0, 0)


def counts_at(position: Vector) -> tuple[int, ...]:
    return (*WOODY.mechanism.counts_at(position), 0, 0, 0)


def begun(at: Vector = (0.0, 0.0, 0.0)) -> PositionValidator:
    validator = PositionValidator(WOODY, HOME)
    validator.begin(counts_at(at), 0.0, 0.0)
    return validator


def follow(validator: PositionValidator, x: float, tick: int) -> DeviceReading:
    return validator.next(counts_at((x, 0.001 * sin(tick), 0.0)), tick * 1e-3, tick * 1e-3 + 2e-4)


def test_fast_hand_is_followed() -> None:
    validator = begun((-0.1, 0.0, 0.0))
    ways = [*range(-100, 101, 2), *range(100, -101, -2)]
    for tick, x in enumerate(ways, 1):
        sample = follow(validator, x * 1e-3, tick)
        assert distance(sample.position, (x * 1e-3, 0.001 * sin(tick), 0.0)) < 1e-4


def test_single_jump_is_a_bad_reply() -> None:
    validator = begun()
    with pytest.raises(BadReply, match="jumped by 20 mm"):
        validator.next(counts_at((0.02, 0.0, 0.0)), 0.001, 0.0012)
    assert validator.next(counts_at((0.001, 0.0, 0.0)), 0.002, 0.0022).position[0] == pytest.approx(0.001, abs=1e-4)


@pytest.mark.parametrize("jump", [0.008, 0.02, 0.2])
def test_lasting_jump_loses_home_for_good(jump: float) -> None:
    validator = begun()
    with pytest.raises(BadReply):
        validator.next(counts_at((jump, 0.0, 0.0)), 0.001, 0.0012)
    with pytest.raises(HardwareFault, match="lost its home") as lost:
        validator.next(counts_at((jump, 0.0, 0.0)), 0.002, 0.0022)
    assert not isinstance(lost.value, BadReply)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.begin(counts_at((0.0, 0.0, 0.0)), 1.0, 1.0)


def test_long_pause_explains_long_way() -> None:
    """A host that stood still for 0.1 s, after the device had measured and before the answer was read."""
    validator = begun()
    validator.next(counts_at((0.0, 0.0, 0.0)), 0.001, 0.101)
    sample = validator.next(counts_at((0.1, 0.0, 0.0)), 0.1011, 0.1013)
    assert sample.position[0] == pytest.approx(0.1, abs=1e-4)


def test_counters_that_begin_again_are_no_motion() -> None:
    validator = begun()
    with pytest.raises(BadReply):
        validator.next((1, -2, 0, 0, 0, 0), 0.1, 0.2)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.next((1, -2, 0, 0, 0, 0), 0.2, 0.201)


def test_restarted_counters_after_silence_lose_home() -> None:
    validator = begun((0.025, 0.03, 0.205))
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.next((40, -20, 15, 0, 0, 0), 0.29, 0.3)


def test_kept_gimbal_counts_prove_power() -> None:
    """A PHANTOM's home pose is in the middle of its workspace, where a hand may well have gone in a long silence."""
    phantom = PARAMETERS["vintage_phantom"]
    before = phantom.mechanism.counts_at((0.03, 0.02, 0.0))
    validator = PositionValidator(phantom, HOME)
    validator.begin((*before, 120, -80, 44), 0.0, 0.0)
    validator.next((5, -9, 3, 118, -82, 45), 0.3, 0.3)
    validator = PositionValidator(phantom, HOME)
    validator.begin((*before, 120, -80, 44), 0.0, 0.0)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.next((5, -9, 3, 1, -2, 0), 0.3, 0.3)


def test_return_at_zero_counts_loses_home() -> None:
    validator = begun((0.025, 0.03, 0.205))
    with pytest.raises(HardwareFault, match="it came back 30 mm from where it was"):
        validator.begin(HOME, 3.0, 3.0)


@pytest.mark.parametrize("counts", [HOME, (3, 1, -2, 0, 0, 0), (300, 100, -300, 0, 0, 0), counts_at((0.08, 0.0, 0.0))])
def test_return_elsewhere_loses_home_for_good(counts: tuple[int, ...]) -> None:
    validator = begun()
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.begin(counts, 3.0, 3.0)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.begin(counts_at((0.0, 0.0, 0.0)), 4.0, 4.0)


def test_stuck_encoder_is_noticed() -> None:
    validator = begun()
    stuck = counts_at((0.0, 0.0, 0.0))[1]
    with pytest.raises(HardwareFault, match="motor B stands still"):
        for tick in range(1, 3000):
            a, _, c, *rest = counts_at((0.03 * sin(0.03 * tick), 0.01 * sin(0.05 * tick), 0.02 * sin(0.02 * tick)))
            validator.next((a, stuck, c, *rest), tick * 1e-3, tick * 1e-3)


@pytest.mark.parametrize(
    ("before", "now", "pressed"),
    [
        ((300, 2, -5), (0, 0, 1), True),
        ((300, 2, -5), (8, -8, 8, 77, 77, 77), True),
        ((300, 2, -5), (290, 0, 0), False),
        ((300, 2, -5), (9, 0, 0), False),
        ((39, 0, 0), (0, 0, 0), False),  # a slow hand passes by
        ((0, 0, 0), (0, 0, 0), False),
        ((0, 0, 0, 500, 0, 0), (0, 0, 0, 0, 0, 0), False),
    ],
)
def test_a_press_is_a_jump_to_zero(before: tuple[int, ...], now: tuple[int, ...], pressed: bool) -> None:
    assert zeroed(before, now) == pressed


def test_button_press_is_found_between_bad_replies() -> None:
    looks = iter([5, None, 5, 6, 1000])

    def look() -> int:
        number = next(looks)
        if number is None:
            raise BadReply("does not answer")
        return number

    assert await_press(look, lambda before, now: now > before + 100, 10.0) == 1000


def test_a_patience_has_an_end() -> None:
    with pytest.raises(HardwareFault, match=r"nobody pressed the calibration button in 0\.02 s"):
        await_press(lambda: 0, lambda before, now: False, 0.02)


def test_looks_that_are_far_apart_are_no_press() -> None:
    """A host that stalled has not seen how the handle got home."""
    looks = iter([1000, 0])

    def slowly() -> int:
        sleep(0.05)
        return next(looks)

    with pytest.raises(HardwareFault, match="nobody pressed"):
        await_press(slowly, lambda before, now: now == 0, 0.08)
