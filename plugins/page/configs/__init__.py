"""The session of `weberlink try`, and the unit of the page."""

OTHERS = {"weberlink-monitor.service": "unit of the page"}
