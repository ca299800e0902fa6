"""What moves in the 3-D view: hand and robot with their forces, the fitted surface, and the places of packets."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from foxglove.messages import (
    FrameTransform,
    FrameTransforms,
    JointState,
    JointStates,
    PoseInFrame,
    SceneEntity,
    SceneUpdate,
)

from weberlink.apps.bridge.foxglove.patch import TRIANGLES, patch
from weberlink.apps.bridge.foxglove.primitives import (
    arrow,
    ball,
    color,
    entity,
    moment,
    orientation,
    pose,
    triangles,
    vector,
)
from weberlink.apps.bridge.foxglove.solids import LEAST_REACH_M
from weberlink.geometry.vector import Vector, norm, scale
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.arm import ArmLayout
from weberlink.system.scoring.session import Records
from weberlink.telemetry.recording.ros import FIXED_FRAME

BODIES = {MASTER: "hand", SLAVE: "robot"}
ARMS = {MASTER: "leader", SLAVE: "follower"}
PLACES = {MASTER: ("position", "rotation_raw", "output"), SLAVE: ("output", "rotation_output", "raw")}
"""Fields of a record with place, orientation and force of a body."""
COLORS = {MASTER: "#58a6ff", SLAVE: "#ff9a4d"}
SURFACE, PACKETS = "#35d6ec", "#f06fe2"
LEAST_FORCE_N = 0.02
M_PER_N = 0.007
"""Length of an arrow in a view of `LEAST_REACH_M`."""
PACKETS_S = 4.0
"""How long the place of a packet is shown."""
MOST_PACKETS = 50
"""Most packets of a round that are shown, the newest."""


def vector_of(record: Any, name: str) -> Vector:
    x, y, z = map(float, record[name])
    return x, y, z


def pose_of(side: str, record: Any, at_ns: int) -> PoseInFrame:
    """Place and orientation of the hand (master) or of the robot (slave)."""
    place, turned, _ = PLACES[side]
    return PoseInFrame(timestamp=moment(at_ns), frame_id=FIXED_FRAME, pose=pose(record[place], record[turned]))


def frames(newest: Mapping[str, tuple[Any, int]]) -> FrameTransforms:
    """The frames of the bodies; `newest` has record and time [ns since 1970] by side."""
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=moment(at_ns),
                parent_frame_id=FIXED_FRAME,
                child_frame_id=BODIES[side],
                translation=vector(record[PLACES[side][0]]),
                rotation=orientation(record[PLACES[side][1]]),
            )
            for side, (record, at_ns) in newest.items()
        ]
    )


def bodies(newest: Mapping[str, tuple[Any, int]], reach: float) -> SceneUpdate:
    """Hand and robot as balls, with the force that each feels as an arrow, and the surface that was fitted."""
    entities = [_body(side, record, at_ns, reach) for side, (record, at_ns) in newest.items()]
    if newest:
        side = MASTER if MASTER in newest else SLAVE
        entities.append(_surface(side, *newest[side], reach))
    return SceneUpdate(entities=entities)


def _body(side: str, record: Any, at_ns: int, reach: float) -> SceneEntity:
    size = reach / LEAST_REACH_M
    colored, place, force = color(COLORS[side]), record[PLACES[side][0]], vector_of(record, PLACES[side][2])
    shown = norm(force) > LEAST_FORCE_N
    arrows = [arrow(place, scale(force, M_PER_N * size), 0.0012 * size, colored)] if shown else []
    return entity(BODIES[side], at_ns, {"spheres": [ball(place, 0.004 * size, colored)], "arrows": arrows})


def _surface(side: str, record: Any, at_ns: int, reach: float) -> SceneEntity:
    corners = patch(record, vector_of(record, PLACES[side][0]), 0.3 * reach)
    drawn = [] if corners is None else [triangles(corners.tolist(), TRIANGLES, color(SURFACE, 0.35))]
    return entity("surface", at_ns, {"triangles": drawn})


def packets(slave: Records, times_ns: Any, reach: float) -> SceneUpdate | None:
    """The places of the robot at which it sent an update; None if it sent none."""
    entities = []
    for row in np.flatnonzero(slave["sent"] > 0)[-MOST_PACKETS:]:
        mark = ball(slave["output"][row], 0.002 * reach / LEAST_REACH_M, color(PACKETS, 0.8))
        name, at_ns = f"packet {slave['tick'][row]}", int(times_ns[row])
        entities.append(entity(name, at_ns, {"spheres": [mark]}, lifetime_s=PACKETS_S))
    return SceneUpdate(entities=entities) if entities else None


def joints_of(side: str, record: Any, arm: ArmLayout, at_ns: int) -> JointStates:
    """Angles [rad] and torques [N m] of all axes: of the leader those it feels, of the follower those it measures."""
    torques = record["joint_output" if side == MASTER else "joint_raw"]
    return JointStates(
        timestamp=moment(at_ns),
        joints=[
            JointState(name=name, position=float(record["joint_position"][place]), effort=float(torques[place]))
            for name, place in zip(arm.axes, arm.places, strict=True)
        ],
    )
