"""Requests to the daemons of a session: live changes, and the emulated link."""

import asyncio
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from weberlink.session.control_socket import LINK_SETTINGS, LiveChangeError, ask
from weberlink.session.emergency import NO_SESSION
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.session import WatchedSession

ANSWER_S = 2.0  # how long a daemon may take to answer

Answer = dict[str, Any]


def refusal(why: str) -> Answer:
    """A request that was refused, with the reason."""
    return {"type": "answer", "accepted": False, "why": why}


async def change(session: WatchedSession | None, request: Mapping[str, Any]) -> Answer:
    """Change settings of both sides of a session, or of the emulated link in both directions.

    One side agrees with the other on the settings; the link needs both. The daemons check the request."""
    if not request:
        return refusal("nothing to change; name weber, predictor, delay_ms, jitter_ms or loss")
    if session is None or session.ended:
        return refusal(f"{NO_SESSION} to change")
    link = {key: value for key, value in request.items() if key in LINK_SETTINGS}
    settings = {key: value for key, value in request.items() if key not in LINK_SETTINGS}
    answer: Answer = {}
    if settings:
        answer = await asyncio.to_thread(ask_daemon, session.ring, settings)
    if link and answer.get("accepted", True):
        answer |= _joined(await asyncio.to_thread(_ask_sides, session, link))
    return answer


def _ask_sides(session: WatchedSession, request: dict[str, Any]) -> dict[RingSource, Answer]:
    """The answers of the sides of a session that run on this host; they are asked at the same time."""
    running = [source for source in session.sources.values() if not source.drained]
    with ThreadPoolExecutor(2) as threads:
        return dict(zip(running, threads.map(lambda each: ask_daemon(each.ring, request), running), strict=True))


def _joined(answers: Mapping[RingSource, Answer]) -> Answer:
    """One answer for several daemons; it is a refusal, which names the side, unless all of them accepted."""
    joined: Answer = {key: value for answer in answers.values() for key, value in answer.items()}
    refused = {each: answer.get("why") for each, answer in answers.items() if not answer.get("accepted")}
    if refused or not answers:
        reasons = dict.fromkeys(f"{each.side}: {why}" for each, why in refused.items())
        return joined | {"accepted": False, "why": "; ".join(reasons) or NO_SESSION}
    joined.pop("why", None)
    return joined


def ask_daemon(ring: Path, request: dict[str, Any]) -> Answer:
    """The daemon's answer; a refusal with the reason if it cannot be reached. Blocks."""
    try:
        return ask(ring, request, ANSWER_S)
    except LiveChangeError as error:
        return {"accepted": False, "why": str(error)}
