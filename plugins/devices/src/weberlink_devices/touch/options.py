"""Options of the driver `touch`."""

from pydantic import BaseModel, ConfigDict, Field

from weberlink.master.devices.threaded_device import fingerprint
from weberlink_devices.touch.hdapi import LIBRARY

NAME = "touch"


class TouchOptions(BaseModel):
    """Options of `touch`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: str | None = Field(
        default=None,
        min_length=1,
        max_length=200,
        description="of the device in the maker's set-up program; its default device if not given",
    )
    library: str = Field(
        default=LIBRARY, min_length=1, description="path of libHD.so; looked for by the system if bare"
    )
    force_n: float = Field(
        default=3.3, gt=0.0, le=40.0, description="largest force; the device's own limit holds where it is lower"
    )
    stiffness_n_m: float = Field(
        default=500.0, ge=1e-3, le=1e9, description="stiffest wall; what the library of a Touch says if not given"
    )
    reach_m: float = Field(
        default=0.3, gt=0.0, le=2.0, description="no coordinate of the handle is ever larger, either way"
    )
    calibration_s: float = Field(default=10.0, ge=0.0, le=600.0, description="how long to wait for the calibration")
    signs_checked: str | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )


def signs_fingerprint(options: TouchOptions) -> str:
    """Fingerprint of what the directions depend on: the library, and which device it is."""
    return fingerprint(f"{NAME} {options.library} {options.name}")
