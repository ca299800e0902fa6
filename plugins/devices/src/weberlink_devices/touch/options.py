"""Options of the driver `touch`."""

from pydantic import Field

from weberlink.master.devices.hardware_device import ForceOptions, Stiffness
from weberlink_devices.touch.hdapi import LIBRARY


class TouchOptions(ForceOptions):
    """Options of `touch`."""

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
    stiffness_n_m: Stiffness = Field(
        default=500.0, description="stiffest wall; what the library of a Touch says if not given"
    )
    reach_m: float = Field(
        default=0.3, gt=0.0, le=2.0, description="no coordinate of the handle is ever larger, either way"
    )
    calibration_s: float = Field(default=10.0, ge=0.0, le=600.0, description="how long to wait for the calibration")
