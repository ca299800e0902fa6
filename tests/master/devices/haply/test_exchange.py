"""How a session begins, and what is asked after an answer that cannot be true."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.master.devices.haply.far_end import BOARD, ZERO, Far, at
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.haply.board import RESET
from weberlink.master.devices.haply.exchange import Conduct, HaplyExchange
from weberlink.master.devices.haply.linkage import VERSIONS, HaplyFrame

V3 = VERSIONS["v3"]
HOME = at(*BOARD.home_deg)
PATIENT = Conduct(V3, HaplyFrame(V3.center), torque_limit=0.123, torque_gain=1.0, reply=10.0, keep_home=True)


@pytest.fixture
def far() -> Iterator[Far]:
    there = Far()
    yield there
    there.stop()


@pytest.fixture
def exchange(far: Far) -> Iterator[HaplyExchange]:
    made = HaplyExchange(lambda: far.path, PATIENT)
    yield made
    far.rest = lambda: far.say(HOME)
    made.close()


def test_a_board_that_knows_us_is_left_as_it_is(far: Far, exchange: HaplyExchange) -> None:
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


def test_a_board_that_answers_something_else_than_it_was_set_up_to_is_refused(far: Far) -> None:
    far.deeds = [lambda: far.say(BOARD.bare_reply)] * 2
    far.rest = lambda: far.say(at(150.0, 30.0))
    exchange = HaplyExchange(lambda: far.path, PATIENT)
    with pytest.raises(HardwareFault, match="is another firmware on the board"):
        exchange.open()
    exchange.close()


def test_angles_that_cannot_be_are_followed_by_zero_torque_and_then_a_new_question(
    far: Far, exchange: HaplyExchange
) -> None:
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
    conduct = replace(PATIENT, version=replace(v2, board=board), frame=HaplyFrame(v2.center))
    exchange = HaplyExchange(lambda: far.path, conduct)
    reply = bytes((board.id,)) + at(90.2, 89.8)[1:]
    far.rest = lambda: far.say(reply)
    exchange.open()
    exchange.exchange((1.0, 1.0, 0.0))
    assert far.messages[-1] == board.torques(0.0, 0.0)
    exchange.close()
