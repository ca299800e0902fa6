"""Signs and home counts of the Polhem boards: those of the published hosts, and a device with its driver.

The table uses the terms of its sources (flags, calibration counts) and is independent of `parameters.yaml`:

- `hfabapi` (forsslund/hfabapi, 2026-06-10, serial): configurations in hfab_math.h, home counts in hfab_api.cpp.
- `haptikfabrikenapi` (forsslund/haptikfabrikenapi, 2021-06-10): configurations in haptikfabrikenapi.h; its USB thread
  takes the counts of 14-byte boards as they are, and negates those of 8-byte boards.
- `woody_experimental` (WoodenHaptics/woody-experimental, 8 bytes): CWoodenDevice.cpp, getPosition and
  setForceAndTorqueAndGripperForce.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, tau
from typing import Any, Literal

import pytest

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.polhem.mechanism import CableDrive, Counts, Signs, Triple, Wiring
from weberlink.master.devices.polhem.options import PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS, Board, MechanismParameters
from weberlink.master.devices.polhem.protocol import LONG, SHORT, decode_sensors, encode_command
from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

Host = Literal["hfabapi", "haptikfabrikenapi", "woody_experimental"]


@dataclass(frozen=True)
class HostWiring:
    """A device as a host expects it.

    angle = encoder * (2 pi count / N) c / b + zero, and torque on the body = motor * torque of the motor * b / c.

    Args:
        encoder: sign of each encoder.
        motor: sign of each motor.
        zero_counts: counts that the host adds, before it multiplies by the sign of the motor.
        zero_rad: angles that the host adds [rad].
        gimbal: sign of each sensor of the gimbal.
        gimbal_zero: counts that the host adds to them.
    """

    encoder: Signs
    motor: Signs
    zero_counts: Counts = (0, 0, 0)
    zero_rad: Triple = (0.0, 0.0, 0.0)
    gimbal: Signs = (1, 1, 1)
    gimbal_zero: Counts = (0, 0, 0)

    def on(self, drive: CableDrive) -> Wiring:
        """The wiring of a drive with these signs, at 0 counts in the home pose."""
        home = []
        for axis in range(3):
            per_count = tau / drive.counts_per_turn[axis] * drive.capstan_m[axis] / drive.body_m[axis]
            angle = self.motor[axis] * self.zero_counts[axis] * per_count + self.zero_rad[axis]
            home.append(round(angle / (self.encoder[axis] * per_count)))
        a, b, c = home
        return Wiring(self.encoder, self.motor, (a, b, c), self.gimbal, self.gimbal_zero)


def _flagged(
    flags: Counts,
    zero: Counts = (0, 0, 0),
    gimbal: Signs = (1, 1, 1),
    gimbal_zero: Counts = (0, 0, 0),
    *,
    negated: bool = False,
) -> HostWiring:
    """From the flags `motor_and_body_aligned` of the newer hosts; `negated` if the host negates the counts."""
    a, b, c = (-1 if flag else 1 for flag in flags)
    return HostWiring((-a, -b, -c) if negated else (a, b, c), (a, b, c), zero, gimbal=gimbal, gimbal_zero=gimbal_zero)


HOST_WIRINGS: Mapping[tuple[Host, Board], Mapping[str, HostWiring]] = {
    ("hfabapi", "serial"): {
        "woodenhaptics_2015": _flagged((0, 1, 1), (0, 0, -6000)),
        "woodenhaptics_2019": _flagged((0, 0, 0), (0, 0, 6000)),
        # getRot: roll is +count, the other two by enc_and_body_aligned (+ where it is set).
        "vintage_phantom": _flagged((1, 0, 1), (0, 7700, 0), (-1, 1, 1)),
        "polhem_v1": _flagged((1, 1, 1), (0, 0, -5000), (-1, 1, 1)),
        "polhem_v2": _flagged((0, 1, 0), (8327, -10926, 27140), (-1, -1, 1), (0, 30, 0)),
        "polhem_v3": _flagged((0, 1, 0), (8312, -10366, 19764), (-1, -1, 1), (0, 30, 0)),
    },
    ("haptikfabrikenapi", "hid14"): {
        "woodenhaptics_2015": _flagged((0, 0, 0), (0, 0, 6000)),
        "woodenhaptics_2019": _flagged((0, 0, 0), (0, 0, 6000)),  # the configuration is in hfab_math.h
        "vintage_phantom_2021": _flagged((0, 0, 0), (0, 7700, 0)),  # home pose of vintage_phantom: it names none
        # computeRotation: all three by their flags.
        "polhem_v1": _flagged((1, 1, 1), (0, 0, -5000), (-1, 1, -1)),
        "polhem_v2": _flagged((0, 1, 0), (8327, -10926, 27140), (-1, -1, -1), (0, 30, 0)),
        "polhem_v3": _flagged((0, 1, 0), (8312, -10366, 19764), (-1, -1, -1), (0, 30, 0)),
    },
    ("haptikfabrikenapi", "hid8"): {"woodenhaptics_2015": _flagged((0, 0, 0), (0, 0, 6000), negated=True)},
    ("woody_experimental", "hid8"): {
        # tA = -a, tB = -b, tC = pi/2 - c; currents +A, -B, -C.
        "woodenhaptics_2015": HostWiring((-1, -1, -1), (1, -1, -1), zero_rad=(0.0, 0.0, 0.5 * pi)),
        # With ALUHAPTICS: tA = +a, tB = pi/2 - b, tC = +c; currents +A, -B, +C.
        "aluhaptics_v2": HostWiring((1, -1, 1), (1, -1, 1), zero_rad=(0.0, 0.5 * pi, 0.0)),
    },
}

PUBLISHED = [(host, board, name) for (host, board), sets in HOST_WIRINGS.items() for name in sets]


@pytest.mark.parametrize(("host", "board", "name"), PUBLISHED)
def test_signs_and_home_counts_are_those_of_the_hosts(host: Host, board: Board, name: str) -> None:
    parameters = PARAMETERS[name]
    expected = HOST_WIRINGS[host, board][name].on(parameters.mechanism.drive)
    if (host, board) == ("haptikfabrikenapi", "hid8"):  # the other host of this board has other motors, which count
        expected = replace(expected, motor=(1, -1, -1))
    assert parameters.wirings[board] == expected


def test_every_wiring_has_a_host() -> None:
    assert {(board, name) for _, board, name in PUBLISHED} == {
        (board, name) for name, parameters in PARAMETERS.items() for board in parameters.wirings
    }


# --- a device and its driver, in virtual time

STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0, "hand": {"stiffness_n_m": 3000.0}}
FORCES: tuple[Vector, ...] = ((0.8, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 0.8))

Device = PolhemHidEmulator | PolhemSerialEmulator


def device(wire: Board, name: str, **options: Any) -> Device:
    options = {"handle": STILL, "parameters": name, **options}
    if wire == "serial":
        return PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate(options))
    options |= {"report": LONG if wire == "hid14" else SHORT}
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


def felt(emulator: Device, parameters: MechanismParameters, force: Vector) -> Vector:
    """What the hand feels when the driver is told to push with `force`."""
    now, counts = carried(emulator, 2, 0.0)
    command(emulator, parameters.mechanism.limited_currents_ma(force, counts, 5.0, 3000.0), now)
    return emulator.force


@pytest.mark.parametrize(("wire", "name"), sorted({(board, name) for _, board, name in PUBLISHED}))
def test_the_hand_is_where_the_driver_reads_it_and_feels_what_it_commands(wire: Board, name: str) -> None:
    parameters = driver(wire, name)
    for axis, force in enumerate(FORCES):
        _, counts = carried(device(wire, name), axis, 25.0)
        x, y, z = (0.025 * (axis == each) for each in range(3))
        assert distance(parameters.mechanism.position(counts), (x, y, z)) < 5e-4
        assert distance(felt(device(wire, name), parameters, force), force) < 0.03


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
            emulator = device("hid8", name, **{what: signs})
            assert distance(felt(emulator, driver("hid8", name, **options), force), force) < 0.03


@pytest.mark.parametrize("name", [name for name, each in PARAMETERS.items() if each.mechanism.linkage.masses])
def test_the_weight_of_the_links_is_carried(name: str) -> None:
    """At rest the hand feels the links without it, and nearly nothing with it."""
    emulator = device("serial", name, weight=True)
    mechanism = driver("serial", name).mechanism
    now, counts = carried(emulator, 0, 20.0)
    assert emulator.force[2] < -0.3
    for carry in (False, True):
        force = mechanism.carrying_force(counts) if carry else ZERO
        now, _ = command(emulator, mechanism.limited_currents_ma(force, counts, 5.0, 3000.0), now)
        assert (norm(emulator.force) < 0.02) == carry
