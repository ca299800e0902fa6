"""The emulated board with brackets keeps the rules that its firmware is described with; in virtual time."""

from collections.abc import Sequence
from pathlib import Path
from select import select
from typing import Any

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import distance
from weberlink.hardware.emulator import PtyDevice
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.devices.polhem.serial_protocol import SerialStatus, SerialStatusReader, encode_currents
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

TICK = 0.001
MODELS = {
    "polhem": (1, "polhem_v3"),
    "vintage_phantom": (2, "vintage_phantom"),
    "woodenhaptics": (3, "woodenhaptics_2015"),
}
STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}


class Desk:
    """An emulated device and its time."""

    def __init__(self, **options: Any) -> None:
        self.emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate({"handle": STILL, **options}))
        self.now = 100.0
        self.emulator.advance(self.now)

    def wait(self, seconds: float) -> list[SerialStatus]:
        answers = b""
        until = self.now + seconds
        while self.now < until:
            self.now = min(self.now + TICK, until)
            self.emulator.advance(self.now)
            answers += b"".join(self.emulator.replies(self.now))
        return SerialStatusReader().feed(answers)

    def say(self, data: bytes, wait: float = TICK) -> list[SerialStatus]:
        self.emulator.receive(data, self.now)
        return self.wait(wait)

    def ask(self, *currents: int) -> SerialStatus:
        a, b, c = currents or (0, 0, 0)
        (answer,) = self.say(encode_currents((a, b, c)))
        return answer


@pytest.mark.parametrize("model", MODELS)
def test_its_counts_are_those_of_the_handles_place_in_the_published_mechanism(model: str) -> None:
    number, parameters = MODELS[model]
    desk = Desk(model=model, handle={})
    for _ in range(5):
        desk.wait(0.4)
        answer = desk.ask()
        assert (answer.model, answer.error) == (number, 0)
        there = PARAMETERS[parameters].mechanism.position(answer.counts)
        assert distance(there, desk.emulator.position) < 2e-4, "a count is up to 0.08 mm"
    assert len(set(desk.emulator.counts)) > 1


def test_every_message_is_answered_once_after_the_time_that_it_takes() -> None:
    desk = Desk(processing_s=0.004)
    desk.emulator.receive(encode_currents((100, 0, 0)), desk.now)
    desk.emulator.advance(desk.now + 0.0039)
    assert not desk.emulator.replies(desk.now + 0.0039)
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert desk.emulator.next_timer() == pytest.approx(desk.now + 0.004)
    assert len(desk.wait(0.1)) == 1
    assert desk.emulator.messages == 1


def test_currents_flow_push_the_hand_and_stay_until_the_next_message() -> None:
    desk = Desk(parameters="woodenhaptics_2015", model="woodenhaptics")
    mechanism = PARAMETERS["woodenhaptics_2015"].mechanism
    before = desk.emulator.position
    counts = desk.ask().counts
    a, b, c = (round(current) for current in mechanism.currents_ma((0.0, 0.0, 2.0), counts))
    desk.ask(a, b, c)
    assert desk.emulator.enabled
    assert desk.emulator.currents_ma == (a, b, c)
    assert desk.emulator.force == pytest.approx((0.0, 0.0, 2.0), abs=0.02)
    assert desk.emulator.largest_current_ma == max(map(abs, (a, b, c)))
    for _ in range(20):
        desk.wait(0.05)
        desk.ask(a, b, c)
    assert desk.emulator.position[2] - before[2] == pytest.approx(2.0 / 300.0, rel=0.1), "as stiff as the hand"
    desk.ask(0, 0, 0)
    assert desk.emulator.force == (0.0, 0.0, 0.0)
    assert desk.emulator.last_force_at == pytest.approx(desk.now, abs=2 * TICK)


def test_a_current_over_the_limit_is_no_current_and_the_others_flow() -> None:
    desk = Desk()
    assert desk.say(b"[6001,-6000,-2147483648]\n")[0].error == 0
    assert desk.emulator.currents_ma == (0.0, -6000.0, 0.0)


def test_silence_switches_the_amplifiers_off_and_a_message_on_again() -> None:
    desk = Desk()
    desk.ask(500, 0, 0)
    desk.wait(0.098)
    assert desk.emulator.enabled
    assert desk.emulator.next_timer() is not None
    desk.wait(0.003)
    assert not desk.emulator.enabled
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert desk.emulator.watchdog_trips == 1
    assert desk.emulator.last_force_at == pytest.approx(desk.now, abs=3 * TICK)
    desk.ask(0, 200, 0)
    assert desk.emulator.enabled
    assert desk.emulator.currents_ma == (0.0, 200.0, 0.0)


def test_the_watchdog_bites_in_time_however_late_anybody_looks() -> None:
    desk = Desk(handle={**STILL, "hand": {"stiffness_n_m": 100.0}})
    desk.ask(500, 0, 0)
    fed = desk.now
    desk.emulator.advance(fed + 3600.0)
    assert desk.emulator.watchdog_trips == 1
    assert desk.emulator.last_force_at == pytest.approx(fed + 0.1, abs=2 * TICK)


@pytest.mark.parametrize(
    ("data", "errors"),
    [
        (b"[1,2,3]\n[4,5,6]\n", [8, 256]),  # the first takes the beginning of the second
        (b"[1,2,3]\n[4,5,6]\n]", [8, 256, 256]),
        (b"[1,2,3]x", [8]),
        (b"[1,2,3" + b" " * 200, [128]),
        (b"1,2,3]", [256]),
        (b"[1,2]", [512]),
        (b"[1,[2,3,4]", [512]),
        (b"[1,2,3,4]", [512]),
        (b"[1,2,x]", [1024]),
        (b"[1,,3]", [1024]),
        (b"[1.5,2,3]", [1024]),
        (b"[1,2\0,3]", [1024]),
    ],
)
def test_a_wrong_message_gets_its_error_the_last_counts_and_no_current(data: bytes, errors: list[int]) -> None:
    desk = Desk(handle={})
    last = desk.ask(100, 100, 100).counts
    desk.wait(0.05)
    assert desk.emulator.counts != last
    answers = desk.say(data)
    assert [answer.error for answer in answers] == errors
    assert {answer.counts for answer in answers} == {last}
    assert desk.emulator.currents_ma == (100.0, 100.0, 100.0)
    assert desk.emulator.errors == len(errors)
    good = desk.ask(7, 8, 9)
    assert good.error == 0
    assert good.counts != last
    assert desk.emulator.currents_ma == (7.0, 8.0, 9.0)


@pytest.mark.parametrize(
    "data",
    [b"[1,-2,3]", b"[1,-2,3]\n", b"[1,-2,3]\r\n\0\0\0\0\0", b"\0\0\n[1,-2,3]", b"[ 1, -2,+3]", b"[[1,-2,3.5]"],
)
def test_filling_around_a_message_is_no_error(data: bytes) -> None:
    desk = Desk()
    (answer,) = desk.say(data)
    assert answer.error == 0
    assert desk.emulator.currents_ma == (1.0, -2.0, 3.0)


def test_a_message_may_come_in_pieces() -> None:
    desk = Desk()
    assert not desk.say(b"[12,")
    assert not desk.say(b"34,5", wait=0.02)
    assert len(desk.say(b"6]\n\0\0\0")) == 1
    assert desk.emulator.currents_ma == (12.0, 34.0, 56.0)


def test_the_host_that_runs_ahead_is_told_so() -> None:
    desk = Desk(processing_s=0.0005)
    for current in (1, 2, 3):  # the second and the third wait together, while the first is worked on
        desk.emulator.receive(b"[%d,0,0]\n" % current, desk.now)
    assert [answer.error for answer in desk.wait(0.01)] == [0, 8, 256]
    assert desk.emulator.currents_ma == (1.0, 0.0, 0.0)


def test_the_button_sets_all_counters_to_zero_where_the_handle_is() -> None:
    desk = Desk()
    assert max(map(abs, desk.ask().counts[:3])) > 100
    desk.emulator.inject("button")
    desk.wait(TICK)
    assert desk.ask().counts[:3] == (0, 0, 0)


def test_in_the_home_pose_the_counters_are_zero_and_the_button_changes_nothing() -> None:
    desk = Desk(model="woodenhaptics")
    there = desk.emulator.position
    desk.emulator.inject("home")
    desk.wait(2.0)
    assert desk.emulator.position == pytest.approx(PARAMETERS["woodenhaptics_2015"].mechanism.position((0, 0, 0)))
    desk.emulator.inject("button")
    desk.wait(TICK)
    assert desk.ask().counts[:3] == (0, 0, 0)
    desk.emulator.inject("release")
    desk.wait(2.0)
    assert desk.emulator.position == pytest.approx(there, abs=1e-6)


@pytest.mark.parametrize(("word", "axis"), [("x_mm", 0), ("y_mm", 1), ("z_mm", 2)])
def test_the_handle_can_be_carried_along_one_axis_whatever_the_force(word: str, axis: int) -> None:
    desk = Desk()
    for distance_mm in (0.0, 50.0):
        desk.emulator.inject(word, distance_mm)
        for _ in range(40):
            desk.wait(0.02)
            desk.ask(400, 0, 0)
        expected = [0.0, 0.0, 0.0]
        expected[axis] = 1e-3 * distance_mm
        assert desk.emulator.position == tuple(expected)


def test_a_restart_loses_home_and_current_and_what_was_said() -> None:
    desk = Desk()
    desk.ask(900, 0, 0)
    desk.emulator.receive(b"[1,2", desk.now)
    desk.emulator.inject("restart")
    desk.wait(TICK)
    assert not desk.emulator.enabled
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    (answer,) = desk.say(b",3]")
    assert answer.error == 256
    answer = desk.ask(5, 6, 7)
    assert answer.error == 0
    assert max(map(abs, answer.counts[:3])) < 20, "the hand swings back by so much in a millisecond"


def test_without_homing_counters_begin_where_the_handle_is() -> None:
    assert Desk(homed=False).ask().counts[:3] == (0, 0, 0)


def test_a_stuck_encoder_keeps_its_count_while_the_others_go_on() -> None:
    desk = Desk(handle={})
    desk.emulator.inject("stuck_encoder", 2.0)
    desk.wait(TICK)
    first = desk.ask().counts
    desk.wait(0.5)
    later = desk.ask().counts
    assert later[1] == first[1]
    assert later[0] != first[0]
    assert later[2] != first[2]
    desk.emulator.inject("stuck_encoder", 0.0)
    desk.wait(TICK)
    assert desk.ask().counts[1] != first[1]


def test_a_tripped_watchdog_answers_but_gives_no_current() -> None:
    desk = Desk()
    desk.ask(300, 0, 0)
    desk.emulator.inject("trip_watchdog")
    desk.wait(TICK)
    assert not desk.emulator.enabled
    assert desk.ask(300, 0, 0).error == 0
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert desk.emulator.watchdog_trips == 1
    desk.emulator.inject("trip_watchdog", 0.0)
    desk.wait(TICK)
    desk.ask(300, 0, 0)
    assert desk.emulator.currents_ma == (300.0, 0.0, 0.0)


def test_it_may_say_to_be_another_model_or_to_have_a_broken_gimbal() -> None:
    desk = Desk(model="polhem", handle={})
    desk.emulator.inject("wrong_model", 3.0)
    desk.emulator.inject("gimbal_error", 5.0)
    desk.wait(TICK)
    answers = [desk.ask(100 + i, 0, 0) for i in range(6)]
    assert {answer.model for answer in answers} == {3}
    assert sorted(answer.error for answer in answers) == [0, 0, 1, 1, 4, 4], "one sensor is read per message"
    assert desk.emulator.currents_ma == (105.0, 0.0, 0.0), "set before the sensor is read"
    first = answers[-1]
    desk.wait(0.05)
    later = [desk.ask(100, 0, 0) for _ in range(3)][-1]
    assert later.counts[:3] != first.counts[:3]
    assert (later.counts[3], later.counts[5]) == (first.counts[3], first.counts[5])
    assert later.counts[4] != first.counts[4]


def test_a_motor_wired_the_wrong_way_round_pushes_the_other_way() -> None:
    right, wrong = Desk(), Desk(motor_signs=(-1, 1, 1))
    for desk in (right, wrong):
        desk.ask(400, 0, 0)
    assert wrong.emulator.force == pytest.approx([-f for f in right.emulator.force], abs=1e-9)


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("stuck_encoder", 7.0),
        ("stuck_encoder", 1.5),
        ("wrong_model", 4.0),
        ("gimbal_error", float("nan")),
        ("x_mm", 201.0),
        ("z_mm", float("nan")),
    ],
)
def test_faults_that_cannot_be_are_refused(word: str, value: float) -> None:
    with pytest.raises(ValueError, match=word):
        Desk().emulator.inject(word, value)


def test_the_same_bytes_at_the_same_times_give_the_same_answers() -> None:
    def run(seed: int) -> list[SerialStatus]:
        desk = Desk(handle={"seed": seed})
        return [desk.ask(10 * (i % 50), -i, 3) for i in range(300)]

    assert run(1) == run(1)
    assert run(1) != run(2)


@examples(60)
@given(st.lists(st.tuples(st.binary(max_size=150), st.floats(0.0, 0.3)), max_size=12))
def test_no_bytes_at_no_time_break_it(pieces: Sequence[tuple[bytes, float]]) -> None:
    desk = Desk()
    for data, pause in pieces:
        desk.emulator.receive(data, desk.now)
        desk.now += pause
        desk.emulator.advance(desk.now)
        answers = desk.emulator.replies(desk.now)
        assert len(SerialStatusReader().feed(b"".join(answers))) == len(answers)
        assert max(map(abs, desk.emulator.currents_ma)) <= 6000.0
    desk.say(b"]")
    desk.now += 0.2
    desk.emulator.advance(desk.now)
    assert not desk.emulator.enabled
    assert desk.ask(1, 2, 3).error == 0


@examples(60)
@given(st.lists(st.text("[],-0123456789x\n\0", max_size=20), max_size=8))
def test_nearly_right_messages_are_answered_once_each(pieces: Sequence[str]) -> None:
    desk = Desk()
    for text in pieces:
        desk.say(b"\0" + text.encode())
    desk.say(b"]")
    assert desk.ask().error == 0
    assert desk.emulator.messages - desk.emulator.errors >= 1


def test_over_a_real_port_with_pyserial(tmp_path: Path) -> None:
    emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions(processing_s=0.0))
    reader = SerialStatusReader()
    with PtyDevice(emulator, tmp_path / "tty") as device, serial.Serial(str(device.path), 115_200, timeout=0) as port:
        for number in range(200):
            port.write(encode_currents((number, -number, 0)))
            answers: list[SerialStatus] = []
            while not answers:
                assert select((port.fileno(),), (), (), 20.0)[0]
                answers = reader.feed(port.read(4096))
            assert [answer.error for answer in answers] == [0]
        assert (emulator.messages, emulator.errors, emulator.largest_current_ma) == (200, 0, 199.0)
    assert reader.malformed == 0
    assert not device.path.is_symlink()
