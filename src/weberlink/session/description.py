"""The description of a running daemon: a small file beside its ring, for observers.

It holds the configuration, the names of numbers in the telemetry, what the side knows of its peer, and the paths to it.
It is written
before the ring appears and removed after it, so that every ring has a description.
"""

import json
import os
from collections.abc import Iterable
from getpass import getuser
from pathlib import Path
from socket import gethostname
from tempfile import mkstemp
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from weberlink.bounded_json import parse
from weberlink.config import SLAVE, Configuration
from weberlink.config.model import split_address
from weberlink.geometry.joints import Joints
from weberlink.protocol.handshake import LONGEST_NAME
from weberlink.session.composition.channels import banks, motion_bank
from weberlink.session.composition.link import live_choices
from weberlink.session.port import Port
from weberlink.telemetry.runtime_directory import open_file

if TYPE_CHECKING:
    from weberlink.protocol.aio.paths import PathFacts

LONGEST = 1_000_000
"""Largest description [bytes]; the shipped configurations take up to 10 kB."""


def path_beside(ring: str | Path) -> Path:
    return Path(ring).with_suffix(".json")


@runtime_checkable
class HasAngleRange(Protocol):
    """The port of an arm."""

    @property
    def angle_range(self) -> tuple[Joints, Joints]:
        """Least and largest angles of all axes in the frame of the follower [rad]."""


def describe(configuration: Configuration, side: str, port: Port | None = None) -> dict[str, Any]:
    """Describe the daemon in this process; the paths of keys and secrets are left out.

    Args:
        configuration: of the session.
        side: master or slave.
        port: of the side, where it is known; that of an arm adds the range of its angles.
    """
    system = configuration.system
    force, torque = banks(system)
    options = {} if system.link.finder is None else system.link.finder.options
    secret: dict[str, Any] = {"key_file": True, "finder": {name: True for name in options if name != "peer"}}
    return {
        "side": side,
        "name": getattr(system.link.names, side) or default_name(side, system.link.listen),
        "file": str(configuration.path.absolute()),
        "pid": os.getpid(),
        "rate_hz": system.rate_hz,
        "system": system.model_dump(mode="json", exclude={"link": secret}),
        "finds_path": configuration.finds_path,
        "bank": list(force),
        "position_bank": list(motion_bank(system)),
        **({} if torque is None else {"torque_bank": list(torque)}),
        "changes": sorted(live_choices(system)),
        **(
            dict(zip(("lower_rad", "upper_rad"), port.angle_range, strict=True))
            if isinstance(port, HasAngleRange)
            else {}
        ),
    }


class Description:
    """The file of one daemon.

    Args:
        ring: beside which it lies.
        described: as of `describe`.
    """

    def __init__(self, ring: str | Path, described: dict[str, Any]) -> None:
        self._path = path_beside(ring)
        self._text = json.dumps(described)

    def publish(self, peer: dict[str, str] | None = None, paths: "Iterable[PathFacts]" = ()) -> None:
        """Write the file atomically, readable by this user only; may be called in a tick, for some 50 us.

        Args:
            peer: what the side knows of its peer (`weberlink.session.side.PeerFacts`).
            paths: those in use.
        """
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


def default_name(side: str, listen: str) -> str:
    """The name of a side where the file gives none."""
    host = gethostname()
    if side == SLAVE:
        name = f"{host}:{split_address(listen)[1]}"
    else:
        try:
            name = f"{getuser()}@{host}"
        except (KeyError, OSError):  # a user id without a name, as in containers
            name = f"{os.getuid()}@{host}"
    return "".join(letter for letter in name if letter.isprintable())[-LONGEST_NAME:]


def read(ring: str | Path) -> dict[str, Any] | None:
    """Read the description beside a ring; None if there is none, or none that can be trusted."""
    try:
        with os.fdopen(open_file(path_beside(ring), LONGEST), "rb") as file:
            found = parse(file.read(LONGEST + 1), LONGEST)
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
