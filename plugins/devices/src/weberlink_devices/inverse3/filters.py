"""What the Haply Inverse Service does to positions and forces on their way: its settings, and what they show."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.inverse3.protocol import mapping_in, read_number, read_vector


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """What the service does to positions and forces on their way, as the full state of a device says."""

    gate: float | None = None
    """Gain of the force gate, which attenuates forces that the service takes for an oscillation; None: unknown."""
    damping: float | None = None  # viscous resistance that the service adds; None if unknown
    basis: str = "XYZ"  # permutation of the axes
    scale: Vector = (1.0, 1.0, 1.0)  # of positions, per axis

    def check(self) -> None:
        """Raise HardwareFault for settings that turn or stretch the axes behind the back of the sign check."""
        if self.basis != "XYZ":
            raise HardwareFault(f"the service permutes the axes ({self.basis}); set basis XYZ in Haply Hub")
        if distance(self.scale, (1.0, 1.0, 1.0)) > 1e-6:
            raise HardwareFault(
                f"the service scales positions by {self.scale}; set the mount's scale to 1 in Haply Hub"
            )

    @property
    def filters(self) -> str:
        """The filters in words."""
        known = {"force gate": self.gate, "damping": self.damping}
        return ", ".join(f"{name} {value:g}" for name, value in known.items() if value is not None) or "filters unknown"


def settings_of(device: dict[str, Any]) -> ServiceSettings:
    """Read `config` of a full state; what is not there is at its default."""
    config = mapping_in(device, "config") or {}
    filters = mapping_in(config, "filters") or {}
    basis = (mapping_in(config, "basis") or {}).get("permutation", "XYZ")
    mount = mapping_in(config, "mount") or {}
    return ServiceSettings(
        gate=_number_of(mapping_in(filters, "force_gate"), "gain"),
        damping=_number_of(mapping_in(filters, "damping"), "scalar"),
        basis=basis if isinstance(basis, str) else "XYZ",
        scale=read_vector(mount.get("scale", {}), 1.0),
    )


ALTERED_N = 0.2
ALTERED_SHARE = 0.25
ALTERED_MOST = 100
"""Answers in a row, 0.1 s at 1 kHz: the force gate is to be named, not the answer that came before its command."""


class ForceComparison:
    """Notices that the service displays another force than was commanded: forces of several programs add, and its
    filters alter them."""

    def __init__(self) -> None:
        self._last: deque[Vector] = deque([ZERO], maxlen=3)
        self._altered = 0

    def judge(self, commanded: Vector, displayed: Vector | None) -> str | None:
        """The complaint, after `ALTERED_MOST` answers in a row that fit none of the last three commands; both [N]."""
        self._last.append(commanded)
        if displayed is None:
            return None
        fits = any(distance(displayed, each) <= max(ALTERED_N, ALTERED_SHARE * norm(each)) for each in self._last)
        self._altered = 0 if fits else self._altered + 1
        if self._altered < ALTERED_MOST:
            return None
        return f"the service displays {_newtons(displayed)} N instead of {_newtons(commanded)} N"


def _newtons(force: Vector) -> str:
    return "({:.1f}, {:.1f}, {:.1f})".format(*force)


def _number_of(parent: Mapping[str, Any] | None, name: str) -> float | None:
    value = None if parent is None else parent.get(name)
    return None if value is None else read_number(value)
