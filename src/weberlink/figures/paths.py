"""The paths that a link takes, from `weberlink.protocol.aio.udp.PathFacts` as JSON, and words for them.

`paths_of` reads them from a description, which another release or another host may have written. Every other function
takes what it gives.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

DIRECT, RELAYED = "direct", "relayed"
MOST, LONGEST = 8, 200
"""Paths that are read, and characters of each of their texts."""
Facts = Mapping[str, Any]
_EVENT = ("place", "route", "via", "interface", "remote", "changes", "note")
"""What an event says of a path; the class of service is measured now and then, and is no event."""


def paths_of(described: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """The paths in a description or in the summary of a daemon, each value of its type; empty where none is known."""
    found = (described or {}).get("paths")
    return [_clean(facts) for facts in found[:MOST] if isinstance(facts, Mapping)] if isinstance(found, list) else []


def _clean(facts: Facts) -> dict[str, Any]:
    texts = {name: facts.get(name) for name in ("route", "via", "interface", "remote", "note")}
    numbers = {name: facts.get(name) for name in ("place", "changes", "dscp")}
    kept = {name: value if isinstance(value, int) else None for name, value in numbers.items()}
    return {
        "place": kept["place"] or 0,
        **{name: value[:LONGEST] if isinstance(value, str) else "" for name, value in texts.items()},
        "changes": kept["changes"] or 0,
        "dscp": kept["dscp"],
    }


def of_event(facts: Facts) -> dict[str, Any]:
    """The part of the facts whose change is worth an event."""
    return {name: facts[name] for name in _EVENT}


def route_words(facts: Facts) -> str:
    """The way of a path: direct, punched, relayed by NAME; over which interface; or why there is none."""
    route, via, interface = (facts[name] for name in ("route", "via", "interface"))
    if not route:
        return facts["note"] or "no path yet"
    word = f"relayed by {via}" if route == RELAYED and via else route
    return f"{word} over {interface}" if interface else word


def path_words(facts: Facts, of: str = "") -> str:
    """A path in a few words, with the side whose it is if given; the second one with its number."""
    number = f" {facts['place'] + 1}" if facts["place"] else ""
    parts = [f"path{number}{of and f' of the {of}'}: {route_words(facts)}", changes_words(facts)]
    return ", ".join(part for part in parts if part)


def changes_words(facts: Facts) -> str:
    """How often it was replaced; "" for never."""
    changes = facts["changes"]
    return "" if not changes else f"{changes} change{'' if changes == 1 else 's'}"


def dscp_words(facts: Facts, sent: int | None) -> str:
    """What came of the class of service that the datagrams asked for; "" while unknown.

    Args:
        facts: of the path.
        sent: the class asked for (`link.dscp`).
    """
    came = facts["dscp"]
    if came is None:
        return ""
    return f"DSCP {came}" if came == sent or sent is None else f"DSCP {sent} came as {came}"


def notable(before: Sequence[Facts], now: Sequence[Facts]) -> Iterator[str]:
    """The paths that are new or different, in words; not a direct one that was never anything else."""
    known = {facts["place"]: of_event(facts) for facts in before}
    for facts in now:
        place, told = facts["place"], of_event(facts)
        is_plain = told["route"] == DIRECT and not told["changes"]
        if known.get(place) != told and told["route"] and not is_plain:
            yield path_words(facts)


def finding(paths: Sequence[Facts]) -> str:
    """What is being done while there is no path at all; "" if there is one, or nothing is known."""
    if not paths or any(facts["route"] for facts in paths):
        return ""
    return next((facts["note"] for facts in paths if facts["note"]), "finding a path")
