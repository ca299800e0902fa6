"""Comparison with an earlier run: figures, their ratios, and other differences of the runs."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from weberlink.studies.result import plain_table
from weberlink.system.configuration import ConfigurationError

KIND = "weberlink bench"
VERSION = 2
"""Version of the document, raised when a figure changes its place or its meaning."""

Document = Mapping[str, Any]


def read(path: Path) -> Document:
    """Read the document of an earlier run.

    Raises:
        ConfigurationError: if it cannot be read, or is no such document.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"--baseline: {path}: cannot be read: {error.strerror}") from None
    except ValueError:  # neither text nor JSON
        raise ConfigurationError(f"--baseline: {path}: is not JSON; {_EXPECTED}") from None
    if not isinstance(document, dict) or document.get("kind") != KIND:
        raise ConfigurationError(f"--baseline: {path}: is not of a bench run; {_EXPECTED}")
    if document.get("version") != VERSION:
        raise ConfigurationError(
            f"--baseline: {path}: is of version {document.get('version')}, this program compares version {VERSION}"
        )
    try:
        figures(document)
    except (KeyError, TypeError, AttributeError, ValueError):
        raise ConfigurationError(f"--baseline: {path}: lacks figures of a bench run; {_EXPECTED}") from None
    return document


_EXPECTED = "expected what `weberlink bench --json FILE` wrote"


def figures(document: Document) -> dict[str, float | None]:
    """The compared figures of a document, by name with unit."""
    return dict(_figures(document))


def _figures(document: Document) -> Iterator[tuple[str, float | None]]:
    for rate in document["lateness"]:
        khz = f"{rate['rate_hz'] / 1e3:g} kHz"
        for name in ("p50", "p99", "p99_9"):
            yield f"{khz} lateness {name} [us]", _float(rate["lateness_us"][name])
        yield f"{khz} limit p99 [us]", _float(rate["limit"]["lateness_us"]["p99"])
        for side, daemon in rate["daemons"].items():
            yield f"{khz} {side} missed [%]", 100.0 * daemon["missed_share"]
    for way, summary in document["latency"]["weberlink_us"].items():
        yield f"{way.replace('_', ' ')} p50 [us]", _float(summary["p50"])
        yield f"{way.replace('_', ' ')} p99 [us]", _float(summary["p99"])
    yield "plain round trip p50 [us]", _float(document["latency"]["plain_socket_us"]["round_trip"]["p50"])
    yield "sealed round trip p50 [us]", _float(document["latency"]["sealed_socket_us"]["round_trip"]["p50"])
    for side, found in document["budget"]["sides"].items():
        for caches, total in found["sum_us"].items():
            yield f"{side} tick, sum of parts, {caches} [us]", _float(total)
        yield f"{side} work p50 [us]", _float(document["cpu"][side]["work_p50_us"])
        yield f"{side} CPU, share of a core [%]", 100.0 * document["cpu"][side]["cpu_share"]
    yield "codec live [samples/s]", _float(document["codec"]["live_samples_per_s"])
    for side, memory in document["memory"].items():
        yield f"{side} memory [KiB]", _float(memory["last_kib"])
        yield f"{side} growth [KiB/min]", _float(memory["growth_kib_per_minute"])
    for what, start in document["start_up"].items():
        yield f"start of {what} [s]", _float(start["median_s"])


def differences(earlier: Document, now: Document) -> list[str]:
    """Differences of two runs besides the figures, a line each."""
    here, there = _circumstances(now), _circumstances(earlier)
    return [
        f"{name}: {there.get(name)} earlier, {value} now" for name, value in here.items() if there.get(name) != value
    ]


def _circumstances(document: Document) -> dict[str, Any]:
    facts, about = document.get("environment", {}), document.get("host", {})
    found = {name: facts.get(name) for name in ("machine", "cores", "system", "python", "commit")}
    found |= facts.get("packages", {})
    found |= {name: about.get(name) for name in ("preemption", "governors", "isolated_cpus", "command_line")}
    found |= dict(document.get("rights", {}))
    found["file"] = document.get("file")
    found["duration_s"] = document.get("duration_s")
    found["limit of lateness"] = [rate["limit"]["name"] for rate in document["lateness"]][:1]
    fast = document["latency"].get("sockperf")
    found["sockperf"] = None if fast is None else fast.get("version")
    return found


def as_json(earlier: Document, now: Document) -> dict[str, Any]:
    """The comparison for the document."""
    before, after = figures(earlier), figures(now)
    return {
        "figures": [
            {"name": name, "earlier": before[name], "now": value, "ratio": _ratio(value, before[name])}
            for name, value in after.items()
            if name in before
        ],
        "differences": differences(earlier, now),
    }


def comparison(compared: Mapping[str, Any], name: str) -> Table:
    """A table of `as_json`."""
    table = plain_table("", "earlier", "now", "now / earlier")
    table.columns[0].header, table.columns[0].overflow = Text(f"beside {name}"), "ellipsis"
    for figure in compared["figures"]:
        table.add_row(Text(figure["name"]), *(_number(figure[key]) for key in ("earlier", "now", "ratio")))
    whole = Table.grid()
    whole.add_row(table)
    found = compared["differences"]
    if found:
        whole.add_row(Text(f"the runs differ in {'; '.join(found)}; this may change the figures", style="yellow"))
    return whole


def _ratio(now: float | None, earlier: float | None) -> float | None:
    return None if now is None or not earlier else now / earlier


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if abs(value) < 1e4 else f"{value:.0f}"


def _float(value: object) -> float | None:
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise ValueError(f"{value!r} is not a number")
    return value
