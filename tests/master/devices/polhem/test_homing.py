"""Which encoder counts are plausible, and the calibration button."""

from collections.abc import Sequence
from math import inf, sin
from typing import Any

import pytest

from weberlink.geometry.vector import Vector, distance
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.polhem.homing import PositionValidator
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemSerialOptions
from weberlink.master.devices.polhem.protocol import Counts, Sensors
from weberlink.master.devices.polhem.serial_device import BracketExchange, zeroed
from weberlink.testing.stepping import VirtualTime

WOODY = PARAMETERS["woodenhaptics_2015"]
PHANTOM = PARAMETERS["vintage_phantom"]
HOME = (0, 0, 0, 0, 0, 0)
CENTER = (0.0, 0.0, 0.0)


def counts_at(position: Vector) -> Counts:
    return (*WOODY.counts_at(position), 0, 0, 0)


def begun(at: Vector = CENTER) -> PositionValidator:
    validator = PositionValidator(WOODY, HOME)
    validator.begin(counts_at(at), 0.0, 0.0)
    return validator


def test_a_fast_hand_is_followed_and_a_stalled_host_explains_a_long_way() -> None:
    validator = begun((-0.1, 0.0, 0.0))
    for tick, x in enumerate([*range(-100, 101, 2), *range(100, -1, -2)], 1):
        place = (x * 1e-3, 0.001 * sin(tick), 0.0)
        sample = validator.next(counts_at(place), tick * 1e-3, tick * 1e-3 + 2e-4)
        assert distance(sample.position, place) < 1e-4
    validator.next(counts_at(CENTER), 0.2, 0.301)  # read long after the device had measured
    assert validator.next(counts_at((0.1, 0.0, 0.0)), 0.3011, 0.3013).position[0] == pytest.approx(0.1, abs=1e-4)


def test_single_jump_is_a_bad_reply() -> None:
    validator = begun()
    with pytest.raises(BadReply, match="jumped by 20 mm"):
        validator.next(counts_at((0.02, 0.0, 0.0)), 0.001, 0.0012)
    assert validator.next(counts_at((0.001, 0.0, 0.0)), 0.002, 0.0022).position[0] == pytest.approx(0.001, abs=1e-4)


@pytest.mark.parametrize(
    ("counts", "asked", "answered"),
    [
        *((counts_at((jump, 0.0, 0.0)), 0.001, 0.0012) for jump in (0.008, 0.02, 0.2)),
        ((1, -2, 0, 0, 0, 0), 0.1, 0.2),  # counters that begin again are no motion, however long it takes
    ],
)
def test_lasting_jump_loses_home_for_good(counts: Counts, asked: float, answered: float) -> None:
    validator = begun()
    with pytest.raises(BadReply):
        validator.next(counts, asked, answered)
    with pytest.raises(HardwareFault, match="lost its home") as lost:
        validator.next(counts, answered, answered + 1e-3)
    assert not isinstance(lost.value, BadReply)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.begin(counts_at(CENTER), 1.0, 1.0)


def test_restarted_counters_after_silence_lose_home_unless_the_gimbal_proves_power() -> None:
    """A PHANTOM's home pose is in the middle of its workspace, where a hand may well have gone in a long silence."""
    with pytest.raises(HardwareFault, match="lost its home"):
        begun((0.025, 0.03, 0.205)).next((40, -20, 15, 0, 0, 0), 0.29, 0.3)
    kept, lost = PositionValidator(PHANTOM, HOME), PositionValidator(PHANTOM, HOME)
    for validator in (kept, lost):
        validator.begin((*PHANTOM.counts_at((0.03, 0.02, 0.0)), 120, -80, 44), 0.0, 0.0)
    kept.next((5, -9, 3, 118, -82, 45), 0.3, 0.3)
    with pytest.raises(HardwareFault, match="lost its home"):
        lost.next((5, -9, 3, 1, -2, 0), 0.3, 0.3)


@pytest.mark.parametrize(
    ("before", "counts", "says"),
    [
        ((0.025, 0.03, 0.205), HOME, "it came back 30 mm from where it was"),
        *((CENTER, counts, "lost its home") for counts in (HOME, (3, 1, -2, 0, 0, 0), (300, 100, -300, 0, 0, 0))),
        (CENTER, counts_at((0.08, 0.0, 0.0)), "lost its home"),
    ],
)
def test_return_elsewhere_loses_home_for_good(before: Vector, counts: Counts, says: str) -> None:
    validator = begun(before)
    with pytest.raises(HardwareFault, match=says):
        validator.begin(counts, 3.0, 3.0)
    with pytest.raises(HardwareFault, match="lost its home"):
        validator.begin(counts_at(before), 4.0, 4.0)


def test_return_nearby_goes_on_and_a_place_out_of_reach_is_not_homed() -> None:
    back = begun().begin(counts_at((0.045, 0.0, 0.0)), 3.0, 3.0)
    assert (back.position, back.buttons) == (pytest.approx((0.045, 0.0, 0.0), abs=1e-4), 0)
    with pytest.raises(HardwareFault, match=r"is not homed: it reports \(.*\) mm, more than 255 mm"):
        PositionValidator(WOODY, HOME).begin((0, 0, 16_000, 0, 0, 0), 0.0, 0.0)


def test_stuck_encoder_is_noticed() -> None:
    validator, stuck = begun(), counts_at(CENTER)[1]
    with pytest.raises(HardwareFault, match="motor B stands still"):
        for tick in range(1, 3000):
            a, _, c, *rest = counts_at((0.03 * sin(0.03 * tick), 0.01 * sin(0.05 * tick), 0.02 * sin(0.02 * tick)))
            validator.next((a, stuck, c, *rest), tick * 1e-3, tick * 1e-3)


@pytest.mark.parametrize(
    ("before", "now", "pressed"),
    [
        ((300, 2, -5), (8, -8, 8, 77, 77, 77), True),
        ((300, 2, -5), (9, 0, 0), False),
        ((40, 0, 0), (0, 0, 0), True),
        ((39, 0, 0), (0, 0, 0), False),  # a slow hand passes by
        ((0, 0, 0, 500, 0, 0), (0, 0, 0, 0, 0, 0), False),
    ],
)
def test_a_press_is_a_jump_to_zero(before: Counts, now: Counts, pressed: bool) -> None:
    assert zeroed(before, Sensors(now)) == pressed


class Looked(BracketExchange):
    """Answers come one by one, and then the last again and again; None is a bad reply. Each takes a time [s]."""

    def __init__(self, answers: Sequence[int | None], patience: float, takes: float) -> None:
        super().__init__(PolhemSerialOptions(home_patience_s=patience), 0.0, list, None)
        self._left, self._takes, time = [*answers], takes, VirtualTime()
        self._clock, self._pause = time.clock, time.pause

    def ask(self, message: Any, fresh_until: float = inf) -> Sensors:
        self._pause(self._takes)
        answer = self._left.pop(0) if len(self._left) > 1 else self._left[0]
        if answer is None:
            raise BadReply("does not answer")
        return Sensors((answer,))


def test_a_press_is_found_between_bad_replies_in_time() -> None:
    def presses(answers: Sequence[int | None], patience: float, takes: float = 0.0) -> None:
        Looked(answers, patience, takes)._await_press(lambda before, now: now.counts[0] > before[0] + 100)

    presses((5, None, 5, 6, 1000), 10.0)
    # Nobody presses it; and a stalled host has not seen how it got there.
    for answers, patience, takes in (((0,), 0.02, 0.0), ((0, 1000), 0.08, 0.05)):
        with pytest.raises(HardwareFault, match=rf"nobody pressed the calibration button in {patience} s"):
            presses(answers, patience, takes)
