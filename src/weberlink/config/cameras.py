"""Pictures of the robot beside a session: made and carried by processes of another distribution, never by a daemon."""

from typing import Any

from weberlink.registry import Registry

CAMERAS: Registry[Any] = Registry("camera driver", {}, "weberlink.cameras")
"""Classes with `Options`, a pydantic model of the section `slave.cameras`, `MODULE`, and `preview(robot)`, the options
by which one shows a robot of this driver that a person tries.

The launcher of each side starts `python -m MODULE ORDER` beside its daemon, with the order of the daemon
(`weberlink.session.description.DaemonOrder`) in JSON; with both sides on one host, for the slave alone. The process
serves pictures at `weberlink.telemetry.pictures.path_beside` its ring, once it has read its keys, and ends with its
parent.
"""
