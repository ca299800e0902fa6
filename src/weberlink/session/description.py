"""What passes between a daemon and others: the order that starts it, its description while it runs, how it failed.

The description is a small file beside the ring with the configuration, the names of numbers in the telemetry, and what
the side knows of its peer and of the paths to it. It is written before the ring appears and removed after it.
"""

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import mkstemp
from time import monotonic
from typing import TYPE_CHECKING, Any

from weberlink.bounded_json import parse
from weberlink.child_process import Order
from weberlink.config import Configuration
from weberlink.control.port import Port
from weberlink.session.composition.channels import banks
from weberlink.session.composition.link import default_name, live_choices
from weberlink.telemetry.runtime_directory import open_file

if TYPE_CHECKING:
    from weberlink.protocol.paths import LinkPath

LONGEST = 1_000_000  # largest description [bytes]; the shipped configurations take up to 10 kB
RANGE = ("lower_rad", "upper_rad")
"""Of an arm: least and largest angles that the follower is commanded, axis by axis; where they are known."""


@dataclass(frozen=True)
class DaemonOrder(Order):
    side: str  # one of `SIDES`
    file: str
    overrides: tuple[str, ...]  # as of `--set`
    ring: str
    duration_s: float | None = None  # length of the run; None to run until it is stopped
    take_over: bool = False  # whether a master replaces another one that the slave serves
    # When the run was ordered, on `time.monotonic` [s]: an earlier stop does not concern it
    ordered_at: float = field(default_factory=monotonic)


def failure(outcome: str, trace: Sequence[str] = ()) -> dict[str, Any]:
    """The summary of a daemon without a first tick, or one that could not report its end; `trace` of what it raised."""
    unknown: dict[str, Any] = {"faults": {}, "drops": {}, "peer": None, "paths": [], "realtime": None}
    return {"outcome": outcome, "trace": list(trace), "failed": True} | unknown


def path_beside(ring: str | Path) -> Path:
    return Path(ring).with_suffix(".json")


def describe(configuration: Configuration, side: str, name: str = "", port: Port | None = None) -> dict[str, Any]:
    """Describe the daemon in this process; the paths of keys and secrets are left out. The port of an arm, where it is
    known, adds the range of its angles."""
    system = configuration.system
    force, torque = banks(system)
    options = {} if system.link.finder is None else system.link.finder.options
    secret: dict[str, Any] = {"key_file": True, "finder": {name: True for name in options if name != "peer"}}
    angles = None if port is None else port.angle_range
    return {
        "side": side,
        "name": name or getattr(system.link.names, side) or default_name(side, system.link.listen),
        "file": str(configuration.path.absolute()),
        "pid": os.getpid(),
        "rate_hz": system.rate_hz,
        "system": system.model_dump(mode="json", exclude={"link": secret}),
        "finds_path": configuration.finds_path,
        "bank": list(force),
        **({} if torque is None else {"torque_bank": list(torque)}),
        "changes": sorted(live_choices(system)),
        **({} if angles is None else dict(zip(RANGE, angles, strict=True))),
    }


class Description:
    def __init__(self, ring: str | Path, described: dict[str, Any]) -> None:
        self._path = path_beside(ring)
        self._text = json.dumps(described)

    def publish(self, peer: dict[str, str] | None = None, paths: "Iterable[LinkPath]" = ()) -> None:
        """Write the file atomically, readable by this user only; may be called in a tick, for some 50 us."""
        news = json.dumps({"peer": peer, "paths": [path._asdict() for path in paths]})
        fd, draft = mkstemp(prefix=f"{self._path.name}.", dir=self._path.parent)
        try:
            with os.fdopen(fd, "wb") as file:
                file.write(f"{self._text[:-1]}, {news[1:]}".encode())
            Path(draft).replace(self._path)
        except BaseException:
            Path(draft).unlink(missing_ok=True)
            raise

    def remove(self) -> None:
        self._path.unlink(missing_ok=True)


def read(ring: str | Path) -> dict[str, Any] | None:
    """Read the description beside a ring; None if there is none, or none that can be trusted."""
    try:
        with os.fdopen(open_file(path_beside(ring), LONGEST), "rb") as file:
            found = parse(file.read(LONGEST + 1), LONGEST)
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
