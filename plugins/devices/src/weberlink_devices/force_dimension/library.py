"""The maker's library by ctypes: where it is, the calls that the driver makes, and their errors."""

import os
import platform
import re
from ctypes import CDLL, POINTER, c_bool, c_byte, c_char_p, c_double, c_int, c_ubyte, c_uint, c_ushort
from pathlib import Path
from typing import Any

from weberlink.hardware.fault import BadReply, HardwareFault

SDK_FOLDERS = ("FDSDK", "FORCEDIM_SDK")
"""Environment variables that name the folder of the SDK, as other programs read them too."""
LIBRARY_FOLDERS = ("~/.local/lib", "/usr/local/lib", "/usr/lib")
PATTERNS = ("libdhd.so*", "libdrd.so*")
NOT_FOUND = (
    "the maker's library libdhd is not found: get the SDK from forcedimension.com, and set the environment variable "
    "FDSDK to its folder, or master.device.library to the file"
)

MOST_STATUS = 32
"""Room for the status; the library fills in 16 or 17 of them."""
RESET, FORCE, WRIST_DETECTED, WRIST_INIT, FORCE_OFF_CAUSE = 3, 5, 8, 12, 14
"""Places in the status."""
OFF_BY_WATCHDOG = 3
OFF_CAUSES = {
    1: "by its force button",
    2: "its velocity limit tripped",
    OFF_BY_WATCHDOG: "by its watchdog",
    4: "by software",
    5: "the USB connection was cut",
    6: "by its dead man's switch",
}

Matrix = c_double * 3 * 3
_DOUBLE = POINTER(c_double)
_DEVICE = c_byte

PROTOTYPES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "dhdErrorGetLastStr": (c_char_p, ()),
    "dhdGetDeviceCount": (c_int, ()),
    "dhdOpenID": (c_int, (_DEVICE,)),
    "dhdClose": (c_int, (_DEVICE,)),
    "dhdStop": (c_int, (_DEVICE,)),
    "dhdGetSerialNumber": (c_int, (POINTER(c_ushort), _DEVICE)),
    "dhdGetSystemType": (c_int, (_DEVICE,)),
    "dhdGetSystemName": (c_char_p, (_DEVICE,)),
    "dhdGetStatus": (c_int, (POINTER(c_int), _DEVICE)),
    "dhdEnableForce": (c_int, (c_bool, _DEVICE)),
    "dhdSetGravityCompensation": (c_int, (c_bool, _DEVICE)),
    "dhdGetPositionAndOrientationFrame": (c_int, (_DOUBLE, _DOUBLE, _DOUBLE, Matrix, _DEVICE)),
    "dhdGetButtonMask": (c_uint, (_DEVICE,)),
    "dhdSetForceAndTorqueAndGripperForce": (c_int, (*[c_double] * 7, _DEVICE)),
    "dhdEnableExpertMode": (c_int, ()),
    "dhdDisableExpertMode": (c_int, ()),
    "dhdSetWatchdog": (c_int, (c_ubyte, _DEVICE)),
    "dhdGetWatchdog": (c_int, (POINTER(c_ubyte), _DEVICE)),
}
"""Result and arguments of each call, from the maker's dhdc.h."""


def find(path: str | None = None) -> str:
    """The file of the library: as the options name it, or where it is installed; raises HardwareFault."""
    if path is not None:
        return str(Path(path).expanduser())
    sdks = (Path(sdk) for sdk in map(os.environ.get, SDK_FOLDERS) if sdk is not None)
    folders = [sdk / "lib" / "release" / f"lin-{platform.machine()}-gcc" for sdk in sdks]
    for folder in (*folders, *(Path(each).expanduser() for each in LIBRARY_FOLDERS)):
        for pattern in PATTERNS:
            if there := list(folder.glob(pattern)):
                return str(max(there, key=lambda file: [int(number) for number in re.findall(r"\d+", file.name)]))
    raise HardwareFault(NOT_FOUND)


class Library:
    """The library, loaded; raises HardwareFault where it cannot be, or lacks a call."""

    def __init__(self, path: str) -> None:
        try:
            library = CDLL(path)
        except OSError as error:
            raise HardwareFault(f"the maker's library cannot be loaded: {error}") from None
        self._calls: dict[str, Any] = {}
        for name, (result, arguments) in PROTOTYPES.items():
            try:
                call = getattr(library, name)
            except AttributeError:
                raise HardwareFault(f"{path} has no {name}: install a newer SDK from forcedimension.com") from None
            call.restype, call.argtypes = result, arguments
            self._calls[name] = call

    def call(self, name: str, *arguments: Any) -> Any:
        """Make a call, whatever comes of it."""
        return self._calls[name](*arguments)

    def checked(self, name: str, *arguments: Any) -> int:
        """Make a call that returns 0 or more; raises BadReply with the reason of the library where it failed."""
        result: int = self.call(name, *arguments)
        if result < 0:
            raise BadReply(f"{name}: {self.text('dhdErrorGetLastStr')}")
        return result

    def text(self, name: str, *arguments: Any) -> str:
        """Make a call that returns a text."""
        text: bytes | None = self.call(name, *arguments)
        return " ".join((text or b"").decode(errors="replace").split()) or "no reason given"
