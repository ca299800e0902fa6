"""The state of a session for Foxglove's diagnostics panels, which take the fields of diagnostic_msgs/DiagnosticArray.

A channel in JSON serves them, as they go by the name of the schema.
"""

from collections.abc import Mapping
from typing import Any

from weberlink.apps.bridge.foxglove.primitives import moment
from weberlink.apps.monitor.session import WatchedSession
from weberlink.protocol.states import State
from weberlink.system.configuration import SIDES
from weberlink.system.verdict import FAILURE

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
OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/DiagnosticStatus."""
FIGURES = {
    "ticks missed": ("ticks_missed", 0),
    "datagrams lost": ("datagrams_lost", 0),
    "round trip [us]": ("rtt_us", 0),
    "lateness [us]": ("lateness_us", 0),
    "Weber factor": ("weber", 3),
}
"""Fields of the newest record, with their decimal places."""


def diagnostics(session: WatchedSession, at_ns: int) -> dict[str, Any]:
    """One status for the session, and one for each side."""
    figures, stamp = session.figures(), moment(at_ns)
    alarms = figures["alarms"]
    level = STALE if session.ended else max((_level(alarm) for alarm in alarms), default=OK)
    told = "; ".join(alarm["text"] for alarm in alarms) or "good"
    rates = {f"{name} packets/s": rate for name, rate in figures["packets_per_s_now"].items()}
    saved = {f"{name} saved": share for name, share in figures["reduction_now"].items()}
    whole = _status("session", level, "over" if session.ended else told, session.name, rates | saved)
    hardware = {side: _driver(session, side) for side in SIDES}
    sides = [_side(side, record, figures, hardware[side]) for side, record in session.last.items()]
    return {
        "header": {"stamp": {"sec": stamp.sec, "nsec": stamp.nsec}, "frame_id": ""},
        "status": [whole, *sides],
    }


def _level(alarm: Mapping[str, Any]) -> int:
    return ERROR if alarm["level"] == FAILURE else WARN


def _side(side: str, record: Any, figures: Mapping[str, Any], hardware: str) -> dict[str, Any]:
    fault, engaged = figures["faults_now"][side], figures["engaged"][side]
    values: dict[str, Any] = {name: round(float(record[field]), places) for name, (field, places) in FIGURES.items()}
    values["state"] = State(int(record["state"])).name.lower()
    values["faults so far"] = sum(figures["faults"][side].values())
    level = ERROR if fault else OK if engaged else WARN
    return _status(side, level, fault or values["state"], hardware, values)


def _status(name: str, level: int, message: str, hardware: str, values: Mapping[str, Any]) -> dict[str, Any]:
    pairs = [{"key": key, "value": _worded(value)} for key, value in values.items()]
    return {
        "level": level,
        "name": f"weberlink: {name}",
        "message": message,
        "hardware_id": hardware,
        "values": pairs,
    }


def _worded(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else "unknown" if value is None else str(value)


def _driver(session: WatchedSession, side: str) -> str:
    """The driver of the device or robot; empty where it is not known."""
    part = session.description.get("system", {}).get(side, {})
    return str((part.get("device") or part.get("robot") or {}).get("driver", ""))
