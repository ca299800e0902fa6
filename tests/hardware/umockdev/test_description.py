"""The texts that umockdev is given."""

from weberlink.hardware.umockdev.description import HidIdentity, description, ioctls, paths

IDENTITY = HidIdentity(0x1234, 0x0006, "HID DEVICE", bytes.fromhex("06abffc0"), 14, "42", "mbed.org")


def test_each_thing_is_within_the_one_before_and_named_as_the_kernel_names_it() -> None:
    usb, interface, hid, node = paths(IDENTITY, 3, 26)
    assert interface == f"{usb}/1-26:1.0"
    assert hid == f"{interface}/0003:1234:0006.001A"
    assert node == f"{hid}/hidraw/hidraw3"


def test_the_description_has_what_hidapi_looks_for() -> None:
    text = description(IDENTITY, 3, 26)
    assert [line[3:] for line in text.splitlines() if line.startswith("P: ")] == list(paths(IDENTITY, 3, 26))
    lines = set(text.splitlines())
    assert {"A: idVendor=1234", "A: idProduct=0006", "A: product=HID DEVICE", "A: serial=42"} <= lines
    assert {"E: HID_ID=0003:00001234:00000006", "E: HID_UNIQ=42", "E: HID_NAME=mbed.org HID DEVICE"} <= lines
    assert {"E: DEVNAME=/dev/hidraw3", "E: SUBSYSTEM=hidraw", "E: MINOR=3"} <= lines
    assert not any(line.startswith("N: ") for line in lines), "nodes are ours to make and to take away"


def test_a_device_without_serial_number_has_no_such_attribute() -> None:
    text = description(HidIdentity(1, 2, "X", b"", 8), 0, 1)
    assert "A: serial" not in text
    assert "A: manufacturer" not in text


def test_the_report_descriptor_is_given_with_its_size_as_the_kernel_pads_it() -> None:
    node, size, whole = ioctls(IDENTITY, 3).splitlines()
    assert node == "@DEV /dev/hidraw3"
    assert size == "HIDIOCGRDESCSIZE 0 04000000"
    kind, _, data = whole.split()
    assert kind == "HIDIOCGRDESC"
    assert bytes.fromhex(data) == b"\4\0\0\0\x06\xab\xff\xc0" + bytes(4092)
