"""What a file may say about these devices, on either kind of cable."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from master.devices.polhem.bracket import CURRENT_LIMIT_MA

Sign = Literal[-1, 1]
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

HID_CURRENT_LIMIT_MA = 3000
"""The firmware there does not limit; beyond this the usual one leaves the range that its amplifiers understand."""


class PolhemOptions(BaseModel):
    """Options that both drivers have."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: str | None = Field(default=None, description="path of the device; the only one plugged in if not given")
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")
    directions: tuple[Sign, Sign, Sign] | None = Field(
        default=None, description="+1 or -1 per motor A, B, C: which way its body turns; as published if not given"
    )
    home_counts: tuple[int, int, int] | None = Field(
        default=None, description="added to the counters A, B, C in the home pose; as published if not given"
    )
    homing: Homing = Field(
        default="power_up",
        description="power_up: the handle was in its home pose when the device got power; at_open: it is held there "
        "when the run starts; button: wait for the calibration button, pressed there",
    )
    home_patience_s: float = Field(default=30.0, gt=0.0, le=600.0, description="how long to wait for that button")
    force_n: float | None = Field(
        default=None, gt=0.0, description="largest force; what its makers publish if not given, and no more"
    )
    signs_checked: Annotated[str, Field(pattern="^[0-9a-f]{8}$")] | None = Field(
        default=None, description="what `weberlink device test` printed; without it there is no force"
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


class PolhemHidOptions(PolhemOptions):
    """Options of `polhem_hid`."""

    parameters: SetName = Field(
        default="woodenhaptics_2015", description="set of its mechanism; the device cannot say it"
    )
    max_current_ma: float = Field(
        default=2000.0, gt=0.0, le=HID_CURRENT_LIMIT_MA, description="per motor; the device has no limit of its own"
    )
    counters_hold_home: bool = Field(
        default=False,
        description="the counters hold the home counts in the home pose, as the makers' software sets them, not zero",
    )
