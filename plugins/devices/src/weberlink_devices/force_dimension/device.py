"""The driver `force_dimension`: omega.x, delta.3, sigma.x, lambda.x and the Novint Falcon."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pydantic import BaseModel

from weberlink.geometry.vector import cube
from weberlink.hardware.discovery import PluggedDevice, UsbId
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.hardware_device import fingerprint, force_spec
from weberlink.registry import Tier
from weberlink_devices.discovery import usb_devices
from weberlink_devices.force_dimension.exchange import BAD_REPLIES, USB, DhdExchange
from weberlink_devices.force_dimension.library import find
from weberlink_devices.force_dimension.options import ForceDimensionOptions
from weberlink_devices.threaded_torque import ThreadedTorqueDevice

NAME = "force_dimension"
NO_OPTION = "no option turns it: see that the base stands as in its manual"


class ForceDimensionDevice(ThreadedTorqueDevice):
    """x toward the operator, y to the operator's right, z up; the origin in the middle of the workspace.

    The device switches its force off by itself when no new one comes within `watchdog_ms`. Without force feedback it
    gets no force command at all, so it does not carry its own weight either.
    """

    TIER: ClassVar[Tier] = "judged by others"
    Options: ClassVar[type[BaseModel]] = ForceDimensionOptions
    USB: ClassVar[tuple[UsbId, ...]] = USB
    CHOSEN_BY: ClassVar[str] = "serial_number"
    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = dict.fromkeys("xyz", NO_OPTION)
    FORCE_OPTIONS: ClassVar[Mapping[str, str]] = dict.fromkeys("xyz", NO_OPTION)

    def __init__(self, options: ForceDimensionOptions, tick_period: float) -> None:
        model = options.kind
        spec = force_spec(
            NAME,
            options,
            self.fingerprint(options),
            force_n=options.force_n or model.force_n,
            torque_n_m=options.torque_n_m,
            axes="xyz",
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=cube(model.reach_m),
            rate_hz=1.0 / tick_period,
            buttons=model.buttons,
            orientation=model.orientation,
            watchdog_s=options.watchdog_ms * 1e-3 if options.watchdog_steps else None,
        )
        exchange = DhdExchange(options, armed=spec.force_feedback)
        super().__init__(spec, exchange, tick_period, bad_replies=BAD_REPLIES, reconnect=options.reconnect_s)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        found = usb_devices(cls.USB)
        try:
            find()
        except HardwareFault as missing:
            return [replace(each, problem=each.problem or str(missing)) for each in found]
        return found

    @classmethod
    def fingerprint(cls, options: ForceDimensionOptions) -> str:
        """Of the settings that a sign check holds for."""
        return fingerprint(f"{NAME} {options.model} {options.serial_number}")
