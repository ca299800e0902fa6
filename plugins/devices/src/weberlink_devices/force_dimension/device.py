"""The driver `force_dimension`: omega.x, delta.3, sigma.x, lambda.x and the Novint Falcon."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pydantic import BaseModel

from weberlink.hardware.discovery import PluggedDevice, UsbId, usb_devices
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.contract import DeviceSpec
from weberlink.master.devices.threaded_device import ThreadedTorqueDevice, fingerprint
from weberlink.registry import Tier
from weberlink_devices.force_dimension.exchange import BAD_REPLIES, USB, DhdExchange
from weberlink_devices.force_dimension.library import find
from weberlink_devices.force_dimension.options import NAME, ForceDimensionOptions

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
        armed = options.signs_checked == self.fingerprint(options)
        super().__init__(
            _spec(options, 1.0 / tick_period, armed=armed),
            DhdExchange(options, armed=armed),
            tick_period,
            bad_replies=BAD_REPLIES,
            reconnect=options.reconnect_s,
        )

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        try:
            find()
        except HardwareFault as missing:
            return [replace(each, problem=each.problem or str(missing)) for each in usb_devices(cls.USB)]
        return usb_devices(cls.USB)

    @classmethod
    def fingerprint(cls, options: ForceDimensionOptions) -> str:
        """Fingerprint of the settings that a sign check holds for."""
        return fingerprint(f"{NAME} {options.model} {options.serial_number}")


def _spec(options: ForceDimensionOptions, rate: float, *, armed: bool) -> DeviceSpec:
    model = options.kind
    reach = model.reach_m
    stale = "" if options.signs_checked is None else " with these settings"
    return DeviceSpec(
        name=NAME,
        axes="xyz",
        force_n=(options.force_n or model.force_n) if armed else 0.0,
        stiffness_n_m=options.stiffness_n_m,
        workspace_m=((-reach, -reach, -reach), (reach, reach, reach)),
        rate_hz=rate,
        force_feedback=armed,
        buttons=model.buttons,
        orientation=model.orientation,
        torque_n_m=options.torque_n_m if armed else 0.0,
        watchdog_s=options.watchdog_ms * 1e-3 if options.watchdog_steps else None,
        note="" if armed else f"no force: signs not checked{stale}; run: weberlink device test {NAME}",
    )
