"""The published parameter sets of the mechanisms, read from `parameters.yaml`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

import yaml

from weberlink.master.devices.polhem.mechanism import (
    CableDrive,
    Linkage,
    Mechanism,
    SerialParallelogram,
    Signs,
    SpatialFiveBar,
    Wiring,
)

BEYOND_HOME_M = 0.05

Board = Literal["serial", "hid14", "hid8"]
"""The electronics: a Teensy on a serial port, or an mbed with HID reports of 14 or 8 bytes."""


@dataclass(frozen=True)
class MechanismParameters:
    """A mechanism, with the first of its `wirings`, and what its makers publish about it.

    `stiffness_n_m` is that of the stiffest spring that it shows stably, `radius_m` of the workspace about its middle.
    `gimbal_reversed_over_hid`: the gimbal's counters come last to first on the boards that speak HID.
    """

    name: str
    mechanism: Mechanism
    wirings: Mapping[Board, Wiring]
    force_n: float
    stiffness_n_m: float
    radius_m: float
    warnings: tuple[str, ...] = ()
    gimbal_reversed_over_hid: bool = False

    @property
    def reach_m(self) -> float:
        """Farthest plausible distance of the handle from the middle along any axis [m]: its home pose is within."""
        home = self.mechanism.position((0, 0, 0))
        return max(2.0 * self.radius_m, max(map(abs, home)) + BEYOND_HOME_M)

    def without_gimbal(self) -> Self:
        return replace(self, mechanism=self.mechanism.driven(gimbal_counts_per_turn=(0, 0, 0)))

    def wired(self, wiring: Wiring) -> Self:
        return replace(self, mechanism=self.mechanism.driven(wiring=wiring))


LINKAGES: Mapping[str, Callable[..., Linkage]] = {"parallelogram": SerialParallelogram, "five_bar": SpatialFiveBar}


def _signs(text: str) -> Signs:
    a, b, c = (1 if each == "+" else -1 for each in text)
    return (a, b, c)


def _wiring(
    encoder: str, motor: str, home: list[int], _source: str, gimbal: str = "+++", gimbal_home: Sequence[int] = (0, 0, 0)
) -> Wiring:
    (a, b, c), (d, e, f) = home, gimbal_home
    return Wiring(_signs(encoder), _signs(motor), (a, b, c), _signs(gimbal), (d, e, f))


def _parameters(name: str, row: dict[str, Any]) -> MechanismParameters:
    row = {key: tuple(value) if isinstance(value, list) else value for key, value in row.items() if key != "source"}
    wirings = {board: _wiring(*columns) for board, columns in row.pop("wirings").items()}
    kind = next(kind for kind in LINKAGES if kind in row)
    links = row.pop(kind)
    linkage = LINKAGES[kind](**links | {"origin": tuple(links["origin"])})
    keys = ("capstan_m", "body_m", "counts_per_turn", "torque_constant_n_m_a", "gimbal_counts_per_turn")
    drive = CableDrive(next(iter(wirings.values())), **{key: row.pop(key) for key in keys if key in row})
    mechanism = Mechanism(drive, linkage, row.pop("gimbal_axes", "xyx"))
    return MechanismParameters(name, mechanism, wirings, **row.pop("limits"), **row)


PARAMETERS = {
    name: _parameters(name, row)
    for name, row in yaml.safe_load(Path(__file__).with_name("parameters.yaml").read_text(encoding="utf-8")).items()
    if "wirings" in row
}
"""All published sets by name, from `parameters.yaml`."""

# The set of a device by the model number that it gives on the serial port.
MODEL_SETS = {1: "polhem_v3", 2: "vintage_phantom", 3: "woodenhaptics_2015"}
