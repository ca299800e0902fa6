"""`polhem_hid` against a board in place of its port; over the real hidapi it is tried with the emulator."""

from collections.abc import Callable, Iterator
from threading import Thread
from time import monotonic, sleep
from typing import Any

import pytest

from tests.master.devices.polhem.boards import ScriptedHidBoard
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.polhem.driver import PolhemDevice
from weberlink.master.devices.polhem.hid_device import PolhemHidDevice, ReportExchange
from weberlink.master.devices.polhem.hid_protocol import LONG, SHORT, WATCHDOG_S, SetCounters
from weberlink.master.devices.polhem.options import PolhemHidOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions

TICK = 0.001
PATIENCE = 10.0
WOODY = PARAMETERS["woodenhaptics_2015"].on("hid14").mechanism
MIDDLE = (*WOODY.counts_at(ZERO), 0, 0, 0)

Make = Callable[..., PolhemDevice]


def until(condition: Callable[[], bool]) -> None:
    deadline = monotonic() + PATIENCE
    while not condition():
        assert monotonic() < deadline, "waited in vain"
        sleep(0.001)


@pytest.fixture
def device_on() -> Iterator[Make]:
    """Makes a device on a board; with force, whatever the signs."""
    made: list[PolhemDevice] = []

    def make(board: "ScriptedHidBoard | Desk", **settings: Any) -> PolhemDevice:
        options = PolhemHidOptions(port="/dev/hidraw9", **settings)
        options = options.model_copy(update={"signs_checked": PolhemHidDevice.fingerprint(options)})
        signs = PolhemHidDevice.fingerprint(options)
        made.append(
            PolhemDevice(
                "polhem_hid",
                options,
                options.wired(),
                lambda force_n: ReportExchange(options, force_n, board),
                TICK,
                signs=signs,
                watchdog_s=WATCHDOG_S,
                buttons=1,
            )
        )
        return made[-1]

    yield make
    for device in made:
        device.close()


def press_until(device: PolhemDevice, force: Vector, condition: Callable[[], bool]) -> None:
    def pressed() -> bool:
        device.command(force, monotonic())
        return condition()

    until(pressed)


def test_the_report_that_has_waited_is_not_believed(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE, stale=(16_000, 0, 0, 0, 0, 0))
    device = device_on(board)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)


def test_a_silent_board_is_started_by_zeros(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device_on(board).open(monotonic())
    assert board.commands[0] == (0, 0, 0)


def test_force_and_button(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board)
    device.open(monotonic())
    force = (1.0, -2.0, 0.5)
    expected = tuple(map(int, WOODY.currents_ma(force, MIDDLE)))
    press_until(device, force, lambda: board.commands[-1] == expected)
    board.button = True
    until(lambda: device.latest(monotonic()).buttons == 1)
    device.close()
    assert (board.commands[-1], board.closed) == ((0, 0, 0), 1)


def test_the_older_kind_has_its_own_signs(device_on: Make) -> None:
    middle = PARAMETERS["woodenhaptics_2015"].on("hid8").mechanism.counts_at(ZERO)
    board = ScriptedHidBoard(middle, stale=middle)
    board.size = SHORT
    device = device_on(board, report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)
    press_until(device, (1.0, 0.0, 0.0), lambda: board.commands[-1] != (0, 0, 0))


@pytest.mark.parametrize(("said", "sent"), [(14, 8), (8, 14)])
def test_reports_of_the_other_length_are_refused(device_on: Make, said: int, sent: int) -> None:
    """Their firmware counts the other way round."""
    board = ScriptedHidBoard((0,) * (6 if sent == LONG else 3))
    board.size = sent
    with pytest.raises(DeviceFault, match=f"sends reports of {sent} bytes, the file says {said}.*report_bytes: {sent}"):
        device_on(board, report_bytes=said).open(monotonic())
    assert not any(any(command) for command in board.commands if isinstance(command, tuple))


class Desk:
    """An emulated device in place of its port, in real time."""

    def __init__(self, **options: Any) -> None:
        still = {"script": [{"motion": "rest", "duration_s": 1000.0}], "tremor_m": 0.0}
        self.emulator = PolhemHidEmulator(PolhemHidEmulatorOptions.model_validate({"handle": still, **options}))
        self.emulator.advance(monotonic())

    def __call__(self, path: str) -> "Desk":
        return self

    def write(self, report: bytes) -> None:
        self.emulator.receive(report, monotonic())

    def read_all(self, until: float) -> list[bytes]:
        while True:
            now = monotonic()
            self.emulator.advance(now)
            reports = self.emulator.replies(now)
            if reports or now >= until:
                return reports
            sleep(0.0002)

    def guard(self, guardian: Guardian) -> None:
        pass  # who has the device in hand stops with it

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("built", "settings"),
    [
        ({"report": 14}, {}),
        ({"report": 8}, {}),
        ({"report": 8, "host": "haptikfabrikenapi"}, {"motor_directions": (1, 1, 1)}),
        ({"report": 14, "encoder_signs": (-1, 1, 1)}, {"encoder_directions": (-1, 1, 1)}),
        ({"report": 14, "motor_signs": (-1, 1, 1)}, {"motor_directions": (-1, 1, 1)}),
        ({"report": 14, "parameters": "woodenhaptics_2019"}, {"parameters": "woodenhaptics_2019"}),
        ({"report": 8, "parameters": "aluhaptics_v2"}, {"parameters": "aluhaptics_v2"}),
        ({"report": 14, "parameters": "polhem_v3"}, {"parameters": "polhem_v3"}),
    ],
    ids=["14 bytes", "8 bytes", "other motors", "encoder A", "motor A", "2019", "aluhaptics", "polhem"],
)
def test_hand_and_force_agree_on_a_device_as_published(
    device_on: Make, built: dict[str, Any], settings: dict[str, Any]
) -> None:
    desk = Desk(**built)
    device = device_on(desk, report_bytes=built["report"], **settings)
    device.open(monotonic())
    force = (0.3, 0.6, -0.4)
    press_until(device, force, lambda: distance(desk.emulator.force, force) < 0.05)
    assert distance(device.latest(monotonic()).position, desk.emulator.position) < 5e-4
    device.close()


def test_held_in_its_home_pose_the_counters_are_set(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    device = device_on(board, homing="at_open")
    device.open(monotonic())
    assert SetCounters((0,) * 6) in board.commands
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))


def test_counters_may_hold_the_home_counts(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    device = device_on(board, homing="at_open", counters_hold_home=True, parameters="polhem_v3", home_counts=(8, 9, 10))
    device.open(monotonic())
    assert SetCounters((8, 9, 10, 0, 30, 0)) in board.commands


def test_the_gimbal_of_a_polhem_is_wired_last_to_first(device_on: Make) -> None:
    mechanism = PARAMETERS["polhem_v1"].on("hid14").mechanism
    device = device_on(ScriptedHidBoard((*mechanism.counts_at(ZERO), 256, 128, 0)), parameters="polhem_v1")
    device.open(monotonic())
    assert device.latest(monotonic()).orientation == mechanism.orientation((*mechanism.counts_at(ZERO), 0, 128, 256))


def test_a_board_that_does_not_set_its_counters_is_refused(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    board.sets_counters = False
    with pytest.raises(DeviceFault, match="does not set its counters"):
        device_on(board, homing="at_open").open(monotonic())


def test_the_older_kind_is_homed_on_the_host(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5), stale=(0, 0, 0))
    board.size = SHORT
    device = device_on(board, homing="at_open", report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))
    assert set(board.commands) == {(0, 0, 0)}
    with pytest.raises(DeviceFault, match="without a calibration button; set homing: at_open"):
        device_on(board, homing="button", report_bytes=8).open(monotonic())


def test_a_press_of_long_ago_does_not_count_and_a_new_one_does(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    board.calibrate = True

    def press_later() -> None:
        until(lambda: not board.calibrate and len(board.commands) > 10)
        board.calibrate = True

    person = Thread(target=press_later)
    person.start()
    device = device_on(board, homing="button")
    device.open(monotonic())
    person.join()
    assert [each for each in board.commands if isinstance(each, SetCounters)] == [
        SetCounters((*MIDDLE[:3], 0, 0, 0)),
        SetCounters((0,) * 6),
    ]


def test_a_lost_report_is_followed_by_zeros_and_many_are_a_fault(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board)
    device.open(monotonic())
    press_until(device, (3.0, 0.0, 0.0), lambda: board.commands[-1] != (0, 0, 0))
    before = len(board.commands)
    board.mute = 2  # a report and the zeros after it
    press_until(device, (3.0, 0.0, 0.0), lambda: board.mute == 0 and board.commands[-1] != (0, 0, 0))
    assert (0, 0, 0) in board.commands[before:]
    board.mute = 10**9
    with pytest.raises(DeviceFault, match="does not answer"):
        press_until(device, (3.0, 0.0, 0.0), lambda: not device.latest(monotonic()))
    assert board.commands[-1] == (0, 0, 0)


def test_unplugged_and_back_without_them(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board, reconnect_s=0.2)
    device.open(monotonic())
    board.plugged = False
    until(lambda: board.closed > 0)
    board.counts = (0,) * 6
    board.plugged = True
    with pytest.raises(DeviceFault, match="lost its home"):
        until(lambda: not device.latest(monotonic()))


def test_counters_are_followed_beyond_16_bits(device_on: Make) -> None:
    """A device that turns on and on, its home pose far away: 32767 is followed by -32768."""
    mechanism = PARAMETERS["polhem_v2"].on("hid14").mechanism
    near = mechanism.counts_at(ZERO)
    shift = 32_760 - near[2]
    board = ScriptedHidBoard((near[0], near[1], near[2] + shift, 0, 0, 0))
    home = mechanism.drive.home_counts
    device = device_on(board, parameters="polhem_v2", home_counts=(home[0], home[1], home[2] - shift))
    device.open(monotonic())
    board.counts = (near[0], near[1], near[2] + shift + 30, 0, 0, 0)
    expected = mechanism.position((near[0], near[1], near[2] + 30))
    until(lambda: device.latest(monotonic()).position == pytest.approx(expected, abs=1e-5))
