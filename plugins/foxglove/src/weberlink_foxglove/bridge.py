"""`bridge foxglove`: a server for Foxglove with the topics of `bridge ros2`, every tick, the events and parameters."""

from collections import deque
from collections.abc import Sequence
from functools import partial
from importlib.resources import files
from threading import Event
from typing import Any

import foxglove
import numpy as np
from foxglove import Channel, Context, Parameter, Schema, StatusLevel
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer

from weberlink.config import SIDES, SLAVE
from weberlink.telemetry.reader import Records
from weberlink_figures.message import (
    ENCAPSULATION,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    SCHEMA_TEXT,
    TOPICS,
    Origin,
)
from weberlink_figures.tree import FAILURE
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.ros import topics
from weberlink_figures.watching.rows import felt_message
from weberlink_figures.watching.session import SessionEvent, WatchedSession
from weberlink_figures.wording import ALARM, INFO, WARN
from weberlink_foxglove.parameters import LiveParameters, as_parameters
from weberlink_ros2 import follow
from weberlink_ros2.diagnostics import Level, Status
from weberlink_ros2.markers import MARKERS
from weberlink_ros2.messages import encode_body, types
from weberlink_ros2.names import Qos
from weberlink_ros2.topics import BODIES, SCENE, TopicBridge

RATE_HZ = 30.0  # of what the 3-D view needs. Ticks come at the rate of the session, in pieces of this length.
ALONE_S = 0.25  # period of counting records while no client reads
BACKLOG = 4096
"""Messages that wait for a slow client, of which the oldest are dropped: two seconds of ticks of both sides."""
REFUSED = "weberlink-refused"  # name of the status that tells the last refusal
LAYOUT = "foxglove-live-layout.json"
LOG, LOG_TYPE = "/weberlink/log", "rcl_interfaces/msg/Log"
LEVELS = {INFO: 20, WARN: 30, ALARM: 40}
FELT = "/weberlink/felt_error"
FELT_SCHEMA: dict[str, Any] = {
    "title": "weberlink.FeltError",
    "description": "Error of the felt force and its bound [N; N m of an arm], and the error in units of the bound.",
    "type": "object",
    "properties": {name: {"type": "number"} for name in ("error_n", "bound_n", "deadbands")},
}


class ServeError(RuntimeError):
    """The address or the port cannot be served."""


class FoxgloveTopic:
    """A `weberlink_ros2.topics.Publisher` for Foxglove; `schema` is name and text of the messages, as ROS has them."""

    def __init__(self, name: str, schema: tuple[str, str], context: Context) -> None:
        ros = Schema(name=schema[0], encoding=SCHEMA_ENCODING, data=schema[1].encode())
        self.channel = Channel(name, schema=ros, message_encoding=MESSAGE_ENCODING, context=context)
        self.sequence = 0

    def put_body(self, cdr: bytes, stamp_ns: int, client: int | None = None) -> None:
        if self.channel.has_sinks():
            self.sequence += 1
            self.channel.log(ENCAPSULATION + cdr, log_time=stamp_ns, sink_id=client)


class FoxgloveServer(ServerListener):
    """A `weberlink_ros2.topics.TopicNode`; the calls of a `ServerListener` come from threads of the server."""

    def __init__(self, parameters: LiveParameters, tell: follow.Tell) -> None:
        self.context = Context()  # the channels close with it
        self.newcomers: deque[int] = deque()  # clients that have begun to read the log
        self._parameters, self._tell, self._served = parameters, tell, Event()
        self._server: WebSocketServer  # there when `_served` is set; a client may call before

    def serve(self, listen: str, port: int) -> None:
        """Begin to serve the topics that are there. Raises RuntimeError if the address or port cannot be served."""
        self._server = foxglove.start_server(
            name="WeberLink", host=listen, port=port, capabilities=[Capability.Parameters], server_listener=self,
            context=self.context, message_backlog_size=BACKLOG,
        )  # fmt: skip
        self._served.set()

    @property
    def port(self) -> int:
        return self._server.port

    def publisher(self, topic: str, type_name: str, qos: Qos | None = None) -> FoxgloveTopic:
        del qos
        return FoxgloveTopic(topic, (type_name, types().generate_msgdef(type_name, ros_version=2)[0]), self.context)

    def show_changes(self, now: float) -> None:
        """Tell the clients of parameters that have changed."""
        changed = self._parameters.changed(now)
        if changed:
            self._server.publish_parameter_values(as_parameters(changed))

    def close(self) -> None:
        self._server.stop()
        self._parameters.close()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """A client begins to read a topic."""
        if channel.topic == LOG:
            self.newcomers.append(client.id)

    def on_get_parameters(
        self, client: Client, param_names: Sequence[str], request_id: str | None = None
    ) -> list[Parameter]:
        """What is in force."""
        del client, request_id
        return as_parameters(self._parameters.in_force(), param_names)

    def on_set_parameters(
        self, client: Client, parameters: Sequence[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Ask for a change; returns what is in force then, whatever came of it."""
        del client, request_id
        asked = {parameter.name: parameter.get_value() for parameter in parameters}
        if not asked:
            return []
        answer = self._parameters.change(asked)
        self._served.wait()
        if answer.get("accepted"):
            self._server.remove_status([REFUSED])
        else:
            self._server.publish_status(f"{', '.join(asked)}: {answer['why']}", StatusLevel.Error, REFUSED)
            self._tell(f"refused: {', '.join(asked)}: {answer['why']}")
        return as_parameters(self._parameters.in_force(), list(asked))

    def on_parameters_subscribe(self, param_names: Sequence[str]) -> None:
        """A client wants to be told of changes."""
        self._parameters.wanted |= set(param_names)

    def on_parameters_unsubscribe(self, param_names: Sequence[str]) -> None:
        """No client wants to be told any more."""
        self._parameters.wanted -= set(param_names)


class FoxgloveBridge(TopicBridge):
    """Publishes by a server for Foxglove, whose clients may set parameters if `allow_changes`; raises ServeError if it
    cannot serve.
    """

    def __init__(self, listen: str, port: int, *, allow_changes: bool, tell: follow.Tell) -> None:
        self._parameters = LiveParameters(allow=allow_changes)
        self.server = FoxgloveServer(self._parameters, tell)
        super().__init__(self.server, Qos(), RATE_HZ, tell)
        tick, context = (SCHEMA_NAME, SCHEMA_TEXT), self.server.context
        self._ticks = {side: FoxgloveTopic(topic, tick, context) for side, topic in TOPICS.items()}
        self._log = self.server.publisher(LOG, LOG_TYPE)
        self._felt = Channel(FELT, schema=FELT_SCHEMA, context=context)
        self._origins: dict[str, Origin] = {}
        self._watched: WatchedSession | None = None
        self._told, self._look_at = 0, 0.0
        # All topics are there before any client, as the server refuses one that subscribes to a topic at once.
        known = {topic: of for side in SIDES for arm in (False, True) for topic, of in topics(side, arm=arm).items()}
        for topic, type_name in {**known, SCENE: MARKERS, BODIES: MARKERS}.items():
            self._publish(topic, type_name)
        try:
            self.server.serve(listen, port)
        except RuntimeError as error:
            raise ServeError(f"--listen {listen}, --port {port}: cannot be served ({error})") from None

    def begin(self, session: str, source: RingSource) -> None:
        own = RingSource(source.ring)  # a ring has as many readers as want it
        if self._watched is not None and self._watched.name == session and not self._watched.ended:
            self._watched.admit(own)
        else:
            if self._watched is not None:
                self._watched.close()
            self._watched, self._told = WatchedSession(session, own), 0
            self._parameters.follow(self._watched)
        self._origins[source.side] = Origin(
            source.side, source.rate_hz, source.began + source.wall_offset_s, source.began
        )
        super().begin(session, source)

    def put(self, source: RingSource, records: Records) -> None:
        # A packed record is the body of its message, see `weberlink_figures.message`.
        ticks, data, size = self._ticks[source.side], records.tobytes(), records.itemsize
        for row, at_ns in enumerate(self._origins[source.side].log_times_ns(records["at"]).tolist()):
            ticks.put_body(data[row * size : (row + 1) * size], at_ns)
        super().put(source, records)

    def look(self, now: float) -> None:
        watched = self._watched
        if watched is not None:
            while self.server.newcomers:  # first, so that they are told no event twice
                client = self.server.newcomers.popleft()
                for event in watched.log.events:
                    self._show_event(event, client)
            if now >= self._look_at or self._felt.has_sinks() or self._log.channel.has_sinks():
                self._look_at = now + ALONE_S
                felt = watched.look().felt
                if len(felt[0]) and self._felt.has_sinks():
                    self._show_felt(felt_message(*felt, watched.origin, watched.layout), watched.origin)
                for event in watched.log.since(self._told):
                    self._show_event(event)
                self._told = watched.log.count
        super().look(now)
        self.server.show_changes(now)

    def own_status(self) -> Status:
        """The condition of the whole session: what both sides together show."""
        watched = self._watched
        if watched is None:
            return Status(Level.OK, "weberlink: session", "waits for a session", "", {})
        alarms, pace = watched.alarms(), watched.pace
        level = max((Level.ERROR if alarm.level == FAILURE else Level.WARN for alarm in alarms), default=Level.OK)
        told = "; ".join(alarm.text for alarm in alarms) or "good"
        if watched.ended:
            level, told = Level.STALE, "over"
        rates = {f"{name} packets [1/s]": of.packets_per_s for name, of in pace.items()}
        saved = {f"{name} saved": of.reduction for name, of in pace.items()}
        values = {name: "unknown" if value is None else f"{value:.6g}" for name, value in (rates | saved).items()}
        return Status(level, "weberlink: session", told, watched.name, values)

    def _show_felt(self, message: dict[str, Any], origin_s: float) -> None:
        rows = zip(*(message[name] for name in ("t", *FELT_SCHEMA["properties"])), strict=True)
        for t, *values in rows:
            shown = dict(zip(FELT_SCHEMA["properties"], values, strict=True))
            (at_ns,) = self._origins[SLAVE].log_times_ns(np.array([origin_s + t])).tolist()
            self._felt.log({name: value for name, value in shown.items() if value is not None}, log_time=at_ns)

    def _show_event(self, event: SessionEvent, client: int | None = None) -> None:
        made, at_ns = types().types, round(event.wall * 1e9)
        stamp = made["builtin_interfaces/msg/Time"](at_ns // 10**9, at_ns % 10**9)
        line = made[LOG_TYPE](stamp, LEVELS[event.level], event.side or "session", event.text, "", "", 0)
        self._log.put_body(encode_body(line, LOG_TYPE), at_ns, client)


def run(session: str | None, listen: str, port: int, *, allow_changes: bool) -> None:
    """Show sessions until a signal, from the main thread: the one of this name, or the newest; see `FoxgloveBridge`."""
    tell = partial(follow.tell, "foxglove")
    bridge = FoxgloveBridge(listen, port, allow_changes=allow_changes, tell=tell)
    host = f"[{listen}]" if ":" in listen else listen
    may = "may set parameters" if allow_changes else "only look"
    layout = files("weberlink_foxglove.configs") / LAYOUT
    tell(f"open ws://{host}:{bridge.server.port} in Foxglove (clients {may}); layout: {layout}")
    follow.run(bridge, session, 1.0 / RATE_HZ, tell)
