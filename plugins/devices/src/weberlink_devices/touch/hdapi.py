"""HDAPI, the low-level interface of the maker's library libHD.so, by ctypes.

Prototypes and constants: hd.h of OpenHaptics 3.x, as public programs quote it. A position is in mm, a force in N, a
stiffness in N/mm; x points to the operator's right, y up and z toward the operator. The library is the maker's and must
be installed; nothing of it is part of this project.
"""

import ctypes
from collections.abc import Callable
from ctypes import POINTER, c_char_p, c_double, c_int, c_uint, c_ulong, c_ushort, c_void_p
from typing import Any, NamedTuple

from weberlink.hardware.fault import HardwareFault

LIBRARY = "libHD.so"
CONTINUE = 1
"""What a callback returns to be called again in the next cycle."""
INVALID_HANDLE = 0xFFFFFFFF

BUTTONS = 0x2000
POSITION = 0x2050
TRANSFORM = 0x2052
MAX_WORKSPACE = 0x2550
CALIBRATION_STYLE = 0x2555
MAX_FORCE = 0x2603
FORCE = 0x2700
FORCE_OUTPUT, FORCE_CLAMPING, FORCE_LIMIT = 0x4000, 0x4001, 0x4003
CALIBRATED, CALIBRATION_NEEDS_UPDATE, CALIBRATION_NEEDS_HAND = 0x5000, 0x5001, 0x5002
AUTO_STYLE, INKWELL_STYLE = 2, 4
DEFAULT_PRIORITY = 0x7FFF

FORCE_ERRORS = range(0x0200, 0x0300)
"""Warm motors, or a force, impulse or velocity beyond a limit; the next frame may be good."""
ERRORS = {
    0x0100: "HD_INVALID_ENUM",
    0x0101: "HD_INVALID_VALUE",
    0x0102: "HD_INVALID_OPERATION",
    0x0103: "HD_INVALID_INPUT_TYPE",
    0x0104: "HD_BAD_HANDLE",
    0x0200: "HD_WARM_MOTORS",
    0x0201: "HD_EXCEEDED_MAX_FORCE",
    0x0202: "HD_EXCEEDED_MAX_FORCE_IMPULSE",
    0x0203: "HD_EXCEEDED_MAX_VELOCITY",
    0x0204: "HD_FORCE_ERROR",
    0x0300: "HD_DEVICE_FAULT",
    0x0301: "HD_DEVICE_ALREADY_INITIATED",
    0x0302: "HD_COMM_ERROR",
    0x0303: "HD_COMM_CONFIG_ERROR",
    0x0304: "HD_TIMER_ERROR",
    0x0400: "HD_ILLEGAL_BEGIN",
    0x0401: "HD_ILLEGAL_END",
    0x0402: "HD_FRAME_ERROR",
    0x0500: "HD_INVALID_PRIORITY",
    0x0501: "HD_SCHEDULER_FULL",
    0x0600: "HD_INVALID_LICENSE",
}
ADVICE = {
    0x0200: "let them cool, and lower force_n",
    0x0301: "another program has it open; end that first",
    0x0302: "check its cable and power, and its name and port in the maker's set-up program",
    0x0303: "a program that was killed may have left it so: unplug it and plug it in again",
    0x0600: "the licence of OpenHaptics is missing or over; see the maker's installation guide",
}


class HdError(NamedTuple):
    """An error of the library: its code, and the number that the device gave; code 0 for none."""

    code: int
    internal: int

    @property
    def in_words(self) -> str:
        """In one line, with what to do about it if that is known."""
        name = ERRORS.get(self.code, "unknown error")
        advice = f"; {ADVICE[self.code]}" if self.code in ADVICE else ""
        return f"{name} (0x{self.code:04x}, internal {self.internal}){advice}"


class _ErrorInfo(ctypes.Structure):
    """12 bytes, returned by value."""

    _fields_ = (("code", c_uint), ("internal", c_int), ("handle", c_uint))


ServoCallback = ctypes.CFUNCTYPE(c_uint, c_void_p)
PROTOTYPES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "hdInitDevice": (c_uint, (c_char_p,)),
    "hdDisableDevice": (None, (c_uint,)),
    "hdMakeCurrentDevice": (None, (c_uint,)),
    "hdBeginFrame": (None, (c_uint,)),
    "hdEndFrame": (None, (c_uint,)),
    "hdGetError": (_ErrorInfo, ()),
    "hdGetDoublev": (None, (c_uint, POINTER(c_double))),
    "hdGetIntegerv": (None, (c_uint, POINTER(c_int))),
    "hdSetDoublev": (None, (c_uint, POINTER(c_double))),
    "hdEnable": (None, (c_uint,)),
    "hdDisable": (None, (c_uint,)),
    "hdCheckCalibration": (c_uint, ()),
    "hdUpdateCalibration": (None, (c_uint,)),
    "hdStartScheduler": (None, ()),
    "hdStopScheduler": (None, ()),
    "hdScheduleAsynchronous": (c_ulong, (ServoCallback, c_void_p, c_ushort)),
    "hdUnschedule": (None, (c_ulong,)),
}
"""Result and arguments of each call that the driver needs."""


class Hdapi:
    """The library, loaded. Its own calls are attributes with the names of the C prototypes.

    Args:
        path: of libHD.so; a bare name is looked for as the dynamic linker does.

    Raises:
        HardwareFault: it cannot be loaded, or lacks a call.
    """

    def __init__(self, path: str = LIBRARY) -> None:
        try:
            library = ctypes.CDLL(path)
        except OSError as error:
            raise HardwareFault(
                f"{path} cannot be loaded ({error}); install OpenHaptics and the device driver of 3D Systems, or say "
                "where it is with master.device.library"
            ) from None
        for name, (result, arguments) in PROTOTYPES.items():
            try:
                function = getattr(library, name)
            except AttributeError:
                raise HardwareFault(f"{path} has no {name}: it is not the libHD of OpenHaptics 3") from None
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        raise AttributeError(name)  # for the type checker: the calls are set in the constructor

    def error(self) -> HdError:
        """The newest error of the library's stack, which it leaves; code 0 if the stack is empty."""
        found = self.hdGetError()
        return HdError(found.code, found.internal)

    def errors(self) -> list[HdError]:
        """All errors of the stack, the newest first; the stack is empty afterwards."""
        found: list[HdError] = []
        while (error := self.error()).code and len(found) < 64:  # a library that never stops must not hang us
            found.append(error)
        return found

    def doubles(self, name: int, count: int) -> list[float]:
        """A parameter of so many numbers."""
        values = (c_double * count)()
        self.hdGetDoublev(name, values)
        return list(values)

    def integer(self, name: int) -> int:
        value = c_int()
        self.hdGetIntegerv(name, value)
        return value.value
