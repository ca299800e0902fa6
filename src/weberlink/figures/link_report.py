"""The lines of the report about the link: round trip, each way, and the paths."""

from collections.abc import Iterator
from typing import Any

from weberlink.figures.paths import dscp_words, path_words

WAYS = {"to_slave": "to the slave", "to_master": "to the master"}
"""Name of each way in the figures, and in words."""


def link_lines(summary: dict[str, Any]) -> Iterator[str]:
    """Delays and losses; each way apart where the summary has it, as that of a live session or a recording does."""
    link, ways = summary["link"], summary.get("ways")
    if link["rtt_us"]["p50"] is not None:
        other = f"one way {link['one_way_us']['p50'] / 1e3:.2f} ms" if ways is None else _jitter(ways)
        yield f"round trip {_ms(link['rtt_us'])}, {other}"
    if ways is not None:
        yield from _ways(ways)
    if any((late := summary.get("lookahead_ms", {})).values()):
        yield "look-ahead, on top of the way: " + ", ".join(f"{name} {ms:g} ms" for name, ms in late.items())
    if playout := summary.get("playout_ms", 0.0):
        yield f"play-out, on top of the fastest way: {playout:g} ms at each end"
    yield from _paths(summary)


def _ms(us: dict[str, Any]) -> str:
    """Median and 99th percentile [us] of a time, in milliseconds."""
    return f"{us['p50'] / 1e3:.2f} ms (p99 {us['p99'] / 1e3:.2f})"


def _jitter(ways: dict[str, Any]) -> str:
    return "jitter unknown" if ways["jitter_us"]["p50"] is None else f"jitter {_ms(ways['jitter_us'])}"


def _ways(ways: dict[str, Any]) -> Iterator[str]:
    """Delay and loss of each way."""
    for name, words in WAYS.items():
        figures, parts = ways[name], []
        if figures["one_way_us"]["p50"] is not None:
            parts.append(_ms(figures["one_way_us"]))
        if figures["loss"] is not None:
            runs = "" if figures["burst"] is None else f" in runs of {figures['burst']:.1f}"
            by = ", as that side reported" if figures["is_reported"] else ""
            parts.append(f"{100 * figures['loss']:.2f} % lost{runs}{by}")
        if parts:
            yield f"{words}: {', '.join(parts)}"


def _paths(summary: dict[str, Any]) -> Iterator[str]:
    """The paths of each side; once where both say the same."""
    asked, paths = summary.get("dscp"), summary.get("paths", {})
    told = {side: [_path(facts, asked) for facts in of_side] for side, of_side in sorted(paths.items())}
    if len({tuple(lines) for lines in told.values()}) == 1:
        yield from next(iter(told.values()))
        return
    for side, of_side in sorted(paths.items()):
        yield from (_path(facts, asked, side) for facts in of_side)


def _path(facts: dict[str, Any], asked: int | None, of: str = "") -> str:
    return ", ".join(part for part in (path_words(facts, of), dscp_words(facts, asked)) if part)
