"""The published parameter sets of the mechanisms, read from `parameters.yaml`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

import yaml

from weberlink.master.devices.polhem.linkages import (
    FiveBarWeight,
    Linkage,
    LinkMass,
    ParallelogramWeight,
    SerialParallelogram,
    SpatialFiveBar,
    Weight,
)
from weberlink.master.devices.polhem.mechanism import CableDrive, Counts, Mechanism, Signs

BEYOND_HOME_M = 0.05

Board = Literal["serial", "hid14", "hid8"]
"""The electronics: a Teensy on a serial port, or an mbed with HID reports of 14 or 8 bytes."""


@dataclass(frozen=True)
class Wiring:
    """The signs and home counts of a mechanism on one kind of board.

    The boards count differently: the firmware with 14-byte reports has the reversed quadrature table of the one with 8.

    Args:
        encoder: direction of each encoder A, B, C.
        motor: direction of each motor.
        home_counts: what the encoders would read in the home pose if their zero were that of the angles.
        source: the host program that these signs were read in.
        gimbal: direction of each sensor of the gimbal.
        gimbal_home_counts: as `home_counts`.
    """

    encoder: Signs
    motor: Signs
    home_counts: Counts
    source: str
    gimbal: Signs = (1, 1, 1)
    gimbal_home_counts: Counts = (0, 0, 0)


@dataclass(frozen=True)
class MechanismParameters:
    """A mechanism with what its makers publish about it.

    Args:
        name: of the set.
        mechanism: with the signs of the first of `wirings`.
        wirings: the published signs, by board.
        source: where all this was read.
        force_n: largest force [N].
        stiffness_n_m: stiffest spring that it shows stably [N/m].
        damping_n_s_m: strongest damper [N s/m].
        radius_m: of the workspace about its middle [m].
        warnings: what a user should know about the set.
        gimbal_reversed_over_hid: whether the gimbal's counters come last to first on the boards that speak HID.
    """

    name: str
    mechanism: Mechanism
    wirings: Mapping[Board, Wiring]
    source: str
    force_n: float
    stiffness_n_m: float
    damping_n_s_m: float
    radius_m: float
    warnings: tuple[str, ...] = ()
    gimbal_reversed_over_hid: bool = False

    @property
    def reach_m(self) -> float:
        """Farthest plausible distance of the handle from the middle along any axis [m]: its home pose is within."""
        home = self.mechanism.position((0, 0, 0))
        return max(2.0 * self.radius_m, max(map(abs, home)) + BEYOND_HOME_M)

    def without_gimbal(self) -> Self:
        return self._driven(replace(self.mechanism.drive, gimbal_counts_per_turn=(0, 0, 0)))

    def on(self, board: Board) -> Self:
        """With the signs published for a board; KeyError where there are none."""
        return self.wired(self.wirings[board])

    def wired(self, wiring: Wiring) -> Self:
        drive = replace(
            self.mechanism.drive,
            encoder_directions=wiring.encoder,
            motor_directions=wiring.motor,
            home_counts=wiring.home_counts,
            gimbal_directions=wiring.gimbal,
            gimbal_home_counts=wiring.gimbal_home_counts,
        )
        return self._driven(drive)

    def _driven(self, drive: CableDrive) -> Self:
        return replace(self, mechanism=replace(self.mechanism, drive=drive))


def signs(text: str) -> Signs:
    """Three directions, written as `+-+`."""
    a, b, c = (1 if each == "+" else -1 for each in text)
    return (a, b, c)


def _tuples(row: Mapping[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}


def _wiring(
    encoder: str, motor: str, home: list[int], source: str, gimbal: str = "+++", gimbal_home: Sequence[int] = (0, 0, 0)
) -> Wiring:
    a, b, c = home
    d, e, f = gimbal_home
    return Wiring(signs(encoder), signs(motor), (a, b, c), source, signs(gimbal), (d, e, f))


def _linkage(row: Mapping[str, Any]) -> tuple[Linkage, Weight | None]:
    if "five_bar" in row:
        links = {name: LinkMass(*mass) for name, mass in row["five_bar_weight"].items()}
        linkage = SpatialFiveBar(**_tuples(row["five_bar"]))
        return linkage, FiveBarWeight(linkage, **links)
    weight = row.get("parallelogram_weight")
    return SerialParallelogram(**_tuples(row["parallelogram"])), None if weight is None else ParallelogramWeight(
        **weight
    )


def _parameters(name: str, row: Mapping[str, Any]) -> MechanismParameters:
    wirings = {board: _wiring(*columns) for board, columns in row["wirings"].items()}
    first = next(iter(wirings.values()))
    keys = ("capstan_m", "body_m", "counts_per_turn", "torque_constant_n_m_a", "gimbal_counts_per_turn")
    drive = CableDrive(
        encoder_directions=first.encoder,
        motor_directions=first.motor,
        home_counts=first.home_counts,
        gimbal_directions=first.gimbal,
        gimbal_home_counts=first.gimbal_home_counts,
        **_tuples({key: row[key] for key in keys if key in row}),
    )
    linkage, weight = _linkage(row)
    return MechanismParameters(
        name,
        Mechanism(drive, linkage, row.get("gimbal_axes", "xyx"), weight),
        wirings,
        source=row["source"],
        warnings=tuple(row.get("warnings", ())),
        gimbal_reversed_over_hid=row.get("gimbal_reversed_over_hid", False),
        **row["limits"],
    )


def _read_sets() -> dict[str, MechanismParameters]:
    rows: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("parameters.yaml").read_text(encoding="utf-8"))
    return {name: _parameters(name, row) for name, row in rows.items() if name != "sources"}


PARAMETERS = _read_sets()
"""All published sets by name, from `parameters.yaml`."""

MODEL_SETS = {1: "polhem_v3", 2: "vintage_phantom", 3: "woodenhaptics_2015"}
"""The set of a device by the model number that it gives on the serial port."""
