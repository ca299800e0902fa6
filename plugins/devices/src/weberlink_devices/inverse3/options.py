"""Options of the driver `inverse3`."""

from typing import Annotated, Literal

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.hardware_device import ForceOptions, HardwareOptions, Reply, Stiffness
from weberlink_devices.inverse3.protocol import ForceKey, Grip

ADDRESS = "ws://localhost:10001"
Preset = Literal["arm_front_centered", "arm_front", "led_front_centered", "led_front", "defaults"]


class Inverse3Options(ForceOptions, HardwareOptions):
    """Options of `inverse3`."""

    port: Annotated[str, Field(pattern=r"^ws://[^/#]+/?(#\w+)?$")] = Field(
        default=ADDRESS, description="address of the service; #ID behind it chooses a device, where there are several"
    )
    grip: Grip = Field(default="none", description="the grip that gives orientation and buttons")
    preset: Preset | None = Field(
        default="arm_front_centered", description="how the service places origin and axes, since 3.5; null: as it is"
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
    stiffness_n_m: Stiffness = Field(default=1000.0, description="stiffest wall; no figure has been published")
    reply_ms: Reply = 10.0

    @property
    def address(self) -> str:
        """Of the service, without the device."""
        return self.port.partition("#")[0].rstrip("/")

    @property
    def device_id(self) -> str | None:
        return self.port.partition("#")[2] or None
