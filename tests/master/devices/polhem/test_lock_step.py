"""Which answer belongs to which message, in virtual time over a line with any delay."""

from math import inf
from typing import Any

import pytest

from weberlink.hardware.fault import BadReply
from weberlink.master.devices.polhem.driver import BAD_REPLIES
from weberlink.master.devices.polhem.lock_step import PROBE_S, QUIET_S, REPLY_S, SLICE_S, LockStep
from weberlink.master.devices.polhem.protocol import Sensors

REST = 0


class DelayedLine(LockStep):
    """Echoes every message `late` seconds later; time passes only while somebody listens.

    A message is the first of its currents; an answer has it as its model.
    """

    def __init__(self) -> None:
        super().__init__(lambda: self.now)
        self.now, self.late, self.lost = 100.0, 0.001, 0
        self.sent: list[tuple[float, int]] = []
        self.coming: list[tuple[float, int]] = []

    def send(self, message: Any) -> None:
        self.sent.append((self.now, message[0]))
        if self.lost:
            self.lost -= 1
        else:
            self.coming.append((self.now + self.late, message[0]))

    def hear(self, until: float) -> list[Sensors]:
        self.now = max(self.now, min([until, *(at for at, _ in self.coming)]))
        answers = [Sensors((), model=answer) for at, answer in self.coming if at <= self.now]
        self.coming = [(at, answer) for at, answer in self.coming if at > self.now]
        return answers

    def asked(self, message: int, fresh_until: float = inf) -> int | str:
        try:
            return self.ask((message, 0, 0), fresh_until).model
        except BadReply as reply:
            return str(reply)


def test_stale_message_is_replaced_by_rest() -> None:
    line = DelayedLine()
    assert line.asked(1, line.now) == 1
    assert line.asked(2, line.now - 1e-6) == REST
    assert [message for _, message in line.sent] == [1, REST]


def test_dialogue_resumes_when_owed_answers_have_come() -> None:
    line = DelayedLine()
    line.late = 0.03
    assert line.asked(1) == "does not answer"
    line.late = 0.001
    replies = [line.asked(message) for message in range(2, 9)]
    first = next(place for place, reply in enumerate(replies) if isinstance(reply, int))
    assert 100.03 <= line.now < 100.03 + 0.03
    assert replies[first:] == list(range(2 + first, 9))


def test_lost_answer_is_given_up_after_silence() -> None:
    line = DelayedLine()
    line.lost = 2
    began = line.now
    assert line.asked(7) == "does not answer"
    assert line.sent == [(100.0, 7), (100.0 + REPLY_S, REST)]
    while not isinstance(line.asked(7), int):
        assert line.now < began + 1.0
    assert began + QUIET_S <= line.now <= began + QUIET_S + PROBE_S + 3 * SLICE_S
    assert line.asked(8) == 8


@pytest.mark.parametrize("late", [0.0101, 0.02, 0.099, 0.111, 0.15, 0.21, 0.255, 0.27, 0.285, 0.3, 0.5])
def test_late_answers_are_never_mixed_up(late: float) -> None:
    line = DelayedLine()
    assert line.asked(500) == 500
    line.late = late
    # What is later than the longest silence is a fault before the silence has been heard twice.
    replies = [line.asked(message) for message in range(1, 400 if late < QUIET_S else BAD_REPLIES)]
    assert {reply for reply in replies if isinstance(reply, int)} == set()
    pushed = [at for at, message in line.sent if message != REST]
    rested = [at for at, message in line.sent if message == REST]
    assert all(any(at <= rest <= at + REPLY_S + 1e-9 for rest in rested) for at in pushed[1:-1]), "never held for long"


def test_unexpected_answer_is_doubted() -> None:
    line = DelayedLine()
    line.coming.append((line.now, 99))
    assert line.asked(1) == "answers late"
    assert line.sent[-1][1] == REST
    while not isinstance(reply := line.asked(2), int):
        assert line.now < 101.0
    assert reply == 2
    assert line.now > 100.0 + QUIET_S
