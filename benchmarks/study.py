"""The whole bench run: every measurement in its order, the document of it, the table, and the figures.

Owns what the arguments mean. What is measured, and how, is in the modules beside this one.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

from rich.table import Table

from benchmarks import baseline as baseline_
from benchmarks import codec_rate, latency, lateness, rights, start_up, tick_cost, update_cost
from benchmarks.arrangement import (
    DURATION_S,
    MAIN_RATE_HZ,
    QUICK_DURATION_S,
    RATES_HZ,
    Arrangement,
    Ports,
)
from benchmarks.baseline import Document
from benchmarks.codec_rate import CodecRate
from benchmarks.host import host, in_words
from benchmarks.latency import Latency
from benchmarks.lateness import Lateness
from benchmarks.memory import memory
from benchmarks.report import report
from benchmarks.rights import Rights
from benchmarks.start_up import StartUp
from benchmarks.targets import targets
from benchmarks.tick_cost import TickCost
from benchmarks.update_cost import UpdateCost
from weberlink.protocol.keys import generate
from weberlink.system.configuration import ConfigurationError
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need

PARTS = len(RATES_HZ) + 5
Progress = Callable[[int, int, str], None]
"""Told how many of how many parts are done, and which comes next."""


@dataclass(frozen=True)
class Findings:
    """What was measured, and under which circumstances.

    Args:
        rates: lateness by rate [Hz].
        way: of an update.
        update: what its code costs at each end.
        cost: of a tick.
        codec: samples per second.
        start: of the program.
        granted: rights of the daemons and of their limits.
        about: the host, before the run.
        run_time_s: of all of it.
    """

    rates: Mapping[float, Lateness]
    way: Latency
    update: UpdateCost
    cost: TickCost
    codec: CodecRate
    start: StartUp
    granted: Rights
    about: Mapping[str, Any]
    run_time_s: float


@dataclass(frozen=True)
class Bench:
    """A run, and how it is shown."""

    findings: Findings
    document: dict[str, Any]
    table: Table
    caption: str

    def draw(self, folder: Path) -> None:
        """Write the figures.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from benchmarks.figures import cpu_figure, lateness_figure  # noqa: PLC0415 - heavy, seldom wanted

        folder.mkdir(parents=True, exist_ok=True)
        rates = self.findings.rates
        lateness_figure(list(rates.values()), folder / "lateness.png", self.caption)
        cpu_figure(self.findings.cost, rates[MAIN_RATE_HZ], folder / "cpu.png", self.caption)


def run(
    file: Path,
    overrides: Sequence[str],
    ports: Ports,
    *,
    duration: float | None = None,
    quick: bool = False,
    baseline: Path | None = None,
    plots: bool = False,
    progress: Progress = lambda *_: None,
) -> Bench:
    """Measure everything.

    Args:
        file: of the system that is measured.
        overrides: of the user.
        ports: finds a free port.
        duration: of the live run at one rate [s]; other parts take their share of it.
        quick: a glance at everything.
        baseline: document of an earlier run to compare with.
        plots: whether figures will be wanted.
        progress: told of it.

    Raises:
        ConfigurationError: for an argument that cannot be used; nothing was measured then.
        BenchError: if a measurement could not be made.
    """
    if plots:
        need("matplotlib", "plots", "--plots")
    earlier = None if baseline is None else baseline_.read(baseline)
    for override in overrides:
        if override.partition("=")[0].strip() == "rate_hz":
            rates = ", ".join(f"{rate_hz:g}" for rate_hz in RATES_HZ)
            raise ConfigurationError(f"--set rate_hz: is not for bench, which measures at {rates} Hz")
    length = duration if duration is not None else QUICK_DURATION_S if quick else DURATION_S
    with TemporaryDirectory(prefix="weberlink-bench-") as folder:
        key = Path(folder) / "bench.key"
        generate(key)
        arrangement = Arrangement(file, key, tuple(overrides), ports, length, quick)
        findings = measure(arrangement, progress)
    compared = None if earlier is None or baseline is None else (earlier, baseline.name)
    return assemble(arrangement, findings, compared)


def measure(arrangement: Arrangement, progress: Progress) -> Findings:
    """One part after the other; nothing else of this program runs meanwhile."""
    began = monotonic()
    about = host()  # before: the load that others make, not this run's
    granted = rights.granted(arrangement.configuration(arrangement.overrides(MAIN_RATE_HZ)).system.realtime)
    rates: dict[float, Lateness] = {}
    for done, rate_hz in enumerate(RATES_HZ):
        progress(done, PARTS, f"lateness at {rate_hz / 1e3:g} kHz")
        rates[rate_hz] = lateness.measure(arrangement, rate_hz, granted)
    progress(PARTS - 5, PARTS, "way of an update")
    way = latency.measure(arrangement, granted)
    progress(PARTS - 4, PARTS, "cost of an update")
    update = update_cost.measure(arrangement, granted)
    progress(PARTS - 3, PARTS, "cost of a tick")
    cost = tick_cost.measure(arrangement)
    progress(PARTS - 2, PARTS, "codec")
    codec = codec_rate.measure(quick=arrangement.quick)
    progress(PARTS - 1, PARTS, "start")
    start = start_up.measure(arrangement)
    progress(PARTS, PARTS, "")
    return Findings(rates, way, update, cost, codec, start, granted, about, monotonic() - began)


def assemble(arrangement: Arrangement, findings: Findings, earlier: tuple[Document, str] | None = None) -> Bench:
    """What is published of the findings; beside an earlier document, with its name, if there is one."""
    facts = environment()
    main = findings.rates[MAIN_RATE_HZ]
    document: dict[str, Any] = {
        "kind": baseline_.KIND,
        "version": baseline_.VERSION,
        "duration_s": arrangement.duration_s,
        "quick": arrangement.quick,
        "overrides": list(arrangement.given),
        "rights": findings.granted.as_json(),
        "lateness": [rate.as_json() for rate in findings.rates.values()],
        "latency": findings.way.as_json(),
        "update_cost_us": findings.update.as_json(),
        "cpu": cpu(main),
        "tick_cost": findings.cost.as_json(),
        "codec": findings.codec.as_json(),
        "memory": memory(main.sides),
        "start_up": findings.start.as_json(),
        "targets": [target.as_json() for target in targets(findings.rates, findings.way)],
        "run_time_s": findings.run_time_s,
        "host": dict(findings.about),
        "environment": facts,
    }
    comparison = None
    if earlier is not None:
        document["baseline"] = baseline_.as_json(earlier[0], document)
        comparison = baseline_.comparison(document["baseline"], earlier[1])
    return Bench(findings, document, report(document, comparison), f"{in_words(findings.about)}\n{footer(facts)}")


def cpu(rate: Lateness) -> dict[str, Any]:
    """Of each daemon, over the live run at one rate: what the kernel booked, start excluded."""
    return {
        name: {
            "rate_hz": rate.rate_hz,
            "cpu_share": side.cpu_s / side.elapsed_s,
            "cpu_us_per_tick": side.cpu_s / side.ticks * 1e6,
            "work_p50_us": rate.as_json()["daemons"][name]["work_us"]["p50"],
        }
        for name, side in rate.sides.items()
    }
