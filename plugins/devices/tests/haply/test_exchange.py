"""Which answer belongs to which question, which angles are plausible, and how a session begins."""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from math import pi
from pathlib import Path
from struct import unpack
from time import sleep

import pytest

from plugins.devices.tests.haply.far_end import BOARD, ZERO, Far, answer, at, counts
from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.testing.serving import PtyDevice
from weberlink_devices.haply.board import RESET, Pair
from weberlink_devices.haply.exchange import FASTEST, STUCK_TRAVEL, AngleValidator, Forgotten, HaplyExchange, HaplyLine
from weberlink_devices.haply.linkage import VERSIONS, HaplyFrame, radians
from weberlink_devices.haply.options import HaplyOptions

V3 = VERSIONS["v3"]
HOME = at(*BOARD.home_deg)
PATIENT = HaplyOptions(reply_ms=100.0)


@pytest.fixture
def far() -> Far:
    return Far()


@pytest.fixture
def path(far: Far, tmp_path: Path) -> Iterator[str]:
    with PtyDevice(far, tmp_path / "port") as wire:
        yield str(wire.path)


@pytest.fixture
def exchange(far: Far, path: str) -> Iterator[HaplyExchange]:
    made = HaplyExchange(lambda: path, V3, PATIENT)
    yield made
    far.rest = HOME
    made.close()


def test_a_board_that_knows_its_setup_keeps_it_and_another_gets_it(far: Far, exchange: HaplyExchange) -> None:
    far.answers = [at(160.0, 20.0)]
    x, y = HaplyFrame(V3.center).tip(exchange.open().position)
    assert V3.bar.angles((x, y)) == pytest.approx((2.7925, 0.3491), abs=1e-3)
    assert far.messages == [ZERO]
    for answers, says in ((HOME, ""), (at(150.0, 30.0), "is another firmware on the board")):
        far.rest = answers
        exchange.close()
        exchange.start_afresh()
        far.messages.clear()
        far.answers = [BOARD.bare_reply] * 2
        with pytest.raises(HardwareFault, match=says) if says else nullcontext():
            exchange.open()
        assert far.messages == [ZERO, ZERO, RESET, BOARD.setup, ZERO]
    far.answers = [BOARD.bare_reply] * 4
    with pytest.raises(HardwareFault, match="was restarted and has forgotten where the arms are"):
        exchange.open()


def test_implausible_angles_cause_zero_torque(far: Far, exchange: HaplyExchange) -> None:
    far.answers = [HOME, at(-400.0, 12.0)]
    exchange.open()
    with pytest.raises(BadReply, match=r"arm 1 .* out of its range"):
        exchange.exchange((1.0, 0.0, 0.0))
    far.rest = HOME
    exchange.exchange((0.0, 0.0, 0.0))
    assert far.messages[2:] == [ZERO, ZERO]


@pytest.mark.parametrize("force", [(0.3, 0.4, 0.0), (6.0, 8.0, 0.0), (0.0, -9.0, 5.0)])
def test_limited_torque_keeps_the_force_direction(far: Far, exchange: HaplyExchange, force: Vector) -> None:
    far.rest = HOME
    exchange.open()
    exchange.exchange(force)
    second, first = unpack("<2f", far.messages[-1][2:])
    wanted = V3.bar.jacobian(radians(BOARD.home_deg)).torques(HaplyFrame.planar(force))
    share = min(1.0, PATIENT.torque_limit_n_m / max(map(abs, wanted)))
    assert (first, second) == pytest.approx([share * torque for torque in wanted], rel=2e-3)


def test_a_singular_posture_gets_no_torque(far: Far, path: str) -> None:
    """Motors on one axis, and the arms nearly one over the other: a force could need any torque."""
    v2 = VERSIONS["v2"]
    board = replace(v2.board, home_deg=(90.2, 89.8), whole_counts=False)
    exchange = HaplyExchange(lambda: path, replace(v2, board=board), PATIENT)
    reply = bytes((board.id,)) + at(90.2, 89.8)[1:]
    far.rest = reply
    exchange.open()
    exchange.exchange((1.0, 1.0, 0.0))
    assert far.messages[-1] == board.torques(0.0, 0.0)
    exchange.close()


PUSH = BOARD.torques(0.1, -0.1)
LONG_S = 10.0


@pytest.fixture
def line(path: str) -> Iterator[HaplyLine]:
    opened = HaplyLine(path, BOARD)
    yield opened
    opened.close()


def test_what_came_before_the_question_is_no_answer(far: Far, line: HaplyLine) -> None:
    far.leaving.append(answer(9) + b"junk")
    while line._port._port.in_waiting < 13:
        sleep(0.001)
    far.answers = [answer(1)]
    assert counts(line.ask(ZERO, LONG_S)) == (1, 0)


def test_late_answer_is_not_the_next_one(far: Far, line: HaplyLine) -> None:
    """It comes with that to the zero torque which is sent first; only then is there another question."""
    far.answers = [b"", answer(1) + answer(2), answer(3)]
    with pytest.raises(BadReply, match="no answer within 1 ms"):
        line.ask(PUSH, 0.001)
    assert counts(line.ask(PUSH, LONG_S)) == (3, 0)
    assert far.messages == [PUSH, ZERO, PUSH]


def test_torn_answer_is_bad_and_a_forgotten_setup_is_another_thing(far: Far, line: HaplyLine) -> None:
    far.answers = [answer(1)[:-1], answer(2), answer(3)]
    with pytest.raises(BadReply, match="8 bytes of 9"):
        line.ask(PUSH, 0.2)
    assert counts(line.ask(ZERO, LONG_S)) == (3, 0)
    far.answers = [BOARD.bare_reply] * 2
    with pytest.raises(BadReply, match="1 bytes of 9"):
        line.ask(PUSH, 0.2)
    with pytest.raises(Forgotten):
        line.ask(PUSH, 0.2)
    assert far.messages[-2:] == [PUSH, ZERO]


def test_slow_board_stays_bad(far: Far, line: HaplyLine) -> None:
    """But for an answer that waits already when this machine, after a stall, begins to look for one."""
    far.rest, far.slow_s = answer(1), 0.005
    complaints = []
    for _ in range(8):
        try:
            line.ask(ZERO, 0.001)
        except BadReply as bad:
            complaints.append(str(bad))
    assert len(complaints) >= 5
    assert all("answered after" in each or "no answer" in each for each in complaints)


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


def track() -> AngleValidator:
    return AngleValidator(V3.bar, HOME_RAD, (COUNT, COUNT))


@pytest.mark.parametrize(
    ("turned", "asked", "answered", "bad"),
    [
        (0.2, 10.001, 10.001, True),
        (0.01, 10.001, 10.001, False),
        (0.9 * FASTEST * 0.01, 10.01, 10.01, False),
        (0.5, 10.1, 10.1003, False),  # a stalled host: it was asked at 10.0, and had time to turn
        (0.6, 10.01, 10.0103, True),
    ],
)
def test_an_arm_that_turns_faster_than_any_is_a_bad_reply(
    turned: float, asked: float, answered: float, bad: bool
) -> None:
    following = track()
    following.follow(UP, 10.0, 10.0)
    with pytest.raises(BadReply, match=f"arm 2 jumped by {turned:.2f} rad") if bad else nullcontext():
        following.follow((UP[0], UP[1] + turned), asked, answered)
    following.follow((UP[0], UP[1] + 0.001), asked + 0.2, answered + 0.2)  # the angles before count


@pytest.mark.parametrize(
    ("angles", "complaint"),
    [
        ((HOME_RAD[0] + 3.6, HOME_RAD[1]), "arm 1 .*range"),
        ((HOME_RAD[0], HOME_RAD[1] - 3.6), "arm 2 .*range"),
        ((float("nan"), 0.0), "elbows are nan mm apart"),
        ((0.0, float("inf")), "arm 2 .*range"),
    ],
)
def test_postures_that_cannot_be_are_bad_replies(angles: Pair, complaint: str) -> None:
    with pytest.raises(BadReply, match=complaint):
        track().follow(angles, 0.0, 0.0)


@pytest.mark.parametrize("stuck", [0, 1])
def test_stuck_encoder_is_a_fault(stuck: int) -> None:
    following, travel, angles = track(), 0.0, list(UP)
    following.follow(UP, 0.0, 0.0)
    with pytest.raises(HardwareFault, match=f"encoder {stuck + 1} stands still") as fault:
        for i in range(1, 1000):
            step = 0.004 if i // 100 % 2 == 0 else -0.004
            angles[1 - stuck] += step
            travel += abs(step)
            following.follow((angles[0], angles[1]), i * 0.001, i * 0.001)
    assert not isinstance(fault.value, BadReply)
    assert travel == pytest.approx(STUCK_TRAVEL, abs=0.01)
    # A single count of the other is a sign of life, and none of before counts any more.
    angles[stuck] += COUNT
    following.follow((angles[0], angles[1]), 2.0, 2.0)
