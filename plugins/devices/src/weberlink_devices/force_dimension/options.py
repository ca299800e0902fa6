"""Options of the driver `force_dimension`, and the models that the maker's library drives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Self

from pydantic import Field, model_validator

from weberlink.master.devices.hardware_device import ForceOptions, HardwareOptions, Stiffness, limited_force

ModelName = Literal[
    "omega.3", "omega.6", "omega.7", "delta.3", "sigma.3", "sigma.7", "lambda.3", "lambda.7", "novint_falcon"
]


@dataclass(frozen=True, slots=True)
class Model:
    """What is published of a model."""

    types: tuple[int, ...]  # what `dhdGetSystemType` returns: one number, or those for the right and the left hand
    force_n: float  # largest force
    reach_m: float  # half an edge of the cube that holds all positions of the handle
    torque_n_m: float = 0.0  # largest torque of the wrist; 0 for a passive wrist or none
    orientation: bool = False  # whether it has a wrist with sensors
    buttons: int = 8  # how many bits of `dhdGetButtonMask` are its buttons; most models have fewer


MODELS: Mapping[ModelName, Model] = {
    "omega.3": Model((33,), 12.0, 0.12),
    "omega.6": Model((34, 36), 12.0, 0.12, orientation=True),
    "omega.7": Model((35, 37), 12.0, 0.12, orientation=True),
    "delta.3": Model((63,), 20.0, 0.24),
    "sigma.3": Model((206,), 12.0, 0.15),
    "sigma.7": Model((104, 105), 12.0, 0.15, torque_n_m=0.2, orientation=True),
    "lambda.3": Model((203,), 12.0, 0.2),
    "lambda.7": Model((108, 109), 12.0, 0.2, torque_n_m=0.2, orientation=True),
    "novint_falcon": Model((60,), 8.0, 0.08, buttons=4),
}
"""Numbers of the types: `forcedimension_core.constants.DeviceType` and the maker's dhdc.h.

Forces and torques: cDeltaDevice of CHAI3D; the reach is at least 1.6 of its radii of the workspace. It does not know
sigma.3 and the lambdas, which get the values of the sigma.7 and a cautious reach.
"""

WATCHDOG_STEP_MS = 0.125
MOST_STEPS = 255


class ForceDimensionOptions(ForceOptions, HardwareOptions):
    """Options of `force_dimension`."""

    model: ModelName = Field(default="omega.3", description="which one it is, left or right alike; checked when opened")
    serial_number: int | None = Field(
        default=None, ge=0, le=65535, description="which of several; the only one plugged in if not given"
    )
    library: str | None = Field(
        default=None,
        description="file of the maker's libdhd or libdrd; if not given, that of the SDK in the folder that the "
        "environment variable FDSDK names, or one that is installed",
    )
    force_n: float | None = Field(
        default=None, gt=0.0, le=40.0, description="largest force; that of the model if not given"
    )
    torque_n_m: float = Field(
        default=0.0,
        ge=0.0,
        le=2.0,
        description="largest torque of an active wrist; no check of signs covers it; 0 for none",
    )
    stiffness_n_m: Stiffness = Field(default=1500.0, description="stiffest wall; a cautious value for a loop at 1 kHz")
    gravity_compensation: bool = Field(
        default=True, description="the library adds the force that carries the handle, while there is force at all"
    )
    watchdog_ms: float = Field(
        default=MOST_STEPS * WATCHDOG_STEP_MS,
        ge=0.0,
        le=MOST_STEPS * WATCHDOG_STEP_MS,
        description="time after which the device switches its force off if no new one comes; 0 for a device without "
        "this limit, which master.accept_no_watchdog must then name",
    )

    @property
    def kind(self) -> Model:
        return MODELS[self.model]

    @property
    def watchdog_steps(self) -> int:
        return round(self.watchdog_ms / WATCHDOG_STEP_MS)

    @model_validator(mode="after")
    def _check(self) -> Self:
        limited_force(self.force_n, self.kind.force_n, self.model)
        if self.torque_n_m > (most := self.kind.torque_n_m):
            raise ValueError(f"torque_n_m: expected at most {most:g} N m for {self.model}, got {self.torque_n_m:g}")
        if 0.0 < self.watchdog_ms < 5.0:
            raise ValueError(f"watchdog_ms: expected 0, or at least 5 for a loop at 1 kHz, got {self.watchdog_ms:g}")
        return self
