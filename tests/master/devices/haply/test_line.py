"""Which answer belongs to which question, with the board's end in the hands of the test."""

import os
import threading
import tty
from collections.abc import Callable, Iterator
from select import select
from struct import pack
from time import monotonic, sleep

import pytest

from hardware.fault import BadReply, HardwareFault
from master.devices.haply.board import Board
from master.devices.haply.line import Forgotten, Line
from master.devices.haply.version import VERSIONS

BOARD: Board = VERSIONS["v3"].board
ZERO = BOARD.torques(0.0, 0.0)
PUSH = BOARD.torques(0.1, -0.1)
LONG_S = 10.0


def answer(first: float) -> bytes:
    return BOARD.bare_reply + pack("<2f", 0.0, first)


class Far:
    """The board's end: does the next deed for each question that comes."""

    def __init__(self) -> None:
        self.near, self._far = os.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)
        self.questions: list[bytes] = []
        self.deeds: list[Callable[[], None]] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def say(self, data: bytes) -> None:
        os.write(self.near, data)

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        os.close(self.near)
        os.close(self._far)

    def _serve(self) -> None:
        heard = b""
        while not self._stopping.is_set():
            if not select((self.near,), (), (), 0.01)[0]:
                continue
            heard += os.read(self.near, 1000)
            while len(heard) >= len(ZERO):
                self.questions.append(heard[: len(ZERO)])
                heard = heard[len(ZERO) :]
                if self.deeds:
                    self.deeds.pop(0)()


@pytest.fixture
def far() -> Iterator[Far]:
    there = Far()
    yield there
    there.stop()


@pytest.fixture
def line(far: Far) -> Iterator[Line]:
    opened = Line(far.path, BOARD)
    yield opened
    opened.close()


def nothing() -> None:
    pass


def test_an_answer_belongs_to_its_question(far: Far, line: Line) -> None:
    far.deeds = [lambda: far.say(answer(1.0)), lambda: far.say(answer(2.0))]
    before = monotonic()
    assert line.ask(PUSH, LONG_S) == (1.0, 0.0)
    assert before <= line.asked_at <= monotonic()
    assert line.ask(ZERO, LONG_S) == (2.0, 0.0)
    assert far.questions == [PUSH, ZERO]


def test_an_answer_in_pieces_is_one_answer(far: Far, line: Line) -> None:
    def pieces() -> None:
        for byte in answer(1.0):
            far.say(bytes((byte,)))
            sleep(0.001)

    far.deeds = [pieces]
    assert line.ask(ZERO, LONG_S) == (1.0, 0.0)


def test_what_came_before_the_question_is_no_answer(far: Far, line: Line) -> None:
    far.say(answer(9.0) + b"junk")
    while line._port._port.in_waiting < 13:
        sleep(0.001)
    far.deeds = [lambda: far.say(answer(1.0))]
    assert line.ask(ZERO, LONG_S) == (1.0, 0.0)


def test_a_late_answer_is_not_taken_for_the_next_one(far: Far, line: Line) -> None:
    """It comes with that to the zero torque which is sent first; only then is there another question."""
    far.deeds = [nothing, lambda: far.say(answer(1.0) + answer(2.0)), lambda: far.say(answer(3.0))]
    with pytest.raises(BadReply, match="no answer within 1 ms"):
        line.ask(PUSH, 0.001)
    assert line.ask(PUSH, LONG_S) == (3.0, 0.0)
    assert far.questions == [PUSH, ZERO, PUSH]


def test_a_lost_answer_is_waited_for_and_then_forgotten(far: Far, line: Line) -> None:
    far.deeds = [nothing, lambda: far.say(answer(2.0)), lambda: far.say(answer(3.0))]
    with pytest.raises(BadReply, match="no answer"):
        line.ask(PUSH, 0.001)
    assert line.ask(ZERO, LONG_S) == (3.0, 0.0)


def test_a_torn_answer_is_bad_and_the_next_is_good_again(far: Far, line: Line) -> None:
    far.deeds = [lambda: far.say(answer(1.0)[:-1]), lambda: far.say(answer(2.0)), lambda: far.say(answer(3.0))]
    with pytest.raises(BadReply, match="8 bytes of 9"):
        line.ask(PUSH, 0.2)
    assert line.ask(ZERO, LONG_S) == (3.0, 0.0)


def test_an_answer_that_cannot_be_true_is_like_a_bad_one(far: Far, line: Line) -> None:
    far.deeds = [lambda value=value: far.say(answer(value)) for value in (1.0, 2.0, 3.0)]  # type: ignore[misc]
    line.ask(PUSH, LONG_S)
    line.doubt()
    assert line.ask(ZERO, LONG_S) == (3.0, 0.0)
    assert far.questions == [PUSH, ZERO, ZERO]


def test_a_board_that_is_slow_for_good_stays_bad(far: Far, line: Line) -> None:
    """But for an answer that waits already when this machine, after a stall, begins to look for one."""

    def slowly() -> None:
        sleep(0.005)
        far.say(answer(1.0))

    far.deeds, complaints = [slowly] * 20, []
    for _ in range(8):
        try:
            line.ask(ZERO, 0.001)
        except BadReply as bad:
            complaints.append(str(bad))
    assert len(complaints) >= 5
    assert all("answered after" in each or "no answer" in each for each in complaints)


def test_a_board_that_forgot_is_told_from_one_that_is_torn(far: Far, line: Line) -> None:
    far.deeds = [lambda: far.say(BOARD.bare_reply)] * 2
    with pytest.raises(BadReply, match="1 bytes of 9"):
        line.ask(PUSH, 0.2)
    with pytest.raises(Forgotten):
        line.ask(PUSH, 0.2)
    assert far.questions == [PUSH, ZERO]


def test_a_mute_board_is_given_up_and_was_told_to_rest_each_time(far: Far, line: Line) -> None:
    for _ in range(2):
        with pytest.raises(BadReply, match="no answer"):
            line.ask(PUSH, 0.001)
    with pytest.raises(HardwareFault, match="does not answer") as fault:
        line.ask(PUSH, 0.001)
    assert not isinstance(fault.value, BadReply)
    while len(far.questions) < 4:
        sleep(0.001)
    assert far.questions == [PUSH, ZERO, PUSH, ZERO]
