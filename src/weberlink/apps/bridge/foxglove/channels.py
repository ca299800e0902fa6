"""The topics of the live view, which are the same for every session."""

from typing import Any

from foxglove import Channel, Context, Schema
from foxglove.channels import (
    FrameTransformsChannel,
    JointStatesChannel,
    LogChannel,
    PoseInFrameChannel,
    SceneUpdateChannel,
)

from weberlink.apps.bridge.foxglove import diagnostics
from weberlink.apps.bridge.foxglove.motion import ARMS, BODIES
from weberlink.system.scoring.session import Records
from weberlink.telemetry.recording.message import (
    ENCAPSULATION,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    SCHEMA_TEXT,
    TOPICS,
)

SCENE, LOG = "/weberlink/scene", "/weberlink/log"
"""Topics of which a new client is sent what was before."""
FELT_SCHEMA: dict[str, Any] = {
    "title": "weberlink.FeltError",
    "description": "Error of the felt force and its bound [N; N m of an arm], and the error in units of the bound.",
    "type": "object",
    "properties": {name: {"type": "number"} for name in ("error", "bound", "deadbands")},
}


class Channels:
    """All topics; those of arms stay silent in other sessions, and the other way round.

    Args:
        context: of the server.
    """

    def __init__(self, context: Context) -> None:
        tick = Schema(name=SCHEMA_NAME, encoding=SCHEMA_ENCODING, data=SCHEMA_TEXT.encode())
        self.ticks = {
            side: Channel(topic, schema=tick, message_encoding=MESSAGE_ENCODING, context=context)
            for side, topic in TOPICS.items()
        }
        self.poses = {side: PoseInFrameChannel(f"/weberlink/{name}", context=context) for side, name in BODIES.items()}
        self.joints = {side: JointStatesChannel(f"/weberlink/{name}", context=context) for side, name in ARMS.items()}
        self.frames = FrameTransformsChannel("/tf", context=context)
        self.scene = SceneUpdateChannel(SCENE, context=context)
        self.bodies = SceneUpdateChannel("/weberlink/bodies", context=context)
        self.packets = SceneUpdateChannel("/weberlink/packets", context=context)
        self.felt = Channel("/weberlink/felt_error", schema=FELT_SCHEMA, context=context)
        self.log = LogChannel(LOG, context=context)
        self.diagnostics = Channel("/diagnostics", schema=diagnostics.SCHEMA, context=context)

    @property
    def have_readers(self) -> bool:
        """Whether a client reads one of them."""
        moving = (self.frames, self.bodies, self.packets, self.felt, self.log, self.diagnostics)
        every: tuple[Any, ...] = (
            *self.ticks.values(),
            *self.poses.values(),
            *self.joints.values(),
            self.scene,
            *moving,
        )
        return any(channel.has_sinks() for channel in every)

    def put_ticks(self, side: str, records: Records, times_ns: list[int]) -> None:
        """Every record as it is: a packed one is the body of its message, see `weberlink.telemetry.recording`."""
        channel, body, size = self.ticks[side], records.tobytes(), records.itemsize
        if channel.has_sinks():
            for row, at_ns in enumerate(times_ns):
                channel.log(ENCAPSULATION + body[row * size : (row + 1) * size], log_time=at_ns)
