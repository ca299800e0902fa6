"""The driver `inverse3`: a Haply Inverse3 through the WebSocket of its service."""

from collections.abc import Sequence
from math import isfinite
from typing import ClassVar

from pydantic import BaseModel

from weberlink.geometry.vector import Vector, cube
from weberlink.hardware.discovery import PluggedDevice
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.hardware_device import ThreadedDevice, fingerprint, force_spec
from weberlink.registry import Tier
from weberlink_devices.inverse3.http_requests import service_devices
from weberlink_devices.inverse3.options import ADDRESS, Inverse3Options
from weberlink_devices.inverse3.protocol import GRIP_BUTTONS
from weberlink_devices.inverse3.service import ServiceExchange, measure_time_out

NAME = "inverse3"


class Inverse3Device(ThreadedDevice):
    """x toward the operator, y to the right, z up; the origin is that of the preset, or `origin_m`.

    How long the service displays a command without a next one is not published. So a guardian process commands zero
    when the tick falls silent or this process stops, and ends the connection when it dies.
    """

    TIER: ClassVar[Tier] = "judged by others"
    Options: ClassVar[type[BaseModel]] = Inverse3Options

    def __init__(self, options: Inverse3Options, tick_period: float) -> None:
        self._options = options
        spec = force_spec(
            NAME,
            options,
            self.fingerprint(options),
            force_n=options.force_n,
            axes="xyz",
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=cube(options.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=len(GRIP_BUTTONS[options.grip]),
            orientation=options.grip != "none",
        )
        self._service = ServiceExchange(options, Guardian(b"") if spec.force_feedback else None)
        super().__init__(spec, self._service, tick_period, reconnect=options.reconnect_s)

    @property
    def trouble(self) -> str | None:
        return super().trouble or self._service.alteration or self._service.grip_trouble

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """The devices that a service on this machine lists."""
        found = service_devices(ADDRESS)
        return [PluggedDevice(f"{ADDRESS}#{each}", "Inverse3", each) for each in found]

    @classmethod
    def fingerprint(cls, options: Inverse3Options) -> str:
        """Of all settings that affect signs."""
        return fingerprint(f"{NAME} {options.preset}")

    def examine(self, force: Vector) -> Sequence[str]:
        """Say how the service filters forces [N], and how long one stands without commands; the device must be closed.

        Raises:
            DeviceFault: it cannot be used.
        """
        try:
            found = measure_time_out(self._options, force)
        except HardwareFault as fault:
            raise self._fault(str(fault)) from None
        gate = found.settings.gate
        end = f"and less than {found.shortest * 1e3:g} ms" if isfinite(found.shortest) else "perhaps for ever"
        return (
            f"Without commands, the service keeps a force for {found.longest * 1e3:g} ms or more, {end}.",
            f"Its filters: {found.settings.filters}.",
            *(() if gate is None else ("To keep the gain of the force gate, add:", f"  force_gate: {gate:g}")),
        )
