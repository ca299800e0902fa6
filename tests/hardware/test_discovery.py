"""What is plugged in, and which of it is meant."""

from pathlib import Path

import pytest

from weberlink.hardware.discovery import (
    DeviceLocator,
    PluggedDevice,
    UsbId,
    hid_devices,
    input_devices,
    only,
    serial_ports,
    usb_devices,
)
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


def test_usb_device_is_listed_by_its_node(tmp_path: Path) -> None:
    nobody = (UsbId(0xFFFF, 0xFFFF),)
    assert serial_ports(nobody) == hid_devices(nobody) == serial_ports(()) == hid_devices(()) == []
    root = {"idVendor": "1d6b", "idProduct": "0002", "busnum": "1", "devnum": "1"}
    omega = {"idVendor": "1451", "idProduct": "0402", "busnum": "1", "devnum": "24", "product": "omega.x"}
    for folder, attributes in {"usb1": root, "1-5": omega, "1-5:1.0": {"bInterfaceNumber": "00"}}.items():
        (tmp_path / folder).mkdir()
        for name, value in attributes.items():
            (tmp_path / folder / name).write_text(f"{value}\n")
    (found,) = usb_devices([UsbId(0x1451)], tmp_path)
    assert (found.path, found.name, found.serial_number) == ("/dev/bus/usb/001/024", "omega.x", "")
    assert found.problem is not None
    assert found.problem.startswith("no permission to open /dev/bus/usb/001/024; ")
    assert usb_devices([UsbId(0x1451, 0x0403)], tmp_path) == usb_devices([UsbId(0x1451)], tmp_path / "none") == []


KEY = 0x130


def test_input_devices_are_found_by_their_keys(tmp_path: Path) -> None:
    for number, bits in ((3, f"{1 << KEY % 64:x} 0 0 0 0"), (1, "1 0"), (2, "")):
        device = tmp_path / f"event{number}" / "device"
        (device / "capabilities").mkdir(parents=True)
        (device / "name").write_text("A Pad\n")
        (device / "capabilities" / "key").write_text(bits + "\n")
    assert [(each.path, each.name) for each in input_devices(KEY, tmp_path)] == [("/dev/input/event3", "A Pad")]
    assert input_devices(KEY + 1, tmp_path) == []


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
