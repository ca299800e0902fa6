"""Options of the Polhem drivers, and the force that they permit."""

from dataclasses import replace
from typing import Literal, Self

from pydantic import Field, model_validator

from weberlink.master.devices.force_device import ForceOptions, PortOptions
from weberlink.master.devices.polhem.mechanism import Wiring
from weberlink.master.devices.polhem.parameters import MODEL_SETS, PARAMETERS, Board, MechanismParameters
from weberlink.master.devices.polhem.protocol import CURRENT_LIMIT_MA, LONG, NUMBERS

Sign = Literal[-1, 1]
Signs = tuple[Sign, Sign, Sign]
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

    encoder_directions: Signs | None = Field(
        default=None,
        description="+1 or -1 per encoder A, B, C: which way its body turns as it counts up; published if not given",
    )
    motor_directions: Signs | None = Field(
        default=None,
        description="+1 or -1 per motor A, B, C: which way a positive current turns its body; published if not given",
    )
    home_counts: tuple[int, int, int] | None = Field(
        default=None, description="added to the counters A, B, C in the home pose; as published if not given"
    )
    gimbal_directions: Signs | None = Field(
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

    def wired(self) -> MechanismParameters:
        """The mechanism with the signs of these options; raises as `wire`."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.wired()
        return self

    def reminder(self, parameters: MechanismParameters) -> str:
        """What to say before a run: where the handle has to be, and what is uncertain of a device that is named."""
        where = {
            "at_open": ("hold the handle in its home pose while the run starts",),
            "button": ("press the calibration button in the home pose when the run starts",),
        }
        return "; ".join((*where.get(self.homing, ()), *(parameters.warnings if self.is_named else ())))

    def wire(self, name: str, board: Board) -> MechanismParameters:
        """The set `name` with the signs published for `board`, changed as these options say; raises ValueError if signs
        or masses are missing.
        """
        known = PARAMETERS[name]
        wiring = known.wirings.get(board)
        encoder, motor = self.encoder_directions, self.motor_directions
        if self.gravity_compensation and not known.mechanism.linkage.masses:
            raise ValueError(f"gravity_compensation: no masses are published for {name}")
        if wiring is None:
            if encoder is None or motor is None or self.home_counts is None:
                boards = " and ".join(BOARDS[each] for each in known.wirings)
                raise ValueError(
                    f"parameters: signs of {name} are published for {boards}, not for {BOARDS[board]}: set "
                    "encoder_directions, motor_directions and home_counts"
                )
            wiring = Wiring(encoder, motor, self.home_counts)
        return known.wired(
            replace(
                wiring,
                encoder=encoder or wiring.encoder,
                motor=motor or wiring.motor,
                home_counts=self.home_counts or wiring.home_counts,
                gimbal=self.gimbal_directions or wiring.gimbal,
            )
        )


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

    def wired(self, model: str | None = None) -> MechanismParameters:
        """With `auto`, those of the model that answered, WoodenHaptics before, and without the gimbal: the spec could
        not promise an orientation.
        """
        number = NUMBERS.get(model or self.model, NUMBERS["woodenhaptics"])
        parameters = self.wire(self.parameters or MODEL_SETS[number], "serial")
        return parameters if self.is_named else parameters.without_gimbal()


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

    def wired(self) -> MechanismParameters:
        return self.wire(self.parameters, "hid14" if self.report_bytes == LONG else "hid8")
