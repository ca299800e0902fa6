"""Report of a run in 80 columns: every figure beside its limit, and the targets."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table
from rich.text import Text

from benchmarks import host, start_up
from benchmarks.arrangement import MAIN_RATE_HZ, RATES_HZ
from benchmarks.latency import Latency
from benchmarks.lateness import Lateness
from benchmarks.percentiles import NAMES
from weberlink.compiled import is_compiled
from weberlink_figures.environment import footer
from weberlink_studies.result import plain_table


@dataclass(frozen=True)
class BenchTarget:
    """A figure and its bound. A missed target is a finding, no error."""

    name: str  # stable, with the unit or kind of the value
    value: float | None  # None if it could not be measured
    target: float  # the bound, of which the value may be at most

    @property
    def met(self) -> bool | None:
        """None without a value."""
        return None if self.value is None else self.value <= self.target

    def as_json(self) -> dict[str, Any]:
        return asdict(self) | {"met": self.met}


MISSED_RATIO = 1.2  # most missed ticks, as a multiple of those of the limit in the same run


def targets(lateness: Mapping[float, Lateness], latency: Latency) -> list[BenchTarget]:
    """All targets; the worse of the two daemons, and of the two ways, counts."""
    main = lateness.get(MAIN_RATE_HZ)
    found = [
        BenchTarget("cpu_share_1khz", None if main is None else main.cpu_share, 0.06 if is_compiled() else 0.10),
        BenchTarget("work_p50_us_1khz", None if main is None else main.work_p50_us, 30.0 if is_compiled() else 65.0),
    ]
    for rate_hz in RATES_HZ:
        rate, khz = lateness.get(rate_hz), f"{rate_hz / 1e3:g}khz"
        found += [BenchTarget(f"lateness_p99_ratio_{khz}", None if rate is None else rate.worst_ratio, 1.0)]
        found += [
            BenchTarget(f"missed_share_{khz}", None, 0.0)
            if rate is None
            else BenchTarget(
                f"missed_share_{khz}", rate.missed_share, MISSED_RATIO * rate.limit.missed_share(rate.rate_hz)
            )
        ]
    for name, one_way in (("one_way", latency.due), ("one_way_every", latency.every)):
        found += [BenchTarget(f"{name}_{share}_ratio", one_way.worst_ratio(share), 1.5) for share in ("p50", "p99")]
    return [*found, BenchTarget("one_way_p50_us", latency.due.coded_us("p50"), 100.0)]


HEADINGS = ("p50", "p90", "p99", "p99.9", "max")


def report(document: Mapping[str, Any]) -> Table:
    """The whole report of the document of a run."""
    whole = Table.grid()
    lines = Text("\n".join(_lines(document)))
    for part in (_lateness(document), _latency(document), _update(document), lines, _targets(document)):
        whole.add_row(part)
        whole.add_row("")
    whole.add_row(Text(_footer(document), style="dim"))
    return whole


def _lateness(document: Mapping[str, Any]) -> Table:
    table = plain_table("tick lateness, us", *HEADINGS, "missed")
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
    table = plain_table("latency of an update, us", *HEADINGS)
    for which, words in (("due", "as in the file"), ("every", "deadband 0")):
        found = latency[which]
        for way, summary in found["weberlink_us"].items():
            table.add_row(f"{way}, {words}", *_microseconds(summary))
            table.add_row("  sealed in bare Python", *_microseconds(found["sealed_socket_us"][way]))
            table.add_row("  x sealed", *_ratios(found["ratio_to_sealed"][way]), end_section=True)
    return table


def _update(document: Mapping[str, Any]) -> Table:
    table = plain_table("run time of an update, us", *HEADINGS)
    for step, states in document["update_cost_us"].items():
        for caches, summary in states.items():
            table.add_row(f"{step}, caches {caches}", *_microseconds(summary))
    return table


def _lines(document: Mapping[str, Any]) -> Iterator[str]:
    for side, used in document["cpu"].items():
        yield (
            f"{side}: {100 * used['cpu_share']:.1f} % of a core at {used['rate_hz'] / 1e3:g} kHz, "
            f"{used['cpu_us_per_tick']:.0f} us a tick; "
            f"p50: work {_number(used['work_p50_us'])}, codec {_number(used['codec_p50_us'])} us"
        )
    yield f"codec: {document['codec']['live_samples_per_s'] / 1e3:.0f} thousand samples/s"
    for side, memory in document["memory"].items():
        yield (
            f"{side}: {memory['last_kib'] / 1024:.1f} MiB, {memory['growth_kib_per_minute']:+.0f} KiB a minute, "
            f"{memory['descriptors_first']} descriptors, {memory['descriptors_last']} at the end"
        )
    yield start_up.line(document["start_up"])


def _targets(document: Mapping[str, Any]) -> Table:
    table = plain_table("target", "value", "wanted", "")
    for target in document["targets"]:
        bound = f"<= {target['target']:.3g}"
        said = {True: Text("met", "green"), False: Text("MISSED", "bold red"), None: Text("not measured", "yellow")}
        value = "-" if target["value"] is None else f"{target['value']:.4g}"
        table.add_row(target["name"], value, bound, said[target["met"]])
    return table


def _footer(document: Mapping[str, Any]) -> str:
    rights = document["rights"]
    asked = [rights["scheduler"]]
    asked += ["memory locked"] * rights["lock_memory"] + ["processors awake"] * rights["wakeful"]
    asked += [] if rights["cpus"] is None else [f"CPUs {', '.join(map(str, rights['cpus']))}"]
    length = f"{document['duration_s']:g} s per part" + (": a quick run, no measurement" if document["quick"] else "")
    return "\n".join(
        [
            length,
            "rights: " + ", ".join(asked),
            f"{host.in_words(document['host'])}; {host.during(document['steal_share'])}",
            footer(document["environment"]),
        ]
    )


def _microseconds(summary: Mapping[str, float | None]) -> list[str]:
    return [_number(summary[name]) for name in NAMES]


def _ratios(summary: Mapping[str, float | None]) -> list[str]:
    return ["-" if (value := summary[name]) is None else f"{value:.2g}" for name in NAMES]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"
