"""The WebSocket server for Foxglove: shows the followed session, and takes parameters from clients."""

from collections import deque
from collections.abc import Sequence
from threading import Event
from time import time_ns

import foxglove
from foxglove import Context, Parameter, StatusLevel
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer

from weberlink.apps.bridge.follow import Tell
from weberlink.apps.bridge.foxglove.channels import LOG, SCENE, Channels
from weberlink.apps.bridge.foxglove.parameters import LiveParameters, as_parameters
from weberlink.apps.bridge.foxglove.shown import ShownSession
from weberlink.system.scoring.session import Records
from weberlink.watching.rings import RingSource

NAME = "WeberLink"
FIGURES_S = 1.0
"""Period of the diagnostics."""
ALONE_S = 0.25
"""Period of counting records while no client reads."""
BACKLOG = 4096
"""Messages that wait for a slow client, of which the oldest are dropped: two seconds of ticks of both sides."""
REFUSED = "weberlink-refused"
"""Name of the status that tells the last refusal."""


class FoxgloveBridge(ServerListener):
    """A `weberlink.apps.bridge.follow.Bridge`; the calls of a `ServerListener` come from threads of the server.

    Args:
        listen: address to serve.
        port: 0 for any that is free.
        allow_changes: whether clients may set parameters.
        tell: called with lines for the user.

    Raises:
        RuntimeError: the address or the port cannot be served.
    """

    def __init__(self, listen: str, port: int, *, allow_changes: bool, tell: Tell) -> None:
        self._context = Context()  # the channels close with it
        self._channels = Channels(self._context)
        self._parameters = LiveParameters(allow=allow_changes, tell=tell)
        self._shown: ShownSession | None = None
        self._newcomers: deque[tuple[int, str]] = deque()
        self._show_at = self._figures_at = 0.0
        self._tell = tell
        self._served = Event()
        """Set when `_server` is there: a client may call before."""
        self._server = self._serve(listen, port)
        self._served.set()

    def _serve(self, listen: str, port: int) -> WebSocketServer:
        return foxglove.start_server(
            name=NAME,
            host=listen,
            port=port,
            capabilities=[Capability.Parameters],
            server_listener=self,
            context=self._context,
            message_backlog_size=BACKLOG,
        )

    @property
    def port(self) -> int:
        return self._server.port

    def begin(self, session: str, source: RingSource) -> None:
        if self._shown is not None and self._shown.watched.name == session and not self._shown.watched.ended:
            self._shown.admit(source)
        else:
            self._shown = ShownSession(session, source, self._channels)
            self._parameters.follow(self._shown.watched)
        now = time_ns()
        self._channels.scene.log(self._shown.scene(now), log_time=now)

    def put(self, source: RingSource, records: Records) -> None:
        if self._shown is not None:
            self._shown.put(source.side, records)

    def end(self, source: RingSource) -> None:
        if self._shown is not None:
            self._shown.end(source.side)

    def look(self, now: float) -> None:
        shown, at_ns = self._shown, time_ns()
        if shown is not None:
            while self._newcomers:  # first, so that they are told no event twice
                self._greet(shown, *self._newcomers.popleft(), at_ns)
            if not shown.watched.ended and (now >= self._show_at or self._channels.have_readers):
                self._show_at = now + ALONE_S
                shown.show()
            if now >= self._figures_at:
                self._figures_at = now + FIGURES_S
                shown.show_diagnostics(at_ns, now)
        changed = self._parameters.changed(now)
        if changed:
            self._server.publish_parameter_values(as_parameters(changed))

    def close(self) -> None:
        self._server.stop()
        self._parameters.close()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """A client begins to read a topic."""
        if channel.topic in (SCENE, LOG):
            self._newcomers.append((client.id, channel.topic))

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

    def _greet(self, shown: ShownSession, client: int, topic: str, at_ns: int) -> None:
        """Send a new client what was before."""
        if topic == LOG:
            shown.repeat_log(client)
        else:
            self._channels.scene.log(shown.scene(at_ns), log_time=at_ns, sink_id=client)
