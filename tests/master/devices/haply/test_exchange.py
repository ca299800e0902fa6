"""Which answer belongs to which question, which angles are plausible, and how a session begins."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi
from time import sleep

import pytest

from tests.master.devices.haply.far_end import BOARD, ZERO, Far, answer, at, counts
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.haply.board import RESET, Pair
from weberlink.master.devices.haply.exchange import (
    FASTEST,
    STUCK_TRAVEL,
    AngleValidator,
    Forgotten,
    HaplyExchange,
    HaplyLine,
)
from weberlink.master.devices.haply.linkage import VERSIONS, HaplyFrame, radians
from weberlink.master.devices.haply.options import HaplyOptions

V3 = VERSIONS["v3"]
HOME = at(*BOARD.home_deg)
PATIENT = HaplyOptions(reply_ms=100.0)


@pytest.fixture
def far() -> Iterator[Far]:
    there = Far()
    yield there
    there.stop()


@pytest.fixture
def exchange(far: Far) -> Iterator[HaplyExchange]:
    made = HaplyExchange(lambda: far.path, V3, PATIENT)
    yield made
    far.rest = lambda: far.say(HOME)
    made.close()


def test_known_board_keeps_its_setup(far: Far, exchange: HaplyExchange) -> None:
    far.deeds = [lambda: far.say(at(160.0, 20.0))]
    reading = exchange.open()
    x, y = HaplyFrame(V3.center).tip(reading.position)
    assert V3.bar.angles((x, y)) == pytest.approx((2.7925, 0.3491), abs=1e-3)
    assert far.messages == [ZERO]


def test_a_board_that_does_not_is_set_up(far: Far, exchange: HaplyExchange) -> None:
    bare = BOARD.bare_reply
    far.deeds = [lambda: far.say(bare), lambda: far.say(bare)]
    far.rest = lambda: far.say(HOME)
    exchange.open()
    assert far.messages == [ZERO, ZERO, RESET, BOARD.setup, ZERO]


def test_unexpected_angles_after_setup_are_refused(far: Far) -> None:
    far.deeds = [lambda: far.say(BOARD.bare_reply)] * 2
    far.rest = lambda: far.say(at(150.0, 30.0))
    exchange = HaplyExchange(lambda: far.path, V3, PATIENT)
    with pytest.raises(HardwareFault, match="is another firmware on the board"):
        exchange.open()
    exchange.close()


def test_implausible_angles_cause_zero_torque(far: Far, exchange: HaplyExchange) -> None:
    far.deeds = [lambda: far.say(HOME), lambda: far.say(at(-400.0, 12.0))]
    exchange.open()
    with pytest.raises(BadReply, match=r"arm 1 .* out of its range"):
        exchange.exchange((1.0, 0.0, 0.0))
    far.rest = lambda: far.say(HOME)
    exchange.exchange((0.0, 0.0, 0.0))
    assert far.messages[2:] == [ZERO, ZERO]


def test_a_singular_posture_gets_no_torque(far: Far) -> None:
    """Motors on one axis, and the arms nearly one over the other: a force could need any torque."""
    v2 = VERSIONS["v2"]
    board = replace(v2.board, home_deg=(90.2, 89.8), whole_counts=False)
    exchange = HaplyExchange(lambda: far.path, replace(v2, board=board), PATIENT)
    reply = bytes((board.id,)) + at(90.2, 89.8)[1:]
    far.rest = lambda: far.say(reply)
    exchange.open()
    exchange.exchange((1.0, 1.0, 0.0))
    assert far.messages[-1] == board.torques(0.0, 0.0)
    exchange.close()


PUSH = BOARD.torques(0.1, -0.1)
LONG_S = 10.0


@pytest.fixture
def line(far: Far) -> Iterator[HaplyLine]:
    opened = HaplyLine(far.path, BOARD)
    yield opened
    opened.close()


def test_what_came_before_the_question_is_no_answer(far: Far, line: HaplyLine) -> None:
    far.say(answer(9) + b"junk")
    while line._port._port.in_waiting < 13:
        sleep(0.001)
    far.deeds = [lambda: far.say(answer(1))]
    assert counts(line.ask(ZERO, LONG_S)) == (1, 0)


def test_late_answer_is_not_the_next_one(far: Far, line: HaplyLine) -> None:
    """It comes with that to the zero torque which is sent first; only then is there another question."""
    far.deeds = [lambda: None, lambda: far.say(answer(1) + answer(2)), lambda: far.say(answer(3))]
    with pytest.raises(BadReply, match="no answer within 1 ms"):
        line.ask(PUSH, 0.001)
    assert counts(line.ask(PUSH, LONG_S)) == (3, 0)
    assert far.messages == [PUSH, ZERO, PUSH]


def test_torn_answer_is_bad_and_next_good(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda: far.say(answer(1)[:-1]), lambda: far.say(answer(2)), lambda: far.say(answer(3))]
    with pytest.raises(BadReply, match="8 bytes of 9"):
        line.ask(PUSH, 0.2)
    assert counts(line.ask(ZERO, LONG_S)) == (3, 0)


def test_slow_board_stays_bad(far: Far, line: HaplyLine) -> None:
    """But for an answer that waits already when this machine, after a stall, begins to look for one."""

    def slowly() -> None:
        sleep(0.005)
        far.say(answer(1))

    far.deeds, complaints = [slowly] * 20, []
    for _ in range(8):
        try:
            line.ask(ZERO, 0.001)
        except BadReply as bad:
            complaints.append(str(bad))
    assert len(complaints) >= 5
    assert all("answered after" in each or "no answer" in each for each in complaints)


def test_forgotten_setup_differs_from_torn_answer(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda: far.say(BOARD.bare_reply)] * 2
    with pytest.raises(BadReply, match="1 bytes of 9"):
        line.ask(PUSH, 0.2)
    with pytest.raises(Forgotten):
        line.ask(PUSH, 0.2)
    assert far.messages == [PUSH, ZERO]


def test_mute_board_is_told_to_rest_and_given_up(far: Far, line: HaplyLine) -> None:
    for _ in range(2):
        with pytest.raises(BadReply, match="no answer"):
            line.ask(PUSH, 0.001)
    with pytest.raises(HardwareFault, match="does not answer") as fault:
        line.ask(PUSH, 0.001)
    assert not isinstance(fault.value, BadReply)
    while len(far.messages) < 3:
        sleep(0.001)
    assert far.messages == [PUSH, ZERO, ZERO], "no question, and no torque, while an answer is owed"


HOME_RAD = radians(V3.board.home_deg)
COUNT = 2.0 * pi / 4880.0
UP = radians((120.0, 60.0))


class Prompt(AngleValidator):
    """Every answer comes at once."""

    def at(self, angles: Pair, now: float) -> Pair:
        return self.follow(angles, now, now)


def track() -> Prompt:
    return Prompt(V3.bar, HOME_RAD, (COUNT, COUNT))


def test_jump_is_rejected_and_earlier_angles_count() -> None:
    following = track()
    following.at(UP, 10.0)
    with pytest.raises(BadReply, match=r"arm 2 jumped by 0\.20 rad within 1\.0 ms"):
        following.at((UP[0], UP[1] + 0.2), 10.001)
    following.at((UP[0], UP[1] + 0.01), 10.002)
    following.at((UP[0], UP[1] + 0.01 + 0.9 * FASTEST * 0.01), 10.012)  # it may have moved while nothing came


def test_stalled_host_does_not_see_a_jump() -> None:
    """The first was measured long before it was read, so the arm had time to turn."""
    following = track()
    following.follow(UP, 10.0, 10.1)
    following.follow((UP[0] + 0.5, UP[1]), 10.1, 10.1003)
    with pytest.raises(BadReply, match="jumped"):
        following.follow((UP[0] + 1.0, UP[1]), 10.1003, 10.1006)


@pytest.mark.parametrize(
    ("angles", "complaint"),
    [
        ((HOME_RAD[0] + 3.6, HOME_RAD[1]), "arm 1 .*range"),
        ((HOME_RAD[0], HOME_RAD[1] - 3.6), "arm 2 .*range"),
        ((UP[0], HOME_RAD[1] + 3.6), "arm 2 .*range"),
        ((float("nan"), 0.0), "elbows are nan mm apart"),
        ((0.0, float("inf")), "arm 2 .*range"),
    ],
)
def test_postures_that_cannot_be_are_bad_replies(angles: Pair, complaint: str) -> None:
    with pytest.raises(BadReply, match=complaint):
        track().at(angles, 0.0)


@pytest.mark.parametrize("stuck", [0, 1])
def test_stuck_encoder_is_a_fault(stuck: int) -> None:
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
