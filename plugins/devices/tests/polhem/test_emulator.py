"""The emulated boards of the Polhem and their driver, in virtual time: signs, forces, and the weight of the links."""

from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.polhem.mechanism import Board, Counts, Mechanism, Signs
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.protocol import LONG, SHORT, decode_sensors, encode_command
from weberlink.testing.devices import armed, drive
from weberlink.testing.serving import PtyDevice
from weberlink.testing.time import until
from weberlink_devices.polhem.emulator import (
    PolhemHidEmulator,
    PolhemHidEmulatorOptions,
    PolhemSerialEmulator,
    PolhemSerialEmulatorOptions,
)

SETS = [(board, name) for name, parameters in PARAMETERS.items() for board in parameters.wirings]
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


@pytest.mark.parametrize("checked", [True, False])
def test_weight_is_carried_only_while_loop_commands(tmp_path: Path, checked: bool) -> None:
    options = {"model": "polhem", "handle": STILL, "weight": True}
    emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate(options))
    with PtyDevice(emulator, tmp_path / "heavy") as pty:
        device: Any = armed(
            "polhem_serial", port=str(pty.path), model="polhem", gravity_compensation=True, checked=checked
        )
        device.open(monotonic())
        assert emulator.currents_ma == (0.0, 0.0, 0.0)
        messages = emulator.messages
        if checked:
            drive(device, lambda: norm(emulator.force) < 0.03)
            until(lambda: emulator.currents_ma == (0.0, 0.0, 0.0), "the end of the force of a silent loop")
            drive(device, lambda: emulator.currents_ma != (0.0, 0.0, 0.0))
        else:
            drive(device, lambda: emulator.messages > messages + 80)
            assert emulator.currents_ma == (0.0, 0.0, 0.0)
        device.close()
        until(lambda: emulator.currents_ma == (0.0, 0.0, 0.0), "the end of the force")
