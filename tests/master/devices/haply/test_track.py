"""Which angles are believed."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.haply.exchange import FASTEST, STUCK_TRAVEL, AngleValidator
from weberlink.master.devices.haply.linkage import VERSIONS, Pair, radians

V3 = VERSIONS["v3"]
HOME = radians(V3.board.home_deg)
COUNT = 2.0 * pi / 4880.0
UP = radians((120.0, 60.0))


class Prompt(AngleValidator):
    """Every answer comes at once."""

    def at(self, angles: Pair, now: float) -> Pair:
        return self.follow(angles, now, now)


def track() -> Prompt:
    return Prompt(V3.bar, HOME, (COUNT, COUNT))


def test_a_hand_is_followed() -> None:
    following = track()
    for i in range(1000):
        angles = (HOME[0] - i * 0.0008, HOME[1] + i * 0.0008)
        assert following.at(angles, i * 0.001) == V3.bar.tip(angles)


def test_a_jump_is_not_and_what_came_before_still_counts() -> None:
    following = track()
    following.at(UP, 10.0)
    with pytest.raises(BadReply, match=r"arm 2 jumped by 0\.20 rad within 1\.0 ms"):
        following.at((UP[0], UP[1] + 0.2), 10.001)
    following.at((UP[0], UP[1] + 0.01), 10.002)
    following.at((UP[0], UP[1] + 0.01 + 0.9 * FASTEST * 0.01), 10.012)  # it may have moved while nothing came


def test_a_host_that_stalled_before_it_read_an_answer_does_not_take_the_next_for_a_jump() -> None:
    """The first was measured long before it was read, so the arm had time to turn."""
    following = track()
    following.follow(UP, 10.0, 10.1)
    following.follow((UP[0] + 0.5, UP[1]), 10.1, 10.1003)
    with pytest.raises(BadReply, match="jumped"):
        following.follow((UP[0] + 1.0, UP[1]), 10.1003, 10.1006)


def test_a_single_count_is_never_a_jump_and_time_that_stands_still_is_allowed() -> None:
    following = track()
    following.at(UP, 10.0)
    following.at((UP[0] + COUNT, UP[1] - COUNT), 10.0)
    following.at(UP, 9.0)


@pytest.mark.parametrize(
    ("angles", "complaint"),
    [
        ((HOME[0] + 3.6, HOME[1]), "arm 1 .*range"),
        ((HOME[0], HOME[1] - 3.6), "arm 2 .*range"),
        ((UP[0], HOME[1] + 3.6), "arm 2 .*range"),
        ((float("nan"), 0.0), "elbows are nan mm apart"),
        ((0.0, float("inf")), "arm 2 .*range"),
    ],
)
def test_postures_that_cannot_be_are_bad_replies(angles: Pair, complaint: str) -> None:
    with pytest.raises(BadReply, match=complaint):
        track().at(angles, 0.0)


@examples(50)
@given(
    steps=st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True, width=32),
            st.floats(allow_nan=True, allow_infinity=True, width=32),
            st.floats(0.0, 0.1),
        ),
        max_size=8,
    )
)
def test_whatever_comes_the_tip_is_a_tip_or_there_is_a_complaint(steps: list[tuple[float, float, float]]) -> None:
    following, now = track(), 0.0
    for first, second, elapsed in steps:
        now += elapsed
        try:
            x, y = following.at((first, second), now)
        except HardwareFault:
            continue
        assert abs(x) < 0.2
        assert abs(y) < 0.2


@pytest.mark.parametrize("stuck", [0, 1])
def test_an_encoder_that_stands_still_while_the_other_arm_turns_is_a_fault(stuck: int) -> None:
    following = track()
    following.at(UP, 0.0)
    travel, angles = 0.0, list(UP)
    with pytest.raises(HardwareFault, match=f"encoder {stuck + 1} stands still") as fault:
        for i in range(1, 1000):
            step = 0.004 if i // 100 % 2 == 0 else -0.004
            angles[1 - stuck] += step
            travel += abs(step)
            following.at((angles[0], angles[1]), i * 0.001)
    assert not isinstance(fault.value, BadReply)
    assert travel == pytest.approx(STUCK_TRAVEL, abs=0.01)
    # A single count of the other is a sign of life, and none of before counts any more.
    angles[stuck] += COUNT
    following.at((angles[0], angles[1]), 2.0)


def test_a_hand_at_rest_is_no_fault() -> None:
    following = track()
    for i in range(5000):
        following.at(UP, i * 0.001)
