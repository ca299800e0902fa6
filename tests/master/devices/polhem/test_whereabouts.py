"""What counts are believed, in time that the test makes."""

from math import sin

import pytest

from weberlink.geometry.vector import Vector, distance
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.devices.polhem.whereabouts import Whereabouts

WOODY = PARAMETERS["woodenhaptics_2015"]
HOME = (0, 0, 0, 0, 0, 0)


def counts_at(position: Vector) -> tuple[int, ...]:
    return (*WOODY.mechanism.counts_at(position), 0, 0, 0)


def begun(at: Vector = (0.0, 0.0, 0.0)) -> Whereabouts:
    whereabouts = Whereabouts(WOODY, HOME)
    whereabouts.begin(counts_at(at), 0.0, 0.0)
    return whereabouts


def follow(whereabouts: Whereabouts, x: float, tick: int) -> DeviceReading:
    return whereabouts.next(counts_at((x, 0.001 * sin(tick), 0.0)), tick * 1e-3, tick * 1e-3 + 2e-4)


def test_a_hand_is_followed_at_two_metres_a_second_and_back() -> None:
    whereabouts = begun((-0.1, 0.0, 0.0))
    ways = [*range(-100, 101, 2), *range(100, -101, -2)]
    for tick, x in enumerate(ways, 1):
        sample = follow(whereabouts, x * 1e-3, tick)
        assert distance(sample.position, (x * 1e-3, 0.001 * sin(tick), 0.0)) < 1e-4


def test_counts_are_relative_to_the_home_pose() -> None:
    whereabouts = Whereabouts(WOODY, HOME)
    whereabouts.home((100, -50, 7, 0, 0, 0))
    assert whereabouts.begin((100, -50, 7, 0, 0, 0), 0.0, 0.0).position == pytest.approx((0.025, 0.0, 0.205))
    assert whereabouts.relative((101, -49, 8, 0, 0, 0)) == (1, 1, 1, 0, 0, 0)


def test_far_out_is_not_homed() -> None:
    with pytest.raises(HardwareFault, match=r"is not homed.*beyond 255 mm"):
        Whereabouts(WOODY, HOME).begin((16_000, 0, 0, 0, 0, 0), 0.0, 0.0)


def test_one_jump_is_a_bad_reply_and_is_forgotten() -> None:
    whereabouts = begun()
    with pytest.raises(BadReply, match="jumped by 20 mm"):
        whereabouts.next(counts_at((0.02, 0.0, 0.0)), 0.001, 0.0012)
    assert whereabouts.next(counts_at((0.001, 0.0, 0.0)), 0.002, 0.0022).position[0] == pytest.approx(0.001, abs=1e-4)


@pytest.mark.parametrize("jump", [0.008, 0.02, 0.2])
def test_a_jump_that_stays_is_a_lost_home_for_good(jump: float) -> None:
    whereabouts = begun()
    with pytest.raises(BadReply):
        whereabouts.next(counts_at((jump, 0.0, 0.0)), 0.001, 0.0012)
    with pytest.raises(HardwareFault, match="lost its home") as lost:
        whereabouts.next(counts_at((jump, 0.0, 0.0)), 0.002, 0.0022)
    assert not isinstance(lost.value, BadReply)
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.begin(counts_at((0.0, 0.0, 0.0)), 1.0, 1.0)


def test_a_long_pause_between_two_answers_explains_a_long_way() -> None:
    """A host that stood still for 0.1 s, after the device had measured and before the answer was read."""
    whereabouts = begun()
    whereabouts.next(counts_at((0.0, 0.0, 0.0)), 0.001, 0.101)
    sample = whereabouts.next(counts_at((0.1, 0.0, 0.0)), 0.1011, 0.1013)
    assert sample.position[0] == pytest.approx(0.1, abs=1e-4)


def test_a_late_answer_explains_a_long_way_too() -> None:
    whereabouts = begun()
    sample = whereabouts.next(counts_at((0.1, 0.0, 0.0)), 0.001, 0.101)
    assert sample.position[0] == pytest.approx(0.1, abs=1e-4)


def test_counters_that_begin_again_are_no_motion() -> None:
    whereabouts = begun()
    with pytest.raises(BadReply):
        whereabouts.next((1, -2, 0, 0, 0, 0), 0.1, 0.2)
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.next((1, -2, 0, 0, 0, 0), 0.2, 0.201)


def test_after_a_silence_counters_that_begin_again_are_no_motion_though_they_have_moved_on() -> None:
    whereabouts = begun((0.025, 0.03, 0.205))
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.next((40, -20, 15, 0, 0, 0), 0.29, 0.3)


def test_a_gimbal_that_has_kept_its_counts_was_not_without_power() -> None:
    """A PHANTOM's home pose is in the middle of its workspace, where a hand may well have gone in a long silence."""
    phantom = PARAMETERS["vintage_phantom"]
    before = phantom.mechanism.counts_at((0.03, 0.02, 0.0))
    whereabouts = Whereabouts(phantom, HOME)
    whereabouts.begin((*before, 120, -80, 44), 0.0, 0.0)
    whereabouts.next((5, -9, 3, 118, -82, 45), 0.3, 0.3)
    whereabouts = Whereabouts(phantom, HOME)
    whereabouts.begin((*before, 120, -80, 44), 0.0, 0.0)
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.next((5, -9, 3, 1, -2, 0), 0.3, 0.3)


def test_through_the_home_pose_is_a_motion() -> None:
    whereabouts = begun((0.025, -0.02, 0.205))
    for tick in range(1, 40):
        y = -0.02 + tick * 1e-3
        whereabouts.next(counts_at((0.025, y, 0.205)), tick * 1e-3, tick * 1e-3 + 2e-4)


def test_back_where_it_was_is_believed() -> None:
    whereabouts = begun()
    sample = whereabouts.begin(counts_at((0.01, 0.0, 0.0)), 3.0, 3.0)
    assert sample.position[0] == pytest.approx(0.01, abs=1e-4)


def test_back_at_zero_is_a_lost_home_even_where_a_hand_could_have_gone_there() -> None:
    whereabouts = begun((0.025, 0.03, 0.205))
    with pytest.raises(HardwareFault, match="it came back 30 mm from where it was"):
        whereabouts.begin(HOME, 3.0, 3.0)


def test_near_the_home_pose_a_return_is_believed_wherever_it_is() -> None:
    """Counters that began again would be wrong by less than a hand goes in the meantime."""
    whereabouts = begun((0.025, 0.004, 0.205))
    assert whereabouts.begin(HOME, 3.0, 3.0).position == pytest.approx((0.025, 0.0, 0.205))


@pytest.mark.parametrize("counts", [HOME, (3, 1, -2, 0, 0, 0), (300, 100, -300, 0, 0, 0), counts_at((0.08, 0.0, 0.0))])
def test_back_elsewhere_is_a_lost_home_and_moving_on_does_not_find_it(counts: tuple[int, ...]) -> None:
    whereabouts = begun()
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.begin(counts, 3.0, 3.0)
    with pytest.raises(HardwareFault, match="lost its home"):
        whereabouts.begin(counts_at((0.0, 0.0, 0.0)), 4.0, 4.0)


def test_an_encoder_that_stands_still_while_the_hand_goes_on_is_noticed() -> None:
    whereabouts = begun()
    stuck = counts_at((0.0, 0.0, 0.0))[1]
    with pytest.raises(HardwareFault, match="motor B stands still"):
        for tick in range(1, 3000):
            a, _, c, *rest = counts_at((0.03 * sin(0.03 * tick), 0.01 * sin(0.05 * tick), 0.02 * sin(0.02 * tick)))
            whereabouts.next((a, stuck, c, *rest), tick * 1e-3, tick * 1e-3)


def test_a_handle_at_rest_is_no_stuck_encoder() -> None:
    whereabouts = begun()
    for tick in range(1, 2000):
        whereabouts.next(counts_at((0.0, 0.0, 0.0)), tick * 1e-3, tick * 1e-3)
