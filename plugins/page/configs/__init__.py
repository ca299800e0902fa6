"""The unit of the page."""

OTHERS = {"weberlink-monitor.service": "unit of the page"}
