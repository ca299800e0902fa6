"""What a session asks of the machine: that of a file, or the defaults of every file where there is none."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weberlink.system.configuration import MASTER, SIDES, SLAVE, Configuration
from weberlink.system.configuration.model import RealtimeSettings, split_address

DEFAULTS = RealtimeSettings()
DEFAULT_RATE_HZ = 1000.0


@dataclass(frozen=True, slots=True)
class Needs:
    """What is asked for.

    Args:
        file: where it is written; None for the defaults.
        sides: that are to run here.
        rate_hz: of the ticks.
        priority: of SCHED_FIFO; 0 for the normal scheduler.
        lock_memory: whether daemons lock theirs.
        wakeful: whether daemons keep processors out of deep idle states.
        cpus: that the master and the slave are pinned to.
        listen: host and port that the slave binds; None where it does not run here, or on any free port.
        slave: host and port where the master looks for it; None where the master does not run here.
        key_file: the pre-shared key; None where none is used.
        encrypted: whether datagrams are.
        silence_s: that counts as a fault.
        drivers: by side.
    """

    file: Path | None = None
    sides: Sequence[str] = SIDES
    rate_hz: float = DEFAULT_RATE_HZ
    priority: int = DEFAULTS.priority
    lock_memory: bool = DEFAULTS.lock_memory
    wakeful: bool = DEFAULTS.wakeful
    cpus: tuple[int, int] | None = None
    listen: tuple[str, int] | None = None
    slave: tuple[str, int] | None = None
    key_file: Path | None = None
    encrypted: bool = True
    silence_s: float = 0.1
    drivers: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, configuration: Configuration, sides: Sequence[str] = SIDES) -> "Needs":
        """Those of a file."""
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
        """The processor of each side that runs here; empty where the file pins none."""
        if self.cpus is None:
            return {}
        return {side: self.cpus[SIDES.index(side)] for side in self.sides}

    @property
    def document(self) -> dict[str, Any]:
        """For JSON; says of the key no more than whether there is to be one."""
        return {
            "file": None if self.file is None else str(self.file),
            "sides": list(self.sides),
            "rate_hz": self.rate_hz,
            "priority": self.priority,
            "lock_memory": self.lock_memory,
            "wakeful": self.wakeful,
            "cpus": None if self.cpus is None else list(self.cpus),
            "listen": _joined(self.listen),
            "slave": _joined(self.slave),
            "encrypted": self.encrypted,
            "silence_s": self.silence_s,
            "drivers": dict(self.drivers),
        }


def _joined(address: tuple[str, int] | None) -> str | None:
    if address is None:
        return None
    host, port = address
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
