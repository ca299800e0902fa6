"""What a person reads of a bench run, in 80 columns: the numbers of the document, each beside its limit."""

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from benchmarks import host
from benchmarks.percentiles import NAMES
from benchmarks.tick_cost import PARTS
from weberlink.system.environment import footer

HEADINGS = ("p50", "p90", "p99", "p99.9", "max")


def report(document: Mapping[str, Any], comparison: Table | None = None) -> Table:
    """All of it, one part below the other.

    Args:
        document: of the run.
        comparison: with an earlier run, if there is one.
    """
    whole = Table.grid()
    parts: list[Table | Text] = [_lateness(document), _latency(document), _update(document), _ticks(document)]
    parts += [Text("\n".join(_lines(document)))]
    parts += [] if comparison is None else [comparison]
    for part in (*parts, _targets(document)):
        whole.add_row(part)
        whole.add_row("")
    whole.add_row(Text(_footer(document), style="dim"))
    return whole


def _lateness(document: Mapping[str, Any]) -> Table:
    table = _table("tick lateness, us", *HEADINGS, "missed")
    for rate in document["lateness"]:
        khz = f"{rate['rate_hz'] / 1e3:g} kHz"
        for side, daemon in rate["daemons"].items():
            missed = f"{100 * daemon['missed_share']:.3f} %"
            table.add_row(f"{khz} {side}", *_microseconds(daemon["lateness_us"]), missed)
        missed = f"{100 * rate['limit']['missed_share']:.3f} %"
        table.add_row(f"{khz} {rate['limit']['name']}", *_microseconds(rate["limit"]["lateness_us"]), missed)
        table.add_row(f"{khz} both, x limit", *_ratios(rate["ratio"]), "", end_section=True)
    return table


def _latency(document: Mapping[str, Any]) -> Table:
    latency = document["latency"]
    table = _table("way of an update, us", *HEADINGS)
    for way, summary in latency["weberlink_us"].items():
        words = way.replace("_", " ")
        table.add_row(words, *_microseconds(summary))
        table.add_row(f"{words}, plain socket", *_microseconds(latency["plain_socket_us"][way]))
        table.add_row(f"{words}, x plain", *_ratios(latency["ratio_to_plain"][way]))
    fast = latency["sockperf"]
    if fast is not None:
        table.add_row(f"round trip, {fast['version']}", *_microseconds(fast["round_trip_us"]))
        table.add_row("round trip, x sockperf", *_ratios(latency["ratio_to_sockperf"]["round_trip"]))
    return table


def _update(document: Mapping[str, Any]) -> Table:
    table = _table("code of an update, us", *HEADINGS)
    for step, states in document["update_cost_us"].items():
        for caches, summary in states.items():
            table.add_row(f"{step}, caches {caches}", *_microseconds(summary))
    return table


def _ticks(document: Mapping[str, Any]) -> Table:
    cost, live = document["tick_cost"], document["cpu"]
    sides = list(cost["parts_us"])
    table = _table("cost of a tick, us", *sides)
    for part in PARTS:
        table.add_row(part, *(f"{cost['parts_us'][side][part]:.1f}" for side in sides))
    table.add_row("sum", *(f"{cost['total_us'][side]:.1f}" for side in sides), end_section=True)
    for words, key in (("live: work p50", "work_p50_us"), ("live: CPU per tick", "cpu_us_per_tick")):
        table.add_row(words, *(_number(live[side][key]) for side in sides))
    table.add_row("live: CPU, share of a core", *(f"{100 * live[side]['cpu_share']:.1f} %" for side in sides))
    return table


def _lines(document: Mapping[str, Any]) -> Iterator[str]:
    yield f"codec: {document['codec']['live_samples_per_s'] / 1e3:.0f} thousand samples/s"
    for side, memory in document["memory"].items():
        yield (
            f"{side}: {memory['last_kib'] / 1024:.1f} MiB, {memory['growth_kib_per_minute']:+.0f} KiB a minute, "
            f"{memory['descriptors_first']} descriptors, {memory['descriptors_last']} at the end"
        )
    yield "start: " + ", ".join(
        f"{what} {start['median_s']:.2f} s ({start['ratio_to_interpreter']:.0f} x)"
        for what, start in document["start_up"].items()
    )


def _targets(document: Mapping[str, Any]) -> Table:
    table = _table("target", "value", "wanted", "")
    for target in document["targets"]:
        bound = f"{'>=' if target['at_least'] else '<='} {target['target']:g}"
        said = {True: Text("met", "green"), False: Text("MISSED", "bold red"), None: Text("not measured", "yellow")}
        value = "-" if target["value"] is None else f"{target['value']:.4g}"
        table.add_row(target["name"], value, bound, said[target["met"]])
    return table


def _footer(document: Mapping[str, Any]) -> str:
    rights = document["rights"]
    asked = [rights["scheduler"]]
    asked += ["memory locked"] * rights["lock_memory"] + ["processors awake"] * rights["wakeful"]
    asked += [] if rights["cpus"] is None else [f"CPUs {', '.join(map(str, rights['cpus']))}"]
    length = f"{document['duration_s']:g} s a part" + (": a glance, not a measurement" if document["quick"] else "")
    return "\n".join(
        [length, "rights: " + ", ".join(asked), host.in_words(document["host"]), footer(document["environment"])]
    )


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _microseconds(summary: Mapping[str, float | None]) -> list[str]:
    return [_number(summary[name]) for name in NAMES]


def _ratios(summary: Mapping[str, float | None]) -> list[str]:
    return ["-" if (value := summary[name]) is None else f"{value:.2g}" for name in NAMES]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"
