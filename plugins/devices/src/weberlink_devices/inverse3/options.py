"""Options of the driver `inverse3`."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink_devices.inverse3.protocol import ForceKey, Grip

NAME = "inverse3"
ADDRESS = "ws://localhost:10001"
Preset = Literal["arm_front_centered", "arm_front", "led_front_centered", "led_front", "defaults"]


class Inverse3Options(BaseModel):
    """Options of `inverse3`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: Annotated[str, Field(pattern=r"^ws://[^/#]+/?(#\w+)?$")] = Field(
        default=ADDRESS, description="address of the service; #ID behind it chooses a device, where there are several"
    )
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")
    grip: Grip = Field(default="none", description="the grip that gives orientation and buttons")
    preset: Preset | None = Field(
        default="arm_front_centered",
        description="how the service places origin and axes, since 3.5; null: as it is",
    )
    origin_m: Vector = Field(default=ZERO, description="becomes (0, 0, 0); in our axes, from the origin of the service")
    reach_m: float = Field(default=0.15, ge=0.01, le=0.5, description="half an edge of the workspace about the origin")
    force_key: Literal[ForceKey, "auto"] = Field(
        default="auto", description="vector: services since 3.5; values: 3.1 to 3.4; auto: by GET /version"
    )
    force_gate: float | None = Field(
        default=None, ge=0.0, le=1.0, description="gain of the service's force gate; null: as it is"
    )
    shared: bool = Field(default=False, description="use it beside other programs, whose forces add")
    force_n: float = Field(default=3.0, gt=0.0, le=10.0, description="largest force; more is cut to it")
    stiffness_n_m: float = Field(
        default=1000.0, ge=1e-3, le=1e9, description="stiffest wall; no figure has been published"
    )
    reply_ms: float = Field(default=10.0, ge=1.0, le=100.0, description="how long an answer may take")
    signs_checked: Annotated[str, Field(pattern="^[0-9a-f]{8}$")] | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )

    @property
    def address(self) -> str:
        """Of the service, without the device."""
        return self.port.partition("#")[0].rstrip("/")

    @property
    def device_id(self) -> str | None:
        return self.port.partition("#")[2] or None
