"""The driver in this process, against the stand-in for the maker's library."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from plugins.devices.tests.force_dimension.fake import Devices
from weberlink.geometry.vector import Vector, norm
from weberlink.master.devices.hardware_device import RAMP_S
from weberlink.testing.devices import armed, drive, fault_of, refusal
from weberlink_devices.force_dimension.library import Library, find

TICK = 0.001
PUSH: Vector = (0.0, 2.0, 0.0)
OMEGA_3, SIGMA_7, LAMBDA_7, FALCON = 33, 104, 108, 60
BUTTON, VELOCITY, WATCHDOG = 1, 2, 3

Make = Callable[..., Any]


@pytest.fixture
def devices(tmp_path: Path) -> Devices:
    return Devices(tmp_path / "devices")


@pytest.fixture
def make(devices: Devices) -> Iterator[Make]:
    """Makes a device whose signs count as checked."""
    with ExitStack() as stack:

        def of(**options: Any) -> Any:
            device: Any = armed("force_dimension", **{"library": str(devices.library), **options})
            return stack.enter_context(closing(device))

        yield of


# --- force


def test_device_keeps_the_time_limit_and_expert_mode_ends(devices: Devices, make: Make) -> None:
    handle = devices[0].plug()
    device = make(watchdog_ms=10.0)
    assert device.spec.watchdog_s == 0.01
    device.open(monotonic())
    assert handle["watchdog"] == 80
    library = Library(str(devices.library))
    assert library.call("dhdSetWatchdog", 255, 0) < 0
    assert library.text("dhdErrorGetLastStr") == "expert mode disabled"
    assert handle["gravity"] == 1


def test_device_without_time_limit_is_refused_until_accepted(devices: Devices, make: Make) -> None:
    handle = devices[0].plug(FALCON)
    handle["has_watchdog"] = 0
    said = refusal(make(model="novint_falcon"))
    assert "takes no time limit for its force (dhdSetWatchdog: not available)" in said
    assert "set master.device.watchdog_ms: 0" in said
    assert (handle["owner"], handle["force_on"]) == (0, 0)
    device = make(model="novint_falcon", watchdog_ms=0.0)
    assert device.spec.watchdog_s is None, "the configuration asks for master.accept_no_watchdog then"
    device.open(monotonic())
    drive(device, lambda: norm(handle.wrench[0]) > 1.9, PUSH)


def test_watchdog_that_tripped_lets_force_ramp_up_again(devices: Devices, make: Make) -> None:
    handle = devices[0].plug()
    device = make()
    device.open(monotonic())
    drive(device, lambda: norm(handle.wrench[0]) > 1.9, PUSH)
    seen, enabled = int(handle["sets"]), handle["enables"]
    handle.switch_off(WATCHDOG)
    drive(device, lambda: handle["enables"] > enabled and norm(handle.wrench[0]) > 1.9, PUSH)
    forces = [(at, norm(force)) for at, force in handle.log(seen)]
    assert min(force for _, force in forces) == 0.0
    for (before, a), (after, b) in pairwise(forces):
        assert b - a <= 2.0 * (2.0 * TICK + after - before) / RAMP_S


@pytest.mark.parametrize(
    ("cause", "words"), [(BUTTON, "by its force button"), (VELOCITY, "its velocity limit tripped")]
)
def test_force_switched_off_by_person_stays_off_over_reconnection(
    cause: int, words: str, devices: Devices, make: Make
) -> None:
    handle = devices[0].plug()
    device = make(reconnect_s=0.2)
    device.open(monotonic())
    drive(device, lambda: norm(handle.wrench[0]) > 1.9, PUSH)
    enabled = handle["enables"]
    handle.switch_off(cause)
    assert f"force_dimension: its force is off: {words}; start the session again" in fault_of(device, PUSH)
    assert (handle["enables"], handle["force_on"]) == (enabled, 0)
    device.open(monotonic())
    drive(device, lambda: norm(handle.wrench[0]) > 1.9, PUSH)


def test_torque_is_displayed_within_its_limit_and_ends(devices: Devices, make: Make) -> None:
    handle = devices[0].plug(LAMBDA_7)
    device = make(model="lambda.7", torque_n_m=0.1)
    assert device.spec.torque_n_m == 0.1
    device.open(monotonic())

    def turning() -> bool:
        device.turn((0.0, 0.0, -5.0), monotonic())
        return handle.wrench[1][2] < -0.0999

    drive(device, turning, PUSH)
    assert handle.wrench[1] == pytest.approx((0.0, 0.0, -0.1), abs=1e-4)
    assert handle["gripper"] == 0
    drive(device, lambda: norm(handle.wrench[0]) > 1.9 and handle.wrench[1] == (0.0, 0.0, 0.0), PUSH)
    with pytest.raises(ValueError, match="torque that is not finite"):
        device.turn((0.0, float("nan"), 0.0), monotonic())


# --- readings


@pytest.mark.parametrize(("model", "type_", "shown"), [("sigma.7", SIGMA_7, 0xA5), ("novint_falcon", FALCON, 0x5)])
def test_readings_have_what_the_model_has(model: str, type_: int, shown: int, devices: Devices, make: Make) -> None:
    handle = devices[0].plug(type_)
    handle["x"], handle["buttons"], handle["turned_rad"] = 0.01, 0x7A5, 0.2
    device = make(model=model)
    device.open(monotonic())
    reading = device.latest(monotonic())
    assert (reading.position, reading.buttons) == ((0.01, 0.0, 0.0), shown)
    assert (reading.orientation is not None) == (model == "sigma.7")


# --- which device


def test_device_is_chosen_by_its_serial_number_and_stays_the_same(devices: Devices, make: Make) -> None:
    devices[0].plug(33, 11)
    handle = devices[1].plug(33, 12)
    said = refusal(make())
    assert "2 are plugged in, with serial numbers 11, 12; say which with master.device.serial_number" in said
    assert "the one with serial number 13 is not there, but 11, 12" in refusal(make(serial_number=13))
    device = make(serial_number=12, reconnect_s=3.0)
    device.open(monotonic())
    for serial_number in (12, 14):
        drive(device, lambda: norm(handle.wrench[0]) > 1.9, PUSH)
        handle["present"] = 0
        drive(device, lambda: device.trouble is not None and "communication error" in device.trouble, PUSH)
        handle.plug(33, serial_number)
    assert "the one with serial number 12 is not there, but 11, 14" in fault_of(device, PUSH)
    assert (devices[0]["owner"], devices[0]["sets"]) == (0, 0)


@pytest.mark.parametrize(
    ("model", "type_", "field", "value", "says"),
    [
        ("omega.3", OMEGA_3, "owner", 1, "no other program has it open (dhdOpenID: device in use)"),
        ("omega.3", LAMBDA_7, "type", LAMBDA_7, "is a lambda.7 (type 108), the file says omega.3; set master.dev"),
        ("omega.3", 999, "type", 999, "(type 999), the file says omega.3; which this driver does not know"),
        ("sigma.7", SIGMA_7, "reset", 1, "is not calibrated: bring the handle to its calibration position"),
        ("sigma.7", SIGMA_7, "wrist_init", 0, "the wrist is not calibrated: bring the handle"),
    ],
)
def test_device_that_cannot_be_used_is_refused(
    model: str, type_: int, field: str, value: int, says: str, devices: Devices, make: Make
) -> None:
    handle = devices[0].plug(type_)
    handle[field] = value
    assert says in refusal(make(model=model))
    assert (handle["force_on"], handle["enables"]) == (0, 0)
    assert handle["owner"] == (value if field == "owner" else 0)


def test_missing_or_wrong_library_is_said_in_one_line(
    make: Make, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("FDSDK", "FORCEDIM_SDK", "HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    if not list(Path("/usr/local/lib").glob("libd[hr]d.so*")):
        assert "get the SDK from forcedimension.com, and set the environment" in refusal(make(library=None))
    assert "the maker's library cannot be loaded: " in refusal(make(library=str(tmp_path / "none.so")))
    assert "has no dhdErrorGetLastStr: install a newer SDK" in refusal(make(library="libm.so.6"))
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    folder = tmp_path / "lib" / "release" / "lin-x86_64-gcc"
    folder.mkdir(parents=True)
    for name in ("libdrd.so.3.17.1", "libdhd.so.3.9.1", "libdhd.so.3.17.1", "libdhd.a"):
        (folder / name).touch()
    assert find() == str(folder / "libdhd.so.3.17.1"), "the newest"
