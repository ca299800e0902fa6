"""Signs and home counts of the Polhem boards: those of the published hosts, and a device with its driver.

The table uses the terms of its sources (flags, calibration counts) and is independent of `parameters.yaml`:

- `hfabapi` (forsslund/hfabapi, 2026-06-10, serial): configurations in hfab_math.h, home counts in hfab_api.cpp.
- `haptikfabrikenapi` (forsslund/haptikfabrikenapi, 2021-06-10): configurations in haptikfabrikenapi.h; its USB thread
  takes the counts of 14-byte boards as they are, and negates those of 8-byte boards.
- `woody_experimental` (WoodenHaptics/woody-experimental, 8 bytes): CWoodenDevice.cpp, getPosition and
  setForceAndTorqueAndGripperForce.
"""

from math import pi, tau
from typing import Any, NamedTuple

import pytest

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.polhem.mechanism import Board, Counts, Mechanism, Signs, Triple, Wiring
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.protocol import LONG, SHORT, decode_sensors, encode_command
from weberlink.master.emulators.polhem.boards import (
    PolhemHidEmulator,
    PolhemHidEmulatorOptions,
    PolhemSerialEmulator,
    PolhemSerialEmulatorOptions,
)


class Host(NamedTuple):
    """angle = encoder * (2 pi count / N) c / b + zero, and torque on the body = motor * torque of the motor * b / c.

    `zero_counts` are added before the host multiplies by the sign of the motor, `zero_rad` afterwards.
    """

    encoder: Signs
    motor: Signs
    zero_counts: Counts = (0, 0, 0)
    zero_rad: Triple = (0.0, 0.0, 0.0)
    gimbal: Signs = (1, 1, 1)
    gimbal_zero: Counts = (0, 0, 0)


def flagged(
    flags: str, zero: Counts, gimbal: Signs = (1, 1, 1), gimbal_zero: Counts = (0, 0, 0), sign: int = 1
) -> Host:
    """From the flags `motor_and_body_aligned` of the newer hosts, which may multiply the counts by a `sign`."""
    a, b, c = (-1 if flag == "1" else 1 for flag in flags)
    return Host((sign * a, sign * b, sign * c), (a, b, c), zero, gimbal=gimbal, gimbal_zero=gimbal_zero)


PUBLISHED: dict[tuple[str, Board, str], Host] = {
    ("hfabapi", "serial", "woodenhaptics_2015"): flagged("011", (0, 0, -6000)),
    ("hfabapi", "serial", "woodenhaptics_2019"): flagged("000", (0, 0, 6000)),
    # getRot: roll is +count, the other two by enc_and_body_aligned (+ where it is set).
    ("hfabapi", "serial", "vintage_phantom"): flagged("101", (0, 7700, 0), (-1, 1, 1)),
    ("hfabapi", "serial", "polhem_v1"): flagged("111", (0, 0, -5000), (-1, 1, 1)),
    ("hfabapi", "serial", "polhem_v2"): flagged("010", (8327, -10926, 27140), (-1, -1, 1), (0, 30, 0)),
    ("hfabapi", "serial", "polhem_v3"): flagged("010", (8312, -10366, 19764), (-1, -1, 1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid14", "woodenhaptics_2015"): flagged("000", (0, 0, 6000)),
    # The configuration is in hfab_math.h.
    ("haptikfabrikenapi", "hid14", "woodenhaptics_2019"): flagged("000", (0, 0, 6000)),
    # The home pose is that of vintage_phantom: it names none.
    ("haptikfabrikenapi", "hid14", "vintage_phantom_2021"): flagged("000", (0, 7700, 0)),
    # computeRotation: all three by their flags.
    ("haptikfabrikenapi", "hid14", "polhem_v1"): flagged("111", (0, 0, -5000), (-1, 1, -1)),
    ("haptikfabrikenapi", "hid14", "polhem_v2"): flagged("010", (8327, -10926, 27140), (-1, -1, -1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid14", "polhem_v3"): flagged("010", (8312, -10366, 19764), (-1, -1, -1), (0, 30, 0)),
    ("haptikfabrikenapi", "hid8", "woodenhaptics_2015"): flagged("000", (0, 0, 6000), sign=-1),
    # tA = -a, tB = -b, tC = pi/2 - c; currents +A, -B, -C.
    ("woody_experimental", "hid8", "woodenhaptics_2015"): Host((-1, -1, -1), (1, -1, -1), zero_rad=(0, 0, 0.5 * pi)),
    # With ALUHAPTICS: tA = +a, tB = pi/2 - b, tC = +c; currents +A, -B, +C.
    ("woody_experimental", "hid8", "aluhaptics_v2"): Host((1, -1, 1), (1, -1, 1), zero_rad=(0, 0.5 * pi, 0)),
}
SETS = [(board, name) for name, parameters in PARAMETERS.items() for board in parameters.wirings]


def test_signs_and_home_counts_are_those_of_the_hosts() -> None:
    for (name_of_host, board, name), host in PUBLISHED.items():
        drive, home = PARAMETERS[name], list[int]()
        for axis in range(3):
            per_count = tau / drive.counts_per_turn[axis] * drive.capstan_m[axis] / drive.body_m[axis]
            angle = host.motor[axis] * host.zero_counts[axis] * per_count + host.zero_rad[axis]
            home.append(round(angle / (host.encoder[axis] * per_count)))
        a, b, c = home
        # Of the two hosts of the 8-byte board, the motors of the other count.
        motor = (1, -1, -1) if (name_of_host, board) == ("haptikfabrikenapi", "hid8") else host.motor
        expected = Wiring(host.encoder, motor, (a, b, c), host.gimbal, host.gimbal_zero)
        assert PARAMETERS[name].wirings[board] == expected, (name_of_host, board, name)
    assert {(board, name) for _, board, name in PUBLISHED} == set(SETS)


# --- a device and its driver, in virtual time

STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0, "hand": {"stiffness_n_m": 3000.0}}
FORCES: tuple[Vector, ...] = ((0.8, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 0.8))


class Rig:
    """An emulated device, and what its driver makes of the set where the file says no more than `told`."""

    def __init__(self, board: Board, name: str, told: dict[str, Any] | None = None, **options: Any) -> None:
        options, told = {"handle": STILL, "parameters": name, **options}, {"parameters": name, **(told or {})}
        self.emulator: Any
        self.parameters: Mechanism
        if board == "serial":
            self.emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate(options))
            self.parameters = PolhemSerialOptions.model_validate(told).wired("woodenhaptics")
        else:
            size = LONG if board == "hid14" else SHORT
            self.emulator = PolhemHidEmulator(PolhemHidEmulatorOptions.model_validate(options | {"report": size}))
            self.parameters = PolhemHidOptions.model_validate(told | {"report_bytes": size}).wired()
        self.now = 100.0
        self.emulator.advance(self.now)

    def command(self, currents: Counts) -> tuple[int, ...]:
        """Currents to the device; gives the counts that it reports."""
        serial, answers = isinstance(self.emulator, PolhemSerialEmulator), list[bytes]()
        size = 0 if serial else self.emulator.identity.report_size
        self.emulator.receive(b"[%d,%d,%d]\n" % currents if serial else encode_command(currents, size), self.now)
        for _ in range(20):
            self.now += 0.00025
            self.emulator.advance(self.now)
            answers += self.emulator.replies(self.now)
        if serial:
            return tuple(map(int, answers[-1].strip(b"[]\n").split(b",")))[1:4]
        return decode_sensors(answers[-1]).counts[:3]

    def carry(self, axis: int, way_mm: float) -> tuple[int, ...]:
        """The handle that far along an axis from the middle; gives the counts there."""
        self.emulator.inject(f"{'xyz'[axis]}_mm", way_mm)
        until = self.now + 2.0
        while self.now < until:
            self.now += 0.005
            self.emulator.advance(self.now)
            self.emulator.replies(self.now)
        return self.command((0, 0, 0))

    def felt(self, force: Vector) -> Vector:
        """What the hand feels in the middle when the driver is told to push."""
        counts = self.carry(2, 0.0)
        self.command(self.parameters.limited_currents_ma(force, counts, 5.0, 3000.0))
        felt: Vector = self.emulator.force
        return felt


@pytest.mark.parametrize(("board", "name"), SETS)
def test_the_hand_is_where_the_driver_reads_it_and_feels_what_it_commands(board: Board, name: str) -> None:
    rig = Rig(board, name)
    for axis, force in enumerate(FORCES):
        x, y, z = (0.025 * (axis == each) for each in range(3))
        assert distance(rig.parameters.position(rig.carry(axis, 25.0)), (x, y, z)) < 5e-4
        assert distance(rig.felt(force), force) < 0.03


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_encoder_and_motor_signs_are_independent(signs: Signs) -> None:
    name = "woodenhaptics_2015"
    published = PARAMETERS[name].wirings["hid8"]
    encoder, motor, home = (
        tuple(a * b for a, b in zip(what, signs, strict=True))
        for what in (published.encoder, published.motor, published.home_counts)
    )
    for option, told in (
        ("encoder_signs", {"encoder_directions": encoder, "home_counts": home}),
        ("motor_signs", {"motor_directions": motor}),
    ):
        rig = Rig("hid8", name, told, **{option: signs})
        assert all(distance(rig.felt(force), force) < 0.03 for force in FORCES)


@pytest.mark.parametrize(
    "name", [name for board, name in SETS if board == "serial" and PARAMETERS[name].linkage.masses]
)
def test_the_weight_of_the_links_is_felt_at_rest_unless_it_is_carried(name: str) -> None:
    rig = Rig("serial", name, weight=True)
    mechanism = rig.parameters
    counts = rig.carry(0, 20.0)
    assert rig.emulator.force[2] < -0.3
    for force, is_carried in ((ZERO, False), (mechanism.carrying_force(counts), True)):
        rig.command(mechanism.limited_currents_ma(force, counts, 5.0, 3000.0))
        assert (norm(rig.emulator.force) < 0.02) == is_carried
