"""Options of the driver `force_dimension`."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink_devices.force_dimension.models import MODELS, Model, ModelName

NAME = "force_dimension"

WATCHDOG_STEP_S = 125e-6
"""Unit of the device's time limit [s]."""
MOST_STEPS = 255


class ForceDimensionOptions(BaseModel):
    """Options of `force_dimension`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    model: ModelName = Field(default="omega.3", description="which one it is, left or right alike; checked when opened")
    serial_number: int | None = Field(
        default=None, ge=0, le=65535, description="which of several; the only one plugged in if not given"
    )
    library: str | None = Field(
        default=None,
        description="file of the maker's libdhd or libdrd; if not given, that of the SDK in the folder that the "
        "environment variable FDSDK names, or one that is installed",
    )
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")
    force_n: float | None = Field(
        default=None, gt=0.0, le=40.0, description="largest force; that of the model if not given"
    )
    torque_n_m: float = Field(
        default=0.0,
        ge=0.0,
        le=2.0,
        description="largest torque of an active wrist; no check of signs covers it; 0 for none",
    )
    stiffness_n_m: float = Field(
        default=1500.0, ge=1e-3, le=1e9, description="stiffest wall; a cautious value for a loop at 1 kHz"
    )
    gravity_compensation: bool = Field(
        default=True, description="the library adds the force that carries the handle, while there is force at all"
    )
    watchdog_ms: float = Field(
        default=MOST_STEPS * WATCHDOG_STEP_S * 1e3,
        ge=0.0,
        le=MOST_STEPS * WATCHDOG_STEP_S * 1e3,
        description="time after which the device switches its force off if no new one comes; 0 for a device without "
        "this limit, which master.accept_no_watchdog must then name",
    )
    signs_checked: str | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )

    @property
    def kind(self) -> Model:
        return MODELS[self.model]

    @property
    def watchdog_steps(self) -> int:
        """The time limit in its own unit."""
        return round(self.watchdog_ms * 1e-3 / WATCHDOG_STEP_S)

    @model_validator(mode="after")
    def _check(self) -> Self:
        published = self.kind
        if self.force_n is not None and self.force_n > published.force_n:
            raise ValueError(
                f"force_n: expected at most {published.force_n:g} N for {self.model}, got {self.force_n:g}"
            )
        if self.torque_n_m > published.torque_n_m:
            raise ValueError(
                f"torque_n_m: expected at most {published.torque_n_m:g} N m for {self.model}, got {self.torque_n_m:g}"
            )
        if 0.0 < self.watchdog_ms < 5.0:
            raise ValueError(f"watchdog_ms: expected 0, or at least 5 for a loop at 1 kHz, got {self.watchdog_ms:g}")
        return self
