"""Which device it is, from what is plugged in."""

from pathlib import Path

import pytest

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.found import Found
from weberlink.master.devices.polhem.identity import Identity, located
from weberlink.master.devices.polhem.serial_device import teensys

ONE, OTHER = Found("/dev/ttyX1", "USB Serial", "111"), Found("/dev/ttyX2", "USB Serial", "222")


def identity(*there: Found, port: str | None = None) -> Identity:
    return Identity("polhem_serial", port, lambda: there)


def test_the_only_one_is_taken() -> None:
    problem = Found("/nowhere/tty", problem=None)
    assert identity(problem).locate() == "/nowhere/tty"


@pytest.mark.parametrize(
    ("there", "complaint"),
    [
        ((), "polhem_serial: nothing of the kind is plugged in"),
        ((ONE, OTHER), "2 are plugged in.*say which with master.device.port: /dev/ttyX1"),
        ((Found("/dev/ttyX1", problem="no permission to open it"),), "no permission"),
    ],
)
def test_none_two_alike_and_no_permission(there: tuple[Found, ...], complaint: str) -> None:
    with pytest.raises(HardwareFault, match=complaint) as fault:
        identity(*there).locate()
    assert "\n" not in str(fault.value)


def test_a_named_port_is_taken_whatever_else_there_is() -> None:
    assert identity(ONE, OTHER, port="/dev/ttyX2").locate() == "/dev/ttyX2"
    assert identity(port="/anywhere/emulated").locate() == "/anywhere/emulated"


def test_another_one_in_its_place_is_noticed_until_it_is_forgotten() -> None:
    there = [ONE]
    which = Identity("polhem_serial", None, lambda: there)
    which.locate()
    there[0] = OTHER
    with pytest.raises(HardwareFault, match="another one than before, which had serial number 111"):
        which.locate()
    which.forget()
    assert which.locate() == OTHER.path


def test_of_many_alike_the_teensys_are_preferred(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM1"
    port.touch()
    (tmp_path / "usb-Teensyduino_USB_Serial_123-if00").symlink_to(port)
    (tmp_path / "usb-Somebody_Else_9-if00").symlink_to(tmp_path / "ttyACM0")
    other, theirs = Found(str(tmp_path / "ttyACM0")), Found(str(port.resolve()))
    assert teensys([other, theirs], tmp_path) == [theirs]
    assert teensys([other], tmp_path) == [other]
    assert teensys([other], tmp_path / "missing") == [other]
    assert teensys([other, Found("/dev/ttyX", "Teensy 4.0")], tmp_path / "missing")[0].name == "Teensy 4.0"


def test_a_complaint_has_its_path_once() -> None:
    assert str(located("/dev/x", HardwareFault("unplugged"))) == "/dev/x: unplugged"
    assert str(located("/dev/x", HardwareFault("/dev/x: unplugged"))) == "/dev/x: unplugged"
