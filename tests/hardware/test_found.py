"""What is plugged in, and which of it is meant."""

import pytest

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.found import Found, UsbId, hid_devices, only, serial_ports

ONE = Found("/dev/ttyACM0", "Teensy", "1234")
TWO = Found("/dev/ttyACM1")


def test_the_only_one_is_meant() -> None:
    assert only([ONE], "arm", "slave.robot.port") is ONE


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([], "arm: nothing of the kind is plugged in; `weberlink devices` lists what there is"),
        (
            [ONE, TWO],
            "arm: 2 are plugged in: /dev/ttyACM0 Teensy (serial number 1234), /dev/ttyACM1; "
            "say which with slave.robot.port: /dev/ttyACM0",
        ),
        ([Found("/dev/ttyACM2", problem="it is on fire")], "arm: /dev/ttyACM2: it is on fire"),
    ],
    ids=["none", "two", "problem"],
)
def test_otherwise_one_line_says_what_is_the_matter(found: list[Found], said: str) -> None:
    with pytest.raises(HardwareFault) as fault:
        only(found, "arm", "slave.robot.port")
    assert str(fault.value) == said


def test_an_identity_is_of_a_product_or_of_all_of_a_vendor() -> None:
    product, vendor = UsbId(0x16C0, 0x0483), UsbId(0x16C0)
    assert product.matches(0x16C0, 0x0483)
    assert not product.matches(0x16C0, 0x0486)
    assert not product.matches(0x1234, 0x0483)
    assert vendor.matches(0x16C0, 0x0486)
    assert not vendor.matches(None, None), "a port that is no USB device"
    assert [str(product), str(vendor)] == ["16c0:0483", "16c0:any"]


def test_nothing_is_found_of_a_vendor_that_does_not_exist() -> None:
    nobody = (UsbId(0xFFFF, 0xFFFF),)
    assert serial_ports(nobody) == []
    assert hid_devices(nobody) == []
    assert serial_ports(()) == hid_devices(()) == []
