"""Words for the paths that a link takes, from their facts (`weberlink.protocol.aio.hand_over.PathFacts`) as JSON.

Facts come from a description, which a daemon of another release or another host may have written: what is missing is
unknown.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

DIRECT, PUNCHED, RELAYED = "direct", "punched", "relayed"
Facts = Mapping[str, Any]
_EVENT = ("place", "route", "via", "interface", "remote", "changes", "note")
"""What an event says of a path; the class of service is measured now and then, and is no event."""


def paths_of(described: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """The paths in a description or in the summary of a daemon; empty where nothing is known."""
    found = (described or {}).get("paths")
    return [dict(facts) for facts in found if isinstance(facts, Mapping)] if isinstance(found, Sequence) else []


def of_event(facts: Facts) -> dict[str, Any]:
    """The part of the facts whose change is worth an event."""
    return {name: facts.get(name) for name in _EVENT}


def route_words(facts: Facts) -> str:
    """The way of a path: direct, punched, relayed by NAME; over which interface; or why there is none."""
    route, via, interface = (str(facts.get(name) or "") for name in ("route", "via", "interface"))
    if not route:
        return str(facts.get("note") or "no path yet")
    word = f"relayed by {via}" if route == RELAYED and via else route
    return f"{word} over {interface}" if interface else word


def path_words(facts: Facts) -> str:
    """A path in a few words; the second one with its number."""
    place = int(facts.get("place") or 0)
    parts = [f"path{f' {place + 1}' if place else ''}: {route_words(facts)}", changes_words(facts)]
    return ", ".join(part for part in parts if part)


def changes_words(facts: Facts) -> str:
    """How often it was replaced; "" for never."""
    changes = int(facts.get("changes") or 0)
    return "" if not changes else f"{changes} change{'' if changes == 1 else 's'}"


def dscp_words(facts: Facts, sent: int | None) -> str:
    """What came of the class of service that the datagrams asked for; "" while unknown.

    Args:
        facts: of the path.
        sent: the class asked for (`link.dscp`).
    """
    came = facts.get("dscp")
    if came is None:
        return ""
    return f"DSCP {came}" if came == sent or sent is None else f"DSCP {sent} came as {came}"


def notable(before: Sequence[Facts], now: Sequence[Facts]) -> Iterator[str]:
    """The paths that are new or different, in words; not a direct one that was never anything else."""
    known = {facts.get("place"): of_event(facts) for facts in before}
    for facts in now:
        place, told = facts.get("place"), of_event(facts)
        is_plain = told["route"] == DIRECT and not told["changes"]
        if known.get(place) != told and told["route"] and not is_plain:
            yield path_words(facts)


def finding(paths: Sequence[Facts]) -> str:
    """What is being done while there is no path at all; "" if there is one, or nothing is known."""
    if not paths or any(facts.get("route") for facts in paths):
        return ""
    return next((str(facts["note"]) for facts in paths if facts.get("note")), "finding a path")
