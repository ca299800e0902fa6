"""Live changes of settings, asked of a daemon on this host on behalf of a page."""

import asyncio
from math import isfinite
from pathlib import Path
from typing import Any

PATIENCE_S = 2.0
KEYS = ("weber", "predictor", "scheme")


def read_request(document: object) -> dict[str, Any] | str:
    """What a page asks to have changed, or why that is no request."""
    if not isinstance(document, dict) or document.get("type") != "change":
        return 'expected {"type": "change", ...}'
    asked = {key: value for key, value in document.items() if key != "type"}
    unknown = sorted(set(asked) - set(KEYS))
    if unknown:
        return f"{unknown[0]!r} cannot be changed live; expected {', '.join(KEYS)}"
    if not asked:
        return f"nothing to change; expected {', '.join(KEYS)}"
    weber = asked.get("weber", 0.0)
    if isinstance(weber, bool) or not isinstance(weber, int | float) or not (isfinite(weber) and 0.0 <= weber <= 1.0):
        return f"weber must be a number from 0 to 1, not {weber!r}"[:200]
    for key in ("predictor", "scheme"):
        if not isinstance(asked.get(key, ""), str):
            return f"{key} must be a name"
    return asked


async def ask(ring: Path, request: dict[str, Any]) -> dict[str, Any]:
    """The daemon's answer; one that refuses, with the reason, where none can be reached."""
    from weberlink.system.control_socket import LiveChangeError  # noqa: PLC0415
    from weberlink.system.control_socket import ask as ask_daemon  # noqa: PLC0415

    try:
        return await asyncio.to_thread(ask_daemon, ring, request, PATIENCE_S)
    except LiveChangeError as error:
        return {"accepted": False, "why": str(error)}
