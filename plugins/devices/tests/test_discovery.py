"""What is plugged in of the kernel's input layer, and what a library reaches by libusb."""

from pathlib import Path

from weberlink.hardware.discovery import UsbId
from weberlink_devices.discovery import input_devices, usb_devices


def test_usb_device_is_listed_by_its_node(tmp_path: Path) -> None:
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
