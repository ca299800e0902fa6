"""The driver `haply_2diy`: a planar device with two motors."""

from collections.abc import Mapping
from typing import ClassVar

from pydantic import BaseModel

from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.hardware_device import ThreadedDevice, fingerprint, force_spec
from weberlink.registry import Tier
from weberlink_devices.haply.board import RESET
from weberlink_devices.haply.exchange import HaplyExchange
from weberlink_devices.haply.linkage import HaplyFrame
from weberlink_devices.haply.options import HaplyOptions, version_of

NAME = "haply_2diy"
NO_WATCHDOG = (
    "no watchdog: where this host loses its power or the cable is pulled, its board holds the last force until it is "
    "switched off"
)
FLAT_M = 0.001
"""Half the thickness of the workspace: z never moves, but a box has a thickness."""


class HaplyDevice(ThreadedDevice):
    """x toward the operator, y to the operator's right, z up and always 0; the origin in the middle of the workspace.

    The board has no watchdog: it holds the last torque for as long as it has power. The thread sends zero when the tick
    falls silent, on every fault and at the end; a guardian process sends it when this process stops or dies.
    """

    TIER: ClassVar[Tier] = "emulated only"
    Options: ClassVar[type[BaseModel]] = HaplyOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x2341, 0x804D), UsbId(0x2341, 0x824D), UsbId(0x2341, 0x003E))
    """Arduino Zero and Due with their native ports; other boards share these identities."""
    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = dict.fromkeys("xy", "encoder_directions (or version, or home_deg)")

    def __init__(self, options: HaplyOptions, tick_period: float) -> None:
        version = version_of(options)
        frame, board = HaplyFrame(options.origin_m or version.center), version.board
        x, y, _ = frame.position(version.center)
        across, along = version.reach
        when = "before every session" if options.home == "start" else "when it is first used after it was plugged in"
        spec = force_spec(
            NAME,
            options,
            self.fingerprint(options),
            force_n=options.force_n,
            axes="xy",
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=((x - along, y - across, -FLAT_M), (x + along, y + across, FLAT_M)),
            rate_hz=1.0 / tick_period,
            note=NO_WATCHDOG,
            reminder=f"the handle must be at its starting place {when}",
        )
        rests = board.torques(0.0, 0.0), RESET, board.setup
        guardian = Guardian(board.torques_off, rests) if spec.force_feedback else None

        def port() -> str:
            return options.port or only(self.plugged(), f"{NAME} (an Arduino board)", "master.device.port").path

        exchange = HaplyExchange(port, version, options, guardian)
        super().__init__(spec, exchange, tick_period, reconnect=options.reconnect_s)

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Boards that may be a Haply: an Arduino does not say what is connected to it."""
        return serial_ports(cls.USB)

    @classmethod
    def fingerprint(cls, options: HaplyOptions) -> str:
        """Of all settings that affect signs."""
        board = version_of(options).board
        turns = [each.direction for each in (*board.motors, *board.encoders)]
        return fingerprint(f"{NAME} {options.version} {turns} {board.home_deg}")
