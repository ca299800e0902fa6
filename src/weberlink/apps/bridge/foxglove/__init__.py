"""`weberlink bridge foxglove`: a live view in Foxglove, and in what else speaks its protocol."""

from functools import partial
from importlib.resources import files

from weberlink.apps.bridge import follow
from weberlink.apps.bridge.foxglove.bridge import FoxgloveBridge
from weberlink.apps.monitor.address import MonitorError

PERIOD_S = 1.0 / 30.0
"""Between two rounds: the rate of the 3-D view. Ticks come at the rate of the session, in pieces of this length."""
LAYOUT = "foxglove-live-layout.json"


def run(session: str | None, listen: str, port: int, *, allow_changes: bool) -> None:
    """Show sessions until a signal, from the main thread.

    Args:
        session: name of the session to follow; None for the newest.
        listen: address to serve.
        port: 0 for any that is free.
        allow_changes: whether clients may set parameters.

    Raises:
        MonitorError: the address or the port cannot be served.
    """
    tell = partial(follow.tell, "foxglove")
    try:
        bridge = FoxgloveBridge(listen, port, allow_changes=allow_changes, tell=tell)
    except RuntimeError as error:
        raise MonitorError(f"--listen {listen}, --port {port}: cannot be served ({error})") from None
    host = f"[{listen}]" if ":" in listen else listen
    may = "may set parameters" if allow_changes else "only look"
    tell(f"open ws://{host}:{bridge.port} in Foxglove (clients {may}); layout: {files('weberlink.configs') / LAYOUT}")
    follow.run(bridge, session, PERIOD_S, tell)
