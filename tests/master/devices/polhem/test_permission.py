"""Force only with signs that were checked, and checked with just these settings."""

from typing import Any

import pytest
from pydantic import ValidationError

from weberlink.master.devices.polhem.hid_device import PolhemHidDevice
from weberlink.master.devices.polhem.options import PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.serial_device import PolhemSerialDevice

TICK = 0.001
HID, SERIAL = PolhemHidOptions, PolhemSerialOptions


def hid(**settings: Any) -> PolhemHidDevice:
    return PolhemHidDevice(HID(**settings), TICK)


def serial(**settings: Any) -> PolhemSerialDevice:
    return PolhemSerialDevice(SERIAL(**settings), TICK)


def test_without_a_check_there_is_no_force_and_the_note_says_how_to_make_one() -> None:
    for device, name in ((hid(), "polhem_hid"), (serial(model="polhem"), "polhem_serial")):
        assert (device.spec.force_n, device.spec.force_feedback) == (0.0, False)
        assert f"no force: signs not checked; run: weberlink device test {name}" in device.spec.note


def test_with_a_check_there_is_the_published_force_or_less() -> None:
    signs = PolhemHidDevice.fingerprint(HID())
    assert hid(signs_checked=signs).spec.force_n == 5.0
    assert hid(signs_checked=signs).spec.force_feedback
    assert hid(signs_checked=signs, force_n=1.5).spec.force_n == 1.5
    signs = PolhemSerialDevice.fingerprint(SERIAL(model="woodenhaptics"))
    assert serial(model="woodenhaptics", signs_checked=signs).spec.force_n == 5.0


def test_the_check_is_of_these_settings_alone() -> None:
    settings: list[dict[str, Any]] = [
        {},
        {"encoder_directions": (1, -1, 1)},
        {"motor_directions": (1, -1, 1)},
        {"directions": (1, -1, 1)},
        {"report_bytes": 8},
        {"home_counts": (0, 0, -5999)},
        {"parameters": "woodenhaptics_2019"},
        {"parameters": "polhem_v3"},
    ]
    prints = [PolhemHidDevice.fingerprint(HID(**each)) for each in settings]
    prints += [PolhemSerialDevice.fingerprint(SERIAL(model=model)) for model in ("woodenhaptics", "polhem", "auto")]
    assert len(set(prints)) == len(prints)
    stale = hid(signs_checked=prints[0], motor_directions=(1, -1, 1))
    assert not stale.spec.force_feedback
    assert "signs not checked with these settings" in stale.spec.note


def test_what_has_no_say_in_signs_keeps_the_check() -> None:
    signs = PolhemHidDevice.fingerprint(HID())
    assert signs == PolhemHidDevice.fingerprint(HID(force_n=2.0, port="/dev/hidraw9", homing="at_open"))
    # Said explicitly, the published ones are still those.
    assert signs == PolhemHidDevice.fingerprint(HID(directions=(1, 1, 1), home_counts=(0, 0, 6000)))


def test_a_fingerprint_is_eight_digits_that_yaml_takes_for_a_text() -> None:
    for count in range(50):
        signs = PolhemHidDevice.fingerprint(HID(home_counts=(count, 0, 0)))
        assert len(signs) == 8
        assert signs[0] in "abcdef"
        assert HID(signs_checked=signs).signs_checked == signs


def test_a_device_that_was_only_guessed_has_no_force() -> None:
    signs = PolhemSerialDevice.fingerprint(SERIAL(model="auto"))
    device = serial(model="auto", signs_checked=signs)
    assert not device.spec.force_feedback
    assert "set master.device.model" in device.spec.note
    assert not device.spec.orientation


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"signs_checked": "12"}, "signs_checked"),
        ({"directions": (1, 0, 1)}, "directions"),
        ({"max_current_ma": 6001.0}, "max_current_ma"),
        ({"max_current_ma": 0.0}, "max_current_ma"),
        ({"speed": 1.0}, "speed"),
        ({"force_n": float("nan")}, "force_n"),
    ],
)
def test_options_that_make_no_sense(settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        SERIAL(**settings)


def test_more_force_than_is_published_is_refused() -> None:
    with pytest.raises(ValueError, match="force_n: expected at most 5 N"):
        hid(force_n=6.0)


def test_specs_before_opening() -> None:
    device = serial(model="polhem")
    assert (device.spec.name, device.spec.axes, device.spec.buttons) == ("polhem_serial", "xyz", 0)
    assert device.spec.orientation
    assert device.spec.stiffness_n_m == 2000.0
    assert hid().spec.buttons == 1
    assert (device.spec.watchdog_s, hid().spec.watchdog_s) == (0.1, 0.5)
    assert not hid().spec.orientation
    assert "hold the handle in its home pose" in hid(homing="at_open").spec.note
    assert "12 times" in hid(parameters="woodenhaptics_2019").spec.note
