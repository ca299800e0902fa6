"""What a page is told of a session before its first row: configuration, scene, names of numbers, what may change."""

from collections.abc import Mapping
from typing import Any

from weberlink.apps.monitor.scene import drawn
from weberlink.control.table import SCHEMES
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault

HYBRID = "hybrid"


def hello(session: str, descriptions: Mapping[str, dict[str, Any] | None], *, remote: bool) -> dict[str, Any]:
    """The greeting of a session, but for what depends on the page and on the moment.

    Args:
        session: its name.
        descriptions: of the sides that are there, as of `weberlink.system.description`; None for one that is not known.
        remote: whether the daemons are on another host.
    """
    known = [description for description in descriptions.values() if description is not None]
    any_: dict[str, Any] = known[0] if known else {}
    system = any_.get("system", {})
    limits = system.get("slave", {}).get("limits", {})
    changes = [] if remote else list(any_.get("changes", ()))
    return {
        "type": "hello",
        "session": session,
        "readonly": not changes,
        "remote": remote,
        "sides": {side: descriptions.get(side) for side in ("master", "slave")},
        "present": sorted(descriptions),
        "scene": drawn(system.get("slave", {}).get("scene", ()), files=not remote),
        "workspace_m": _corners(limits.get("workspace_m")),
        "changes": changes,
        "predictors": _predictors(any_),
        "schemes": list(any_.get("schemes", SCHEMES)),
        "settings": _settings(system),
        "generation": 0,
        "silence_ms": system.get("link", {}).get("silence_ms"),
        "rate_hz": any_.get("rate_hz"),
        "states": {str(state.value): state.name.lower() for state in State},
        "faults": {str(fault.value): fault.name.lower() for fault in Fault},
    }


def _corners(intervals: Any) -> list[list[float]] | None:
    """Lowest and highest corner [m] of intervals on x, y, z."""
    return None if intervals is None else [[low for low, _ in intervals], [high for _, high in intervals]]


def _predictors(description: Mapping[str, Any]) -> list[str]:
    names = list(description.get("bank", ()))
    choice = description.get("system", {}).get("codec", {}).get("force", {}).get("predictor", HYBRID)
    return [*names, choice] if len(names) > 1 else names


def _settings(system: Mapping[str, Any]) -> dict[str, Any]:
    """As configured; what was changed since is asked of the daemon."""
    force = system.get("codec", {}).get("force", {})
    return {
        "weber": force.get("weber"),
        "predictor": force.get("predictor"),
        "scheme": system.get("control", {}).get("scheme"),
    }
