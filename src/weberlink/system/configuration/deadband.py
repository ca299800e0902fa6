"""What a configuration file may say of the shape of the force's deadband. What each rests on: docs/deadbands.md."""

from math import degrees
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from weberlink.codec.deadband.cone import DIRECTION_RAD
from weberlink.codec.deadband.level_crossing import HYSTERESIS
from weberlink.codec.deadband.velocity import MOST_WEBER, SLOPE_S_M

DIRECTION_DEG = round(degrees(DIRECTION_RAD), 6)


class _Shape(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class IsotropicSettings(_Shape):
    """The same bound in all directions."""

    shape: Literal["isotropic"] = "isotropic"


class ConeSettings(_Shape):
    """Magnitude and direction apart."""

    shape: Literal["cone"]
    direction_deg: float = Field(default=DIRECTION_DEG, gt=0, le=180)
    """Largest angle between measured and displayed force that stays unsent [degrees]."""


class LevelCrossingSettings(_Shape):
    """Sent when the magnitude crosses a level of a fixed grid, or the direction leaves its cone; needs floor_n > 0."""

    shape: Literal["level_crossing"]
    direction_deg: float = Field(default=DIRECTION_DEG, gt=0, le=180)
    """Largest angle between measured and displayed force that stays unsent [degrees]."""
    hysteresis: float = Field(default=HYSTERESIS, ge=0, le=1)
    """How far beyond a level counts as crossed, as a share of the spacing of levels there."""


class VelocityAdaptiveSettings(_Shape):
    """The Weber factor grows with the speed of the hand."""

    shape: Literal["velocity_adaptive"]
    slope_s_m: float = Field(default=SLOPE_S_M, ge=0, le=100)
    """Growth of the Weber factor with speed [s/m]."""
    most_weber: float = Field(default=MOST_WEBER, ge=0, le=1)
    """The Weber factor grows no further."""


DeadbandSettings = Annotated[
    IsotropicSettings | ConeSettings | LevelCrossingSettings | VelocityAdaptiveSettings, Field(discriminator="shape")
]
