"""Every emulated device of the table has what a person needs to choose and to break it."""

from math import isfinite
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.hardware.emulator import EMULATORS, WireFaults
from weberlink.master.devices import DEVICES, LEADERS
from weberlink.master.devices.polhem.protocol import LONG, SHORT, encode_command, encode_currents

DRIVERS = {*DEVICES, *LEADERS}
every_emulator = pytest.mark.parametrize("name", sorted(set(EMULATORS) & DRIVERS))


@every_emulator
def test_emulator_has_a_driver_and_its_named_faults_happen(name: str) -> None:
    emulator_class = EMULATORS.load(name)
    emulator = emulator_class(emulator_class.Options())
    assert emulator.faults == WireFaults()
    assert hasattr(emulator, "identity") == (emulator_class.transport in ("hid", "evdev"))
    for word, what in emulator_class.OWN_FAULTS.items():
        assert what
        emulator.inject(word, 1.0)
    emulator.advance(1.0)
    emulator.advance(2.0)
    with pytest.raises(ValueError, match="flood"):
        emulator.inject("flood", 1.0)


BOARDS: dict[str, tuple[bytes, int, dict[str, Any]]] = {
    "polhem_serial": (encode_currents((1, 2, 3)), 0, {}),
    "polhem_hid": (encode_command((1, 2, 3), LONG), LONG, {}),
    "polhem_hid, 8 bytes": (encode_command((1, 2, 3), SHORT), SHORT, {"report": 8, "frame_s": 0.00033}),
}
"""What a board understands, the size of its answer if that is fixed, and its options."""


@pytest.mark.parametrize("board", BOARDS)
@examples(15)
@given(pieces=st.lists(st.tuples(st.binary(max_size=150) | st.binary(min_size=14, max_size=14), st.floats(0.0, 0.7))))
def test_no_bytes_at_no_time_break_a_board(board: str, pieces: list[tuple[bytes, float]]) -> None:
    good, size, options = BOARDS[board]
    emulator_class: Any = EMULATORS.load(board.partition(",")[0])
    emulator, now = emulator_class(emulator_class.Options(**options)), 100.0
    emulator.advance(now)
    for data, pause in [*pieces, (b"]", 100.0)]:
        emulator.receive(data, now)
        now += pause
        emulator.advance(now)
        emulator.replies(now)
        assert all(map(isfinite, emulator.force))
    emulator.receive(good, now)
    answers = []
    for _ in range(20):
        now += 0.001
        emulator.advance(now)
        answers += emulator.replies(now)
    assert answers
    assert size in (0, len(answers[-1]))


@pytest.mark.parametrize(
    ("name", "message", "watchdog_s"),
    [
        ("polhem_serial", encode_currents((500, -6000, 0)), 0.1),
        ("polhem_hid", encode_command((500, -2999, 0), LONG), 0.5),
    ],
)
def test_a_board_that_hears_nothing_switches_its_motors_off_until_the_next_message(
    name: str, message: bytes, watchdog_s: float
) -> None:
    emulator_class: Any = EMULATORS.load(name)
    emulator, heard = emulator_class(emulator_class.Options()), 100.0
    for turn in range(2):
        emulator.advance(heard)
        emulator.receive(message, heard)
        emulator.advance(heard + watchdog_s - 0.005)
        assert emulator.enabled and min(emulator.currents_ma) < -2990.0
        emulator.advance(heard + watchdog_s + 0.005)
        assert (emulator.enabled, emulator.currents_ma, emulator.watchdog_trips) == (False, (0.0, 0.0, 0.0), turn + 1)
        heard += 10.0


@given(st.tuples(*[st.integers(-6000, 6000)] * 3))
def test_currents_flow_as_commanded(currents: Any) -> None:
    kind: Any = EMULATORS.load("polhem_serial")
    board = kind(kind.Options())
    board.receive(encode_currents(currents), 1.0)
    board.advance(1.05)
    assert (board.currents_ma, board.errors) == (currents, 0)
