"""Emulated devices: the interface of one, its faults, and the table of them all.

`weberlink.testing.serving` connects one to a port, `weberlink device emulate` also one of the kernel.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from weberlink.registry import Registry

EMULATORS: Registry[Any] = Registry("emulated device", {}, "weberlink.emulators")
"""Each by the name of its driver, of the entry points of `weberlink.emulators`.

An entry is an `Emulator`, with the pydantic class of its `Options` and the name of its `transport`: serial, hid, evdev,
or one of its own. For a device of the kernel (hid, evdev) it has an `identity` with `entry(number, instance)`, which
tells umockdev of it. With a transport of its own it has `served(begin)`, which gives a
`weberlink.testing.serving.ServedDevice` with an `address`.
"""


@dataclass
class WireFaults:
    """Faults between device and host; may be changed at any time, from any thread."""

    garble: int = 0  # number of replies to come in which a byte is changed
    late_s: float = 0.0  # every reply leaves this much later
    silent: bool = False  # replies are lost


class Emulator:
    """A device on the wire, without I/O. `now` [s] never goes back.

    Its faults are those of its wire, and its own, which happen when it is advanced next.
    """

    OWN_FAULTS: ClassVar[Mapping[str, str]] = {}  # what each of its own does, and what its value means
    fault_values: Mapping[str, range | float] = {}
    """The whole numbers that a fault takes, or the limit of its values either way; any number if there is none."""

    def __init__(self) -> None:
        self.faults = WireFaults()
        self.leaving: list[bytes] = []  # the messages that `replies` gives next
        self._injected: deque[tuple[str, float]] = deque()

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes as they come, or one HID report without its number."""
        raise NotImplementedError

    def advance(self, now: float) -> None:  # noqa: ARG002
        """Move mechanics, watchdog and timers on to `now`; here, let happen what was injected."""
        while self._injected:
            self.apply_fault(*self._injected.popleft())

    def replies(self, now: float) -> list[bytes]:  # noqa: ARG002
        """The messages that leave the device by `now`, oldest first; each of them once."""
        leaving, self.leaving = self.leaving, []
        return leaving

    def next_timer(self) -> float | None:
        """When `advance` or `replies` must be called next if nothing arrives [s]; None for never."""
        return None

    def inject(self, name: str, value: float = 1.0) -> None:
        """Cause one of `OWN_FAULTS` at the next `advance`; from any thread. Raises ValueError if there is none of that
        name, or not with that value."""
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        values = self.fault_values.get(name)
        if isinstance(values, range) and value not in values:
            raise ValueError(f"{name}: expected a whole number from {values[0]} to {values[-1]}, got {value:g}")
        if isinstance(values, float) and not abs(value) <= values:
            raise ValueError(f"{name}: expected a number within +-{values:g}, got {value:g}")
        self._injected.append((name, value))

    def apply_fault(self, name: str, value: float) -> None:
        """Let one of `OWN_FAULTS` happen now."""
        raise NotImplementedError
