"""What a session needs of the machine: as configured in a file, or the defaults."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weberlink.config import MASTER, SIDES, SLAVE, Configuration
from weberlink.config.model import RealtimeSettings, split_address

DEFAULTS = RealtimeSettings()
PLAIN = ("sides", "rate_hz", "priority", "lock_memory", "wakeful", "busy_poll", "cpus", "encrypted", "silence_s")
"""Needs that go into JSON as they are."""


@dataclass(frozen=True, slots=True)
class Needs:
    """Requirements that the checks compare the machine with; the defaults are those without a configuration."""

    file: Path | None = None
    sides: Sequence[str] = SIDES
    """Those that run on this machine."""
    rate_hz: float = 1000.0
    priority: int = DEFAULTS.priority
    """Of SCHED_FIFO; 0 for the ordinary scheduler."""
    lock_memory: bool = DEFAULTS.lock_memory
    wakeful: bool = DEFAULTS.wakeful
    """Whether daemons keep processors out of deep idle states."""
    busy_poll: bool = DEFAULTS.busy_poll
    """Whether each daemon takes a processor."""
    cpus: tuple[int, int] | None = None
    """Processors of the master and the slave."""
    listen: tuple[str, int] | None = None
    """Address that the slave binds; None if it does not run here, or binds any free port."""
    slave: tuple[str, int] | None = None
    """Address that the master calls; None if it does not run here."""
    key_file: Path | None = None
    encrypted: bool = True
    silence_s: float = 0.1
    drivers: tuple[tuple[str, str], ...] = ()
    """Pairs of side and driver."""

    @classmethod
    def of(cls, configuration: Configuration, sides: Sequence[str] = SIDES) -> "Needs":
        """The needs of a configuration."""
        system = configuration.system
        link, realtime = system.link, system.realtime
        listen, slave = split_address(link.listen), split_address(link.slave)
        names = {MASTER: system.master.device.driver, SLAVE: system.slave.robot.driver}
        return cls(
            file=configuration.path,
            sides=tuple(sides),
            rate_hz=system.rate_hz,
            priority=realtime.priority,
            lock_memory=realtime.lock_memory,
            wakeful=realtime.wakeful,
            busy_poll=realtime.busy_poll,
            cpus=realtime.cpus,
            listen=listen if SLAVE in sides and listen[1] else None,
            slave=slave if MASTER in sides and slave[1] else None,
            key_file=link.key_file if link.security == "psk" else None,
            encrypted=link.security != "none",
            silence_s=link.silence_ms * 1e-3,
            drivers=tuple((side, names[side]) for side in sides),
        )

    @property
    def period_us(self) -> float:
        return 1e6 / self.rate_hz

    @property
    def pinned(self) -> dict[str, int]:
        """The processor that each local side is pinned to; empty where the file pins none."""
        if self.cpus is None:
            return {}
        return {side: self.cpus[SIDES.index(side)] for side in self.sides}

    @property
    def document(self) -> dict[str, Any]:
        """For JSON; of the key it says only whether one is used."""
        return {
            **{name: getattr(self, name) for name in PLAIN},
            "file": None if self.file is None else str(self.file),
            "listen": _joined(self.listen),
            "slave": _joined(self.slave),
            "drivers": dict(self.drivers),
        }


def _joined(address: tuple[str, int] | None) -> str | None:
    if address is None:
        return None
    host, port = address
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
