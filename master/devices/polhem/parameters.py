"""Published parameter sets of the mechanisms, from `parameters.yaml`, and the options of drivers that change them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, Self

import yaml
from pydantic import Field, model_validator

from weberlink.master.devices.hardware_device import ForceOptions, PortOptions
from weberlink.master.devices.polhem.mechanism import (
    Board,
    Linkage,
    Mechanism,
    SerialParallelogram,
    Signs,
    SpatialFiveBar,
    Wiring,
)
from weberlink.master.devices.polhem.protocol import CURRENT_LIMIT_MA, LONG, NUMBERS

LINKAGES: Mapping[str, Callable[..., Linkage]] = {"parallelogram": SerialParallelogram, "five_bar": SpatialFiveBar}


def _signs(text: str) -> Signs:
    a, b, c = (1 if each == "+" else -1 for each in text)
    return (a, b, c)


def _wiring(
    encoder: str, motor: str, home: list[int], _source: str, gimbal: str = "+++", gimbal_home: Sequence[int] = (0, 0, 0)
) -> Wiring:
    (a, b, c), (d, e, f) = home, gimbal_home
    return Wiring(_signs(encoder), _signs(motor), (a, b, c), _signs(gimbal), (d, e, f))


def _mechanism(name: str, row: dict[str, Any]) -> Mechanism:
    row = {key: tuple(value) if isinstance(value, list) else value for key, value in row.items() if key != "source"}
    wirings = {board: _wiring(*columns) for board, columns in row.pop("wirings").items()}
    kind = next(kind for kind in LINKAGES if kind in row)
    links = row.pop(kind)
    linkage = LINKAGES[kind](**links | {"origin": tuple(links["origin"])})
    return Mechanism(name, linkage, wirings, next(iter(wirings.values())), **row.pop("limits"), **row)


PARAMETERS = {
    name: _mechanism(name, row)
    for name, row in yaml.safe_load(Path(__file__).with_name("parameters.yaml").read_text(encoding="utf-8")).items()
    if "wirings" in row
}
"""All published sets by name, from `parameters.yaml`."""

# The set of a device by the model number that it gives on the serial port.
MODEL_SETS = {1: "polhem_v3", 2: "vintage_phantom", 3: "woodenhaptics_2015"}


# --- options

Direction = Literal[-1, 1]
Directions = tuple[Direction, Direction, Direction]
Homing = Literal["power_up", "at_open", "button"]
SetName = Literal[
    "woodenhaptics_2015",
    "woodenhaptics_2019",
    "aluhaptics_v2",
    "vintage_phantom",
    "vintage_phantom_2021",
    "polhem_v1",
    "polhem_v2",
    "polhem_v3",
]
Model = Literal["polhem", "vintage_phantom", "woodenhaptics"]

BOARDS: dict[Board, str] = {"serial": "the serial board", "hid14": "14-byte reports", "hid8": "8-byte reports"}

HID_CURRENT_LIMIT_MA = 3000  # the HID firmware has no limit; beyond this its amplifiers usually saturate


class PolhemOptions(ForceOptions, PortOptions):
    """Options that both drivers have."""

    encoder_directions: Directions | None = Field(
        default=None,
        description="+1 or -1 per encoder A, B, C: which way its body turns as it counts up; published if not given",
    )
    motor_directions: Directions | None = Field(
        default=None,
        description="+1 or -1 per motor A, B, C: which way a positive current turns its body; published if not given",
    )
    home_counts: tuple[int, int, int] | None = Field(
        default=None, description="added to the counters A, B, C in the home pose; as published if not given"
    )
    gimbal_directions: Directions | None = Field(
        default=None,
        description="+1 or -1 per sensor of the gimbal; the third is roll, whose sign differs between versions of the "
        "makers' software; as published if not given",
    )
    gravity_compensation: bool = Field(
        default=False,
        description="carry the weight of the links by the motors, within force_n; where masses are published",
    )
    homing: Homing = Field(
        default="power_up",
        description="power_up: the handle was in its home pose when the device got power; at_open: it is held there "
        "when the run starts; button: wait for the calibration button, pressed there",
    )
    home_patience_s: float = Field(default=30.0, gt=0.0, le=600.0, description="how long to wait for that button")
    force_n: float | None = Field(
        default=None, ge=0.01, le=1e4, description="largest force; what its makers publish if not given, and no more"
    )
    max_current_ma: float = Field(
        default=2000.0, gt=0.0, le=HID_CURRENT_LIMIT_MA, description="per motor; the device has no limit of its own"
    )

    @property
    def is_named(self) -> bool:
        """Whether the options say which device it is."""
        return True

    def wired(self) -> Mechanism:
        """The mechanism with the signs of these options; raises as `wire`."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.wired()
        return self

    def reminder(self, mechanism: Mechanism) -> str:
        """What to say before a run: where the handle has to be, and what is uncertain of a device that is named."""
        where = {
            "at_open": ("hold the handle in its home pose while the run starts",),
            "button": ("press the calibration button in the home pose when the run starts",),
        }
        return "; ".join((*where.get(self.homing, ()), *(mechanism.warnings if self.is_named else ())))

    def wire(self, name: str, board: Board) -> Mechanism:
        """The set `name` with the signs published for `board`, changed as these options say; raises ValueError if signs
        or masses are missing.
        """
        known = PARAMETERS[name]
        wiring = known.wirings.get(board)
        own = {
            "encoder": self.encoder_directions,
            "motor": self.motor_directions,
            "home_counts": self.home_counts,
            "gimbal": self.gimbal_directions,
        }
        given: dict[str, Any] = {field: value for field, value in own.items() if value is not None}
        if self.gravity_compensation and not known.linkage.masses:
            raise ValueError(f"gravity_compensation: no masses are published for {name}")
        if wiring is None:
            if not given.keys() >= {"encoder", "motor", "home_counts"}:
                boards = " and ".join(BOARDS[each] for each in known.wirings)
                raise ValueError(
                    f"parameters: signs of {name} are published for {boards}, not for {BOARDS[board]}: set "
                    "encoder_directions, motor_directions and home_counts"
                )
            return replace(known, wiring=Wiring(**given))
        return replace(known, wiring=replace(wiring, **given))


class PolhemSerialOptions(PolhemOptions):
    """Options of `polhem_serial`."""

    model: Literal["auto"] | Model = Field(
        default="auto", description="which one it is, checked against what it says; auto takes its word, without force"
    )
    parameters: SetName | None = Field(default=None, description="set of its mechanism; that of the model if not given")
    max_current_ma: float = Field(
        default=2000.0, gt=0.0, le=CURRENT_LIMIT_MA, description="per motor; beyond 6000 the device would give none"
    )

    @property
    def is_named(self) -> bool:
        return self.model != "auto"

    def wired(self, model: str | None = None) -> Mechanism:
        """With `auto`, those of the model that answered, WoodenHaptics before, and without the gimbal: the spec could
        not promise an orientation.
        """
        number = NUMBERS.get(model or self.model, NUMBERS["woodenhaptics"])
        known = self.wire(self.parameters or MODEL_SETS[number], "serial")
        return known if self.is_named else replace(known, gimbal_counts_per_turn=(0, 0, 0))


class PolhemHidOptions(PolhemOptions):
    """Options of `polhem_hid`."""

    parameters: SetName = Field(
        default="woodenhaptics_2015", description="set of its mechanism; the device cannot say it"
    )
    report_bytes: Literal[14, 8] = Field(
        default=14,
        description="bytes of its reports, 14 or the older 8: their firmware counts the other way round; checked",
    )
    counters_hold_home: bool = Field(
        default=False,
        description="the counters hold the home counts in the home pose, as the makers' software sets them, not zero",
    )

    def wired(self) -> Mechanism:
        return self.wire(self.parameters, "hid14" if self.report_bytes == LONG else "hid8")
