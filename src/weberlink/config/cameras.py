"""Pictures of the robot beside a session: made and carried by processes of another distribution, never by a daemon."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weberlink.child_process import Order
from weberlink.registry import Registry

CAMERAS: Registry[Any] = Registry("camera driver", {}, "weberlink.cameras")
"""Classes with `Options`, a pydantic model of the section `slave.cameras`, `MODULE`, and `preview(robot)`, the options
by which one shows a robot of this driver that a person tries.

The launcher of each side starts `python -m MODULE ORDER` beside its daemon, with a `PicturesOrder` in JSON; with both
sides on one host, for the slave alone. The process listens at `path_beside` its ring, once it has read its keys, and
ends with its parent.
"""


@dataclass(frozen=True)
class PicturesOrder(Order):
    """What such a process does; as of `weberlink.session.description.DaemonOrder`."""

    side: str
    file: str
    overrides: tuple[str, ...]
    ring: str
    is_alone: bool  # whether the other side is on another host; else the pictures stay on this one


def path_beside(ring: str | Path) -> Path:
    """Where the pictures of a side are served."""
    return Path(ring).with_suffix(".pictures")
