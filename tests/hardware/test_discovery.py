"""What is plugged in, and which of it is meant."""

from pathlib import Path

import pytest

from weberlink.hardware.discovery import DeviceLocator, PluggedDevice, UsbId, by_path, hid_devices, only, serial_ports
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.polhem.serial_device import teensys

ONE = PluggedDevice("/dev/ttyACM0", "Teensy", "1234")
TWO = PluggedDevice("/dev/ttyACM1", "Teensy", "5678")


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([], "arm: nothing of the kind is plugged in; `weberlink device list` lists what there is"),
        (
            [ONE, TWO],
            "arm: 2 are plugged in: /dev/ttyACM0 Teensy (serial number 1234), /dev/ttyACM1 Teensy (serial number "
            "5678); say which with slave.robot.port: /dev/ttyACM0",
        ),
        ([PluggedDevice("/dev/ttyACM2", problem="it is on fire")], "arm: /dev/ttyACM2: it is on fire"),
    ],
    ids=["none", "two", "problem"],
)
def test_only_complains_in_one_line(found: list[PluggedDevice], said: str) -> None:
    assert only([ONE], "arm", "slave.robot.port") is ONE
    with pytest.raises(HardwareFault) as fault:
        only(found, "arm", "slave.robot.port")
    assert str(fault.value) == said


@pytest.mark.parametrize("seen", [(0x16C0, 0x0483), (0x16C0, 0x0486), (0x1234, 0x0483), (None, None)])
def test_identity_matches_product_or_whole_vendor(seen: tuple[int, int]) -> None:  # a port that is no USB device: None
    assert UsbId(0x16C0, 0x0483).matches(*seen) == (seen == (0x16C0, 0x0483))
    assert UsbId(0x16C0).matches(*seen) == (seen[0] == 0x16C0)


def test_only_a_device_file_that_may_not_be_opened_is_a_problem() -> None:
    """Not what has no file, such as a device that a library opens by the place where it is plugged in."""
    found = by_path([("1-2:1.0", None, None), ("/dev/no-such", "Teensy", "1234"), ("/dev/null", "Null", None)])
    assert found[1:] == [PluggedDevice("/dev/null", "Null", ""), PluggedDevice("1-2:1.0", "", "")]
    assert found[0].problem is not None and "no permission to open /dev/no-such" in found[0].problem


def test_nothing_of_an_unknown_identity_is_listed() -> None:
    nobody = (UsbId(0xFFFF, 0xFFFF),)
    assert serial_ports(nobody) == hid_devices(nobody) == serial_ports(()) == hid_devices(()) == []


def test_a_named_port_is_taken_and_another_device_noticed_until_forgotten() -> None:
    assert DeviceLocator("arm", "/dev/ttyACM1", lambda: (ONE, TWO)).locate() == "/dev/ttyACM1"
    assert DeviceLocator("arm", "/anywhere/emulated", tuple).locate() == "/anywhere/emulated"
    there = [ONE]
    locator = DeviceLocator("arm", None, lambda: there)
    assert locator.locate() == ONE.path
    there[0] = TWO
    with pytest.raises(HardwareFault, match="another one than before, which had serial number 1234"):
        locator.locate()
    locator.forget()
    assert locator.locate() == TWO.path


def test_teensys_are_preferred_among_many_alike(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM1"
    (tmp_path / "usb-Teensyduino_USB_Serial_123-if00").symlink_to(port)
    other, theirs = PluggedDevice(str(tmp_path / "ttyACM0")), PluggedDevice(str(port))
    assert teensys([other, theirs], tmp_path) == [theirs]
    assert teensys([other], tmp_path / "missing") == [other]
    named = PluggedDevice("/dev/ttyX", "Teensy 4.0")
    assert teensys([other, named], tmp_path / "missing") == [named]
