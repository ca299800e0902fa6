"""The drivers against devices that are wired as the published hosts have them: position and force, in virtual time."""

from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.polhem.options import PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS, Board, MechanismParameters
from weberlink.master.devices.polhem.protocol import LONG, SHORT, decode_sensors, encode_command
from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions
from weberlink.master.emulators.polhem.host_wiring import HOST_WIRINGS, Host
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0, "hand": {"stiffness_n_m": 3000.0}}
FORCES: tuple[Vector, ...] = ((0.8, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 0.8))
ALL = [(host, wire, name) for (host, wire), sets in HOST_WIRINGS.items() for name in sets]

Device = PolhemHidEmulator | PolhemSerialEmulator


def device(host: Host, wire: Board, name: str, **options: Any) -> Device:
    options = {"handle": STILL, "parameters": name, **options}
    if wire == "serial":
        return PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate(options))
    options |= {"host": host, "report": LONG if wire == "hid14" else SHORT}
    return PolhemHidEmulator(PolhemHidEmulatorOptions.model_validate(options))


def driver(wire: Board, name: str, **options: Any) -> MechanismParameters:
    """What a driver makes of the set where the file says nothing of signs."""
    if wire == "serial":
        return PolhemSerialOptions.model_validate({"parameters": name, **options}).wired("woodenhaptics")
    report = LONG if wire == "hid14" else SHORT
    return PolhemHidOptions.model_validate({"parameters": name, "report_bytes": report, **options}).wired()


def command(emulator: Device, currents: tuple[int, int, int], now: float) -> tuple[float, tuple[int, ...]]:
    """Currents to the device; gives the time afterwards and the counts that it reports."""
    if isinstance(emulator, PolhemSerialEmulator):
        emulator.receive(b"[%d,%d,%d]\n" % currents, now)
    else:
        emulator.receive(encode_command(currents, emulator.identity.report_size), now)
    answers: list[bytes] = []
    for _ in range(20):
        now += 0.00025
        emulator.advance(now)
        answers += emulator.replies(now)
    if isinstance(emulator, PolhemSerialEmulator):
        return now, tuple(map(int, answers[-1].strip(b"[]\n").split(b",")))[1:4]
    return now, decode_sensors(answers[-1]).counts[:3]


def carried(emulator: Device, axis: int, way_mm: float) -> tuple[float, tuple[int, ...]]:
    """The handle that far along an axis from the middle: the time, and the counts there."""
    now = 100.0
    emulator.advance(now)
    emulator.inject(f"{'xyz'[axis]}_mm", way_mm)
    while now < 102.0:
        now += 0.005
        emulator.advance(now)
        emulator.replies(now)
    return command(emulator, (0, 0, 0), now)


@pytest.mark.parametrize(("host", "wire", "name"), ALL)
@pytest.mark.parametrize("axis", range(3))
def test_positions_are_those_of_the_hand(host: Host, wire: Board, name: str, axis: int) -> None:
    _, counts = carried(device(host, wire, name), axis, 25.0)
    x, y, z = (0.025 * (axis == each) for each in range(3))
    assert distance(driver(wire, name).mechanism.position(counts), (x, y, z)) < 5e-4


def felt(emulator: Device, parameters: MechanismParameters, force: Vector) -> Vector:
    """What the hand feels when the driver is told to push with `force`."""
    now, counts = carried(emulator, 2, 0.0)
    command(emulator, parameters.mechanism.limited_currents_ma(force, counts, 5.0, 3000.0), now)
    return emulator.force


@pytest.mark.parametrize(("host", "wire", "name"), ALL)
@pytest.mark.parametrize("force", FORCES, ids="xyz")
def test_forces_are_felt_where_they_are_commanded(host: Host, wire: Board, name: str, force: Vector) -> None:
    options = {"motor_directions": (1, 1, 1)} if (host, wire) == ("haptikfabrikenapi", "hid8") else {}
    assert distance(felt(device(host, wire, name), driver(wire, name, **options), force), force) < 0.03


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_encoder_and_motor_signs_are_independent(signs: tuple[int, int, int]) -> None:
    name = "woodenhaptics_2015"
    published = driver("hid8", name).mechanism.drive.wiring

    def turned(what: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(a * b for a, b in zip(what, signs, strict=True))

    encoders = {
        "encoder_directions": turned(published.encoder),
        "home_counts": turned(published.home_counts),
    }
    motors = {"motor_directions": turned(published.motor)}
    for what, options in (("encoder_signs", encoders), ("motor_signs", motors)):
        for force in FORCES:
            emulator = device("woody_experimental", "hid8", name, **{what: signs})
            assert distance(felt(emulator, driver("hid8", name, **options), force), force) < 0.03


@pytest.mark.parametrize("name", [name for name, each in PARAMETERS.items() if each.mechanism.linkage.masses])
def test_the_weight_of_the_links_is_carried(name: str) -> None:
    """At rest the hand feels the links without it, and nearly nothing with it."""
    emulator = device("hfabapi", "serial", name, weight=True)
    mechanism = driver("serial", name).mechanism
    now, counts = carried(emulator, 0, 20.0)
    assert emulator.force[2] < -0.3
    for carry in (False, True):
        force = mechanism.carrying_force(counts) if carry else ZERO
        now, _ = command(emulator, mechanism.limited_currents_ma(force, counts, 5.0, 3000.0), now)
        assert (norm(emulator.force) < 0.02) == carry
