"""Every emulated device of the table has what a person needs to choose and to break it."""

from collections.abc import Mapping

import pytest

from weberlink.hardware.emulator import WireFaults
from weberlink.master import devices
from weberlink.master.devices import leaders
from weberlink.master.emulators import EMULATORS, load

every_emulator = pytest.mark.parametrize("name", sorted(EMULATORS))


@every_emulator
def test_emulator_is_named_like_its_driver(name: str) -> None:
    assert name in {**devices.drivers(), **leaders.drivers()}


@every_emulator
def test_emulator_names_transport_and_faults(name: str) -> None:
    emulator_class = load(name)
    assert emulator_class.transport in ("serial", "hid", "evdev", "websocket")
    assert isinstance(emulator_class.OWN_FAULTS, Mapping)
    assert all(word.isidentifier() and what for word, what in emulator_class.OWN_FAULTS.items())
    emulator = emulator_class(emulator_class.Options())
    assert emulator.faults == WireFaults()
    assert hasattr(emulator, "identity") == (emulator_class.transport in ("hid", "evdev"))


@every_emulator
def test_named_faults_happen_and_others_raise(name: str) -> None:
    emulator_class = load(name)
    emulator = emulator_class(emulator_class.Options())
    for word in emulator_class.OWN_FAULTS:
        emulator.inject(word, 1.0)
    emulator.advance(1.0)
    emulator.advance(2.0)
    with pytest.raises(ValueError, match="flood"):
        emulator.inject("flood", 1.0)


@every_emulator
def test_unknown_options_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="colour"):
        load(name).Options(colour="red")


def test_an_unknown_device_names_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"'polhem_cereal'.*'polhem_serial'"):
        load("polhem_cereal")
