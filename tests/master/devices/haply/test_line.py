"""Which answer belongs to which question, with the board's end in the hands of the test."""

from collections.abc import Iterator
from time import monotonic, sleep

import pytest

from tests.master.devices.haply.far_end import BOARD, ZERO, Far, answer, counts
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.haply.exchange import Forgotten, HaplyLine

PUSH = BOARD.torques(0.1, -0.1)
LONG_S = 10.0


@pytest.fixture
def far() -> Iterator[Far]:
    there = Far()
    yield there
    there.stop()


@pytest.fixture
def line(far: Far) -> Iterator[HaplyLine]:
    opened = HaplyLine(far.path, BOARD)
    yield opened
    opened.close()


def nothing() -> None:
    pass


def test_an_answer_belongs_to_its_question(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda: far.say(answer(1)), lambda: far.say(answer(2))]
    before = monotonic()
    assert counts(line.ask(PUSH, LONG_S)) == (1, 0)
    assert before <= line.asked_at <= monotonic()
    assert counts(line.ask(ZERO, LONG_S)) == (2, 0)
    assert far.messages == [PUSH, ZERO]


def test_an_answer_in_pieces_is_one_answer(far: Far, line: HaplyLine) -> None:
    def pieces() -> None:
        for byte in answer(1):
            far.say(bytes((byte,)))
            sleep(0.001)

    far.deeds = [pieces]
    assert counts(line.ask(ZERO, LONG_S)) == (1, 0)


def test_what_came_before_the_question_is_no_answer(far: Far, line: HaplyLine) -> None:
    far.say(answer(9) + b"junk")
    while line._port._port.in_waiting < 13:
        sleep(0.001)
    far.deeds = [lambda: far.say(answer(1))]
    assert counts(line.ask(ZERO, LONG_S)) == (1, 0)


def test_a_late_answer_is_not_taken_for_the_next_one(far: Far, line: HaplyLine) -> None:
    """It comes with that to the zero torque which is sent first; only then is there another question."""
    far.deeds = [nothing, lambda: far.say(answer(1) + answer(2)), lambda: far.say(answer(3))]
    with pytest.raises(BadReply, match="no answer within 1 ms"):
        line.ask(PUSH, 0.001)
    assert counts(line.ask(PUSH, LONG_S)) == (3, 0)
    assert far.messages == [PUSH, ZERO, PUSH]


def test_a_lost_answer_is_waited_for_and_then_forgotten(far: Far, line: HaplyLine) -> None:
    far.deeds = [nothing, lambda: far.say(answer(2)), lambda: far.say(answer(3))]
    with pytest.raises(BadReply, match="no answer"):
        line.ask(PUSH, 0.001)
    assert counts(line.ask(ZERO, LONG_S)) == (3, 0)


def test_a_torn_answer_is_bad_and_the_next_is_good_again(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda: far.say(answer(1)[:-1]), lambda: far.say(answer(2)), lambda: far.say(answer(3))]
    with pytest.raises(BadReply, match="8 bytes of 9"):
        line.ask(PUSH, 0.2)
    assert counts(line.ask(ZERO, LONG_S)) == (3, 0)


def test_an_answer_that_cannot_be_true_is_like_a_bad_one(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda value=value: far.say(answer(value)) for value in (1, 2, 3)]  # type: ignore[misc]
    line.ask(PUSH, LONG_S)
    line.doubt()
    assert counts(line.ask(ZERO, LONG_S)) == (3, 0)
    assert far.messages == [PUSH, ZERO, ZERO]


def test_a_board_that_is_slow_for_good_stays_bad(far: Far, line: HaplyLine) -> None:
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


def test_a_board_that_forgot_is_told_from_one_that_is_torn(far: Far, line: HaplyLine) -> None:
    far.deeds = [lambda: far.say(BOARD.bare_reply)] * 2
    with pytest.raises(BadReply, match="1 bytes of 9"):
        line.ask(PUSH, 0.2)
    with pytest.raises(Forgotten):
        line.ask(PUSH, 0.2)
    assert far.messages == [PUSH, ZERO]


def test_a_mute_board_is_given_up_and_was_told_to_rest_each_time(far: Far, line: HaplyLine) -> None:
    for _ in range(2):
        with pytest.raises(BadReply, match="no answer"):
            line.ask(PUSH, 0.001)
    with pytest.raises(HardwareFault, match="does not answer") as fault:
        line.ask(PUSH, 0.001)
    assert not isinstance(fault.value, BadReply)
    while len(far.messages) < 4:
        sleep(0.001)
    assert far.messages == [PUSH, ZERO, PUSH, ZERO]
