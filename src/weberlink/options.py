"""What settings of a part are made of: pydantic models that refuse unknown keys, and numbers that are not finite."""

from pydantic import BaseModel, ConfigDict


class Options(BaseModel):
    """Settings of a driver, a robot, a shape or an emulator; frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
