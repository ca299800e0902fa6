"""A whole run: every measurement in order, its document, table and figures."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

from benchmarks import codec_speed, latency, lateness, start_up, update_cost
from benchmarks.arrangement import (
    DURATION_S,
    MAIN_RATE_HZ,
    QUICK_DURATION_S,
    RATES_HZ,
    Arrangement,
    Ports,
    Rights,
    granted,
)
from benchmarks.codec_speed import CodecSpeed
from benchmarks.host import during, host, in_words, share_between, steal
from benchmarks.latency import Latency
from benchmarks.lateness import Lateness
from benchmarks.live_side import memory
from benchmarks.percentiles import summary
from benchmarks.report import report, targets
from benchmarks.start_up import StartUp
from benchmarks.update_cost import UpdateCost
from weberlink.config import ConfigurationError
from weberlink.config.errors import require_package
from weberlink.protocol.keys import generate
from weberlink_doctor.report import Needs
from weberlink_figures.environment import environment, footer
from weberlink_studies.interruption import Interruption
from weberlink_studies.result import StudyResult, how_much

KIND = "weberlink bench"
PARTS = len(RATES_HZ) + 4
Progress = Callable[[int, int, str], None]
"""Receives the number of finished parts, of all parts, and the name of the next."""


@dataclass(frozen=True)
class Findings:
    """All measurements, and the circumstances."""

    rates: Mapping[float, Lateness]  # lateness by rate [Hz]
    latency: Latency  # of an update
    update_cost: UpdateCost  # run time of the code of an update at each end
    codec: CodecSpeed  # samples per second
    start_up: StartUp  # of the program
    rights: Rights  # granted to the daemons and to their limits
    host: Mapping[str, Any]  # facts of the machine, before the run
    run_time_s: float  # of all of it
    steal_share: float | None  # of all processors' time, during the run; None if unknown


def run(
    file: Path,
    overrides: Sequence[str],
    ports: Ports,
    *,
    duration: float | None = None,
    quick: bool = False,
    plots: bool = False,
    progress: Progress = lambda *_: None,
) -> StudyResult:
    """Measure everything.

    Raises:
        ConfigurationError: for an argument that cannot be used; nothing was measured then.
        BenchError: if a measurement fails.
    """
    if plots:
        require_package("matplotlib", "studies", "--plots")
    for override in overrides:
        if override.partition("=")[0].strip() == "rate_hz":
            rates = ", ".join(f"{rate_hz:g}" for rate_hz in RATES_HZ)
            raise ConfigurationError(f"--set rate_hz: cannot be set for the benchmarks, which measures at {rates} Hz")
    length = duration if duration is not None else QUICK_DURATION_S if quick else DURATION_S
    with TemporaryDirectory(prefix="weberlink-bench-") as folder:
        key = Path(folder) / "bench.key"
        generate(key)
        arrangement = Arrangement(file, key, tuple(overrides), ports, length, quick)
        findings = measure(arrangement, progress)
    if not isinstance(findings, Findings):
        return partial(arrangement, findings)
    return assemble(arrangement, findings)


def measure(arrangement: Arrangement, progress: Progress) -> Findings | dict[str, Any]:
    """Measure one part after the other; the parts by name, if Ctrl-C comes before the last one is done."""
    began = monotonic()
    configuration = arrangement.configuration(arrangement.overrides(MAIN_RATE_HZ))
    facts, taken = (
        host(Needs(configuration.system, file=configuration.path)),
        steal(),
    )  # before the run, so that its own load does not count
    rights = granted(configuration.system.realtime)
    steps: dict[str, tuple[str, Callable[[], Any]]] = {
        f"lateness {rate_hz:g} Hz": (
            f"lateness at {rate_hz / 1e3:g} kHz",
            lambda rate_hz=rate_hz: lateness.measure(arrangement, rate_hz, rights),
        )
        for rate_hz in RATES_HZ
    } | {
        "latency": ("latency of an update", lambda: latency.measure(arrangement, rights)),
        "update_cost": ("run time of an update", lambda: update_cost.measure(arrangement, rights)),
        "codec": ("codec", lambda: codec_speed.measure(quick=arrangement.quick)),
        "start_up": ("start-up", lambda: start_up.measure(arrangement)),
    }
    found: dict[str, Any] = {}

    def one_by_one() -> Iterator[None]:
        for done, (name, (what, step)) in enumerate(steps.items()):
            progress(done, len(steps), what)
            found[name] = step()
            yield
        progress(len(steps), len(steps), "")

    for _ in Interruption().pieces(one_by_one()):
        pass
    if len(found) < len(steps):
        return found
    share = share_between(taken, steal())
    rates = {rate_hz: found[f"lateness {rate_hz:g} Hz"] for rate_hz in RATES_HZ}
    return Findings(
        rates, found["latency"], found["update_cost"], found["codec"], found["start_up"],
        rights, facts, monotonic() - began, share,
    )  # fmt: skip


def partial(arrangement: Arrangement, found: Mapping[str, Any]) -> StudyResult:
    """The parts that were measured until Ctrl-C. They have no targets, which are about the whole run."""
    facts = environment()
    asked = arrangement.configuration(arrangement.overrides(MAIN_RATE_HZ)).system.realtime
    document = {
        "kind": f"{KIND} partial",
        **_circumstances(arrangement, granted(asked)),
        "parts": {name: part.as_json() for name, part in found.items()},
        "environment": facts,
    }
    words = "\n".join(["measured:", *(f"  {name}" for name in found), footer(facts)])
    return StudyResult(document, words, None, interrupted=how_much(len(found), PARTS, "parts"))


def _circumstances(arrangement: Arrangement, rights: Rights) -> dict[str, Any]:
    return {
        "file": arrangement.file.name,
        "duration_s": arrangement.duration_s,
        "quick": arrangement.quick,
        "overrides": list(arrangement.given),
        "rights": rights.as_json(),
    }


def assemble(arrangement: Arrangement, findings: Findings) -> StudyResult:
    """The run from its findings."""
    facts = environment()
    main = findings.rates[MAIN_RATE_HZ]
    document: dict[str, Any] = {
        "kind": KIND,
        **_circumstances(arrangement, findings.rights),
        "lateness": [rate.as_json() for rate in findings.rates.values()],
        "latency": findings.latency.as_json(),
        "update_cost_us": findings.update_cost.as_json(),
        "cpu": cpu(main),
        "codec": findings.codec.as_json(),
        "memory": memory(main.sides),
        "start_up": findings.start_up.as_json(),
        "targets": [target.as_json() for target in targets(findings.rates, findings.latency)],
        "run_time_s": findings.run_time_s,
        "host": dict(findings.host),
        "steal_share": findings.steal_share,
        "environment": facts,
    }
    caption = f"{in_words(findings.host)}; {during(findings.steal_share)}\n{footer(facts)}"

    def draw(folder: Path) -> None:
        from benchmarks.figures import lateness_figure  # noqa: PLC0415 - slow import

        lateness_figure(list(findings.rates.values()), folder / "lateness.png", caption)

    return StudyResult(document, report(document), draw)


def cpu(rate: Lateness) -> dict[str, Any]:
    """CPU time of each daemon by the kernel, over the live run at one rate without its start."""
    return {
        name: {
            "rate_hz": rate.rate_hz,
            "cpu_share": side.cpu_s / side.elapsed_s,
            "cpu_us_per_tick": side.cpu_s / side.ticks * 1e6,
            **{f"{what}_p50_us": summary(side.records[f"{what}_us"])["p50"] for what in ("work", "codec")},
        }
        for name, side in rate.sides.items()
    }
