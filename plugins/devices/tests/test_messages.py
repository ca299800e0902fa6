"""The messages of these devices: read as they were sent, and what is no message is refused in one line."""

import json
from math import inf, nan
from struct import pack
from typing import ClassVar

import pytest
from hypothesis import given, settings, strategies as st

from plugins.devices.tests.haply.far_end import BOARD, COUNT_DEG, answer, counts
from weberlink.hardware.fault import BadReply
from weberlink.testing.messages import Message, MessageContract
from weberlink_devices.inverse3.protocol import decode
from weberlink_devices.spacemouse.reports import PuckState


class TestMessages(MessageContract):
    MESSAGES: ClassVar = {
        "haply": Message(
            st.tuples(*[st.integers(-20_000, 20_000)] * 2),
            lambda turned: answer(*turned),
            lambda reply: counts(BOARD.angles(reply)),
            BadReply,
            refused=(
                bytes((BOARD.id + 1,)) + bytes(8),
                BOARD.bare_reply + pack("<2f", nan, 1.0),
                BOARD.bare_reply + pack("<2f", COUNT_DEG, -inf),
                BOARD.bare_reply + pack("<2f", 10.0 * COUNT_DEG, 1.0),  # between two counts
                BOARD.bare_reply + pack("<2f", 1e-30, 0.0),
                BOARD.bare_reply + pack("<2f", COUNT_DEG * (1.0 + 4e-6), 0.0),
            ),
        ),
        "inverse3": Message(
            st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False, allow_infinity=False), max_size=3),
            lambda value: json.dumps(value).encode(),
            decode,
            BadReply,
            refused=(b"[]", b"7", b"\xff\xfe", b"[" * 100_000),
        ),
    }


# --- the state of a SpaceMouse: each report says a part of it

three = st.tuples(*[st.integers(-32768, 32767)] * 3)


@settings(max_examples=20)
@given(st.builds(PuckState, three, three, st.integers(0, 0xFFFF)), st.booleans(), st.binary(min_size=1, max_size=64))
def test_puck_survives_its_reports_and_any_other(state: PuckState, joint: bool, noise: bytes) -> None:
    heard = PuckState().updated(noise)
    reports = state.reports(joint=joint, button_bytes=2)
    for report in reports:
        heard = heard.updated(report)
    assert heard == state
    for report in reports[:-1]:
        assert heard.updated(report[:-1]) == state, "a part of the values says nothing"


@pytest.mark.parametrize(
    ("report", "state"),
    [
        ("01 5e01 0000 a2fe", PuckState(translation=(350, 0, -350))),
        ("02 0000 e2ff 0000", PuckState(rotation=(0, -30, 0))),
        ("03 02 00", PuckState(buttons=2)),
        ("03 01 00 00 80", PuckState(buttons=0x80000001)),
        ("01 0100 0200 0300 0400 0500 0600", PuckState((1, 2, 3), (4, 5, 6))),
        ("17 64", PuckState()),
        ("01 0100", PuckState()),
    ],
)
def test_published_reports_of_a_puck_are_understood(report: str, state: PuckState) -> None:
    assert PuckState().updated(bytes.fromhex(report)) == state
