"""The exchange with a device through the maker's library: one wrench out, position and orientation in."""

from ctypes import byref, c_double, c_int, c_ubyte, c_ushort
from math import isfinite
from time import monotonic, sleep
from typing import NoReturn

from weberlink.hardware.discovery import UsbId
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink_devices.discovery import usb_devices
from weberlink_devices.force_dimension import library as dhd
from weberlink_devices.force_dimension.options import MODELS, ForceDimensionOptions
from weberlink_devices.rotation_matrix import of_matrix
from weberlink_devices.threaded_torque import NO_WRENCH, Wrench

USB = (UsbId(0x1451), UsbId(0x0403, 0xCB48))
"""Force Dimension, and the Novint Falcon."""
STATUS_S = 0.01
"""Time between two looks at the status [s]."""
SETTLE_S = 0.1
"""Time that the status has to show a force that was switched on [s]."""
PAUSE_S = 0.005
"""Pause after a call that failed [s]: the library may fail at once."""
BAD_REPLIES = 20
"""This many bad replies in a row (0.1 s) are a fault; force is off from the first."""
CALIBRATE = (
    "is not calibrated: bring the handle to its calibration position as its manual says, until the light stops "
    "blinking, and start again"
)


class DhdExchange:
    """Speaks to one device; every call blocks for about as long as USB takes. Unless `armed` no force is enabled."""

    def __init__(self, options: ForceDimensionOptions, *, armed: bool) -> None:
        self._options = options
        self._model = options.kind
        self._armed = armed
        self._library: dhd.Library | None = None
        self._device = 0
        self._serial_number = options.serial_number
        self._ended: str | None = None
        self._look_at = 0.0
        self._position = (c_double(), c_double(), c_double())
        self._orientation = dhd.Matrix()
        self._status = (c_int * dhd.MOST_STATUS)()

    def start_afresh(self) -> None:
        self._serial_number, self._ended = self._options.serial_number, None

    def open(self) -> DeviceReading:
        if self._ended is not None:  # a person ended the force, and reconnecting must not bring it back
            raise HardwareFault(self._ended)
        library = dhd.Library(dhd.find(self._options.library))
        self._device, self._serial_number = self._chosen(library)
        self._library = library
        try:
            self._check(library)
            if self._armed:
                self._limit_time(library)
                library.checked("dhdSetGravityCompensation", self._options.gravity_compensation, self._device)
                self._enable(library)
            return self._measure(library)
        except HardwareFault:
            self.close()
            raise

    def exchange(self, command: Wrench) -> DeviceReading:
        library = self._library
        assert library is not None
        try:
            if monotonic() >= self._look_at:
                self._look(library)
            if self._armed:
                self._display(library, command)
            return self._measure(library)
        except BadReply:
            sleep(PAUSE_S)
            raise

    def close(self) -> None:
        library, self._library = self._library, None
        if library is not None:
            for call in ("dhdStop", "dhdClose"):  # the force ends in braked motors, so that the handle does not drop
                library.call(call, self._device)

    def _chosen(self, library: dhd.Library) -> tuple[int, int]:
        """Open the device; gives its number in the library and its serial number, which only an open one says."""
        there: dict[int, int] = {}
        error = ""
        for index in range(max(0, library.call("dhdGetDeviceCount"))):
            try:
                device = library.checked("dhdOpenID", index)
            except BadReply as refused:
                error = f" ({refused})"
                continue
            there[_serial_number(library, device)] = device
        wanted = self._serial_number
        if wanted is None and len(there) == 1:
            (wanted,) = there
        for number, device in there.items():
            if number != wanted:
                library.call("dhdClose", device)
        if wanted is not None and wanted in there:
            return there[wanted], wanted
        raise HardwareFault(_no_choice(sorted(there), wanted) + error)

    def _check(self, library: dhd.Library) -> None:
        type_ = library.checked("dhdGetSystemType", self._device)
        if type_ not in self._model.types:
            model = next((name for name, each in MODELS.items() if type_ in each.types), None)
            advice = "which this driver does not know" if model is None else f"set master.device.model: {model}"
            raise HardwareFault(
                f"is a {library.text('dhdGetSystemName', self._device)} (type {type_}), the file says "
                f"{self._options.model}; {advice}"
            )
        library.checked("dhdGetStatus", self._status, self._device)
        if self._status[dhd.RESET]:
            raise HardwareFault(CALIBRATE)
        if self._model.orientation and self._status[dhd.WRIST_DETECTED] and not self._status[dhd.WRIST_INIT]:
            raise HardwareFault(f"the wrist {CALIBRATE}")

    def _limit_time(self, library: dhd.Library) -> None:
        """Set the time after which the device switches its force off by itself, and see that it took it."""
        steps, held = self._options.watchdog_steps, c_ubyte()
        if steps == 0:
            return
        library.checked("dhdEnableExpertMode")
        try:
            library.checked("dhdSetWatchdog", steps, self._device)
            library.checked("dhdGetWatchdog", byref(held), self._device)
        except BadReply as refused:
            reason = str(refused)
        else:
            reason = "" if held.value == steps else f"it holds {held.value} for {steps}"
        finally:
            library.call("dhdDisableExpertMode")
        if reason:
            raise HardwareFault(
                f"takes no time limit for its force ({reason}), so nothing would end it if this host stopped; to "
                "accept that, set master.device.watchdog_ms: 0"
            )

    def _enable(self, library: dhd.Library) -> None:
        self._display(library, NO_WRENCH)
        library.checked("dhdEnableForce", True, self._device)
        self._display(library, NO_WRENCH)
        self._look_at = monotonic() + SETTLE_S

    def _look(self, library: dhd.Library) -> None:
        """See that the device is calibrated and its force on; switch it on again after its watchdog alone."""
        self._look_at = monotonic() + STATUS_S
        library.checked("dhdGetStatus", self._status, self._device)
        if self._status[dhd.RESET]:
            self._end(CALIBRATE)
        if not self._armed or self._status[dhd.FORCE]:
            return
        cause = self._status[dhd.FORCE_OFF_CAUSE]
        if cause != dhd.OFF_BY_WATCHDOG:
            why = dhd.OFF_CAUSES.get(cause, "it does not say why")
            self._end(f"its force is off: {why}; start the session again to switch it on")
        self._enable(library)
        raise BadReply("was held up until its watchdog switched the force off; it comes up again from zero")

    def _end(self, why: str) -> NoReturn:
        self._ended = why
        raise HardwareFault(why)

    def _display(self, library: dhd.Library, command: Wrench) -> None:
        library.checked("dhdSetForceAndTorqueAndGripperForce", *command.force, *command.torque, 0.0, self._device)

    def _measure(self, library: dhd.Library) -> DeviceReading:
        x, y, z = self._position
        asked = monotonic()
        library.checked(
            "dhdGetPositionAndOrientationFrame", byref(x), byref(y), byref(z), self._orientation, self._device
        )
        position = (x.value, y.value, z.value)
        if not all(map(isfinite, position)):
            raise BadReply(f"reports the position {position}")
        orientation = None
        if self._model.orientation and (orientation := of_matrix(*map(tuple, self._orientation))) is None:
            raise BadReply("reports an orientation that is no rotation")
        buttons = library.call("dhdGetButtonMask", self._device) & ((1 << self._model.buttons) - 1)
        return DeviceReading(asked, position, orientation=orientation, buttons=buttons)


def _serial_number(library: dhd.Library, device: int) -> int:
    """0 for one that does not say."""
    number = c_ushort()
    return number.value if library.call("dhdGetSerialNumber", byref(number), device) >= 0 else 0


def _no_choice(there: list[int], wanted: int | None) -> str:
    """Why no device could be chosen."""
    listed = ", ".join(map(str, there))
    if wanted is not None and there:
        return f"the one with serial number {wanted} is not there, but {listed}"
    if there:
        return f"{len(there)} are plugged in, with serial numbers {listed}; say which with master.device.serial_number"
    for found in usb_devices(USB):
        if found.problem is not None:
            return found.problem
    return "none is plugged in and free; see that it is switched on and that no other program has it open"
