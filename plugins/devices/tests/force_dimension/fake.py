"""The stand-in for the maker's library: compiled once, and its devices as the tests see and change them."""

from ctypes import CDLL, c_bool, c_char_p, c_double, c_int, c_long
from pathlib import Path

from plugins.devices.tests.compiler import compiled
from weberlink.geometry.vector import Vector

SOURCE = Path(__file__).with_name("libdhd.c")
STATE = "FAKE_DHD"
"""Environment variable with the file of the devices, for other processes."""


def library() -> Path:
    return compiled(SOURCE, "libdhd.so.3.17")


class FakeDevice:
    """One device, plugged in or not. Every number of it is a `double` in the file."""

    def __init__(self, library: CDLL, index: int) -> None:
        self._library = library
        self._index = index

    def __getitem__(self, name: str) -> float:
        return float(self._library.fake_get(self._index, name.encode()))

    def __setitem__(self, name: str, value: float) -> None:
        self._library.fake_set(self._index, name.encode(), value)

    def plug(self, type_: int = 33, serial: int = 1017) -> "FakeDevice":
        """Plug it in anew: no program has it open any more."""
        wrist = type_ not in (33, 60, 63, 203, 206)
        values = {"type": type_, "serial": serial, "wrist": wrist, "wrist_init": wrist, "has_watchdog": 1, "owner": 0}
        for name, value in (*values.items(), ("present", 1)):
            self[name] = value
        return self

    @property
    def wrench(self) -> tuple[Vector, Vector]:
        """Force [N] and torque [N m] on the hand now."""
        parts = (c_double * 6)()
        self._library.fake_displayed(self._index, parts)
        fx, fy, fz, tx, ty, tz = parts
        return (fx, fy, fz), (tx, ty, tz)

    def switch_off(self, cause: int) -> None:
        """The force goes off at the device: 1 its button, 2 its velocity limit."""
        self["off_cause"] = cause
        self["force_on"] = 0

    def log(self, since: int = 0) -> list[tuple[float, Vector]]:
        """When each command came from that number on [s], and the force that it led to [N]."""
        entry = (c_double * 4)()
        found = []
        for number in range(since, int(self["sets"])):
            if self._library.fake_log(self._index, number, entry):
                at, x, y, z = entry
                found.append((at, (x, y, z)))
        return found


class Devices(list[FakeDevice]):
    """The devices of one file; none is plugged in."""

    def __init__(self, state: Path) -> None:
        self.state = state
        self.library = library()
        fake = CDLL(str(self.library))
        fake.fake_get.restype, fake.fake_get.argtypes = c_double, (c_int, c_char_p)
        fake.fake_set.restype, fake.fake_set.argtypes = None, (c_int, c_char_p, c_double)
        fake.fake_displayed.restype, fake.fake_displayed.argtypes = None, (c_int, c_double * 6)
        fake.fake_log.restype, fake.fake_log.argtypes = c_bool, (c_int, c_long, c_double * 4)
        assert fake.fake_attach(str(state).encode()) == 0
        super().__init__(FakeDevice(fake, index) for index in range(4))
