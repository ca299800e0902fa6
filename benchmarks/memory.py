"""Whether a daemon grows: its memory and its descriptors over the stretch of a live run that counts."""

from collections.abc import Mapping
from typing import Any

from benchmarks.live_run import Side


def memory(sides: Mapping[str, Side]) -> dict[str, Any]:
    """By side: resident memory at the beginning, at the end and at most; growth; descriptors; what the collector did.

    A page is 4 KiB, so a short run that grows by one page appears to grow fast.
    """
    return {name: _of(side) for name, side in sides.items()}


def _of(side: Side) -> dict[str, Any]:
    (_, first), (_, last) = side.used[0], side.used[-1]
    return {
        "first_kib": first.rss_kib,
        "last_kib": last.rss_kib,
        "max_kib": max(used.rss_kib for _, used in side.used),
        "growth_kib_per_minute": (last.rss_kib - first.rss_kib) / side.elapsed_s * 60.0,
        "descriptors_first": first.descriptors,
        "descriptors_last": last.descriptors,
        "garbage": side.summary.get("garbage"),
    }
