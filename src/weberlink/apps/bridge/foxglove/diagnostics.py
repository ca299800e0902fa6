"""The state of a session for Foxglove's diagnostics panels, which take the fields of diagnostic_msgs/DiagnosticArray.

A channel in JSON serves them, as they go by the name of the schema.
"""

from collections.abc import Iterable
from typing import Any

from weberlink.apps.bridge.diagnostics import Level, Status
from weberlink.apps.bridge.foxglove.primitives import moment
from weberlink.system.verdict import FAILURE
from weberlink.watching.session import WatchedSession

SCHEMA_NAME = "diagnostic_msgs/DiagnosticArray"
_TEXT = {"type": "string"}
_TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_HEADER = {"type": "object", "properties": {"stamp": _TIME, "frame_id": _TEXT}}
_PAIRS = {"type": "array", "items": {"type": "object", "properties": {"key": _TEXT, "value": _TEXT}}}
_STATUS = {
    "type": "object",
    "properties": {
        "level": {"type": "integer"},
        "name": _TEXT,
        "message": _TEXT,
        "hardware_id": _TEXT,
        "values": _PAIRS,
    },
}
SCHEMA: dict[str, Any] = {
    "title": SCHEMA_NAME,
    "type": "object",
    "properties": {"header": _HEADER, "status": {"type": "array", "items": _STATUS}},
}


def diagnostics(statuses: Iterable[Status], at_ns: int) -> dict[str, Any]:
    """A message with these statuses."""
    stamp = moment(at_ns)
    return {
        "header": {"stamp": {"sec": stamp.sec, "nsec": stamp.nsec}, "frame_id": ""},
        "status": [
            {
                "level": status.level,
                "name": status.name,
                "message": status.message,
                "hardware_id": status.hardware,
                "values": [{"key": key, "value": value} for key, value in status.values.items()],
            }
            for status in statuses
        ],
    }


def condition(session: WatchedSession) -> Status:
    """The condition of a whole session: what both sides together show."""
    figures = session.figures()
    alarms = figures["alarms"]
    level = max((Level.ERROR if alarm["level"] == FAILURE else Level.WARN for alarm in alarms), default=Level.OK)
    told = "; ".join(alarm["text"] for alarm in alarms) or "good"
    if session.ended:
        level, told = Level.STALE, "over"
    rates = {f"{name} packets [1/s]": rate for name, rate in figures["packets_per_s_now"].items()}
    saved = {f"{name} saved": share for name, share in figures["reduction_now"].items()}
    values = {name: "unknown" if value is None else f"{value:.6g}" for name, value in (rates | saved).items()}
    return Status(level, "weberlink: session", told, session.name, values)
