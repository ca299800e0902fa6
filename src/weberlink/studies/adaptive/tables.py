"""The tables of the page as Markdown: every number comes from a row."""

from collections.abc import Iterable, Iterator, Sequence

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive.comparison import Ratio, against_best, against_best_ratios, geometric_mean, ratios
from weberlink.studies.adaptive.published import HYBRID_PER_S
from weberlink.studies.adaptive.rows import Cost, Match, Rate, Results
from weberlink.studies.adaptive.signals import RUBBED_AND_MOVED
from weberlink.studies.adaptive.variants import ABLATIONS, ALL_SINGLES, FLOOR_N, SINGLES, TUNINGS
from weberlink.studies.adaptive.verdict import NAMES, Target, band, compared, overall, rubbed, spread
from weberlink.studies.adaptive.work import ABLATION, RATES, TUNING

Lines = Iterator[str]
Figures = dict[tuple[str, str], float]
"""Packets per second by signal and variant."""

MET = {True: "met", False: "**not met**", None: "not measured"}
FELT = ("error_rms_n", "error_rms_jnd", "largest_step_n", "step_jnd")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Lines:
    """With a blank line before it."""
    yield ""
    yield "| " + " | ".join(head) + " |"
    yield "|---" * len(head) + "|"
    yield from ("| " + " | ".join(row) + " |" for row in rows)


def target_table(found: Sequence[Target]) -> Lines:
    head = ("asked for", "limit", "found", "")
    yield from table(head, ([one.what, one.asked, one.found, MET[one.met]] for one in found))


def summary_table(groups: Sequence[tuple[str, Sequence[Rate]]]) -> Lines:
    """Geometric means over several sets of rows."""
    head = ("signals", "number", "against hybrid", "against the best of four", "against the best of seven")
    yield from table(head, (_summary(name, rows) for name, rows in groups if rows))


def _summary(name: str, rows: Sequence[Rate]) -> list[str]:
    found = ratios(rows, ADAPTIVE, HYBRID)
    best = [against_best_ratios(against_best(rows, ADAPTIVE, singles)) for singles in (SINGLES, ALL_SINGLES)]
    return [name, str(len(found)), band(geometric_mean(found)), *(band(geometric_mean(one)) for one in best)]


def rate_table(rows: Sequence[Rate], variants: Sequence[str]) -> Lines:
    """Packets per second of every signal, and the ratios of `adaptive` to the hybrid and to the best of four."""
    rates = figures(rows)
    best = {one.signal: one for one in against_best(rows, ADAPTIVE, SINGLES)}
    yield from table(
        ("signal", *variants, "/ hybrid", "/ best of four"),
        (
            [
                signal,
                *(number(rates.get((signal, variant))) for variant in variants),
                _over(rates, signal),
                number(best[signal].ratio if signal in best else None, 2),
            ]
            for signal in signals(rows)
        ),
    )


def published_table(rows: Sequence[Rate]) -> Lines:
    """The hybrid of an independent implementation beside ours, where there is one."""
    rates = figures(rows)
    known = [signal for signal in signals(rows) if signal in HYBRID_PER_S]
    yield from table(
        ("signal", "hybrid, independent", "hybrid", "adaptive", "/ hybrid"),
        (
            [signal, number(HYBRID_PER_S[signal]), *(number(rates.get((signal, name))) for name in (HYBRID, ADAPTIVE)),
             _over(rates, signal)]
            for signal in known
        ),
    )  # fmt: skip


def match_table(matches: Sequence[Match], variants: Sequence[str]) -> Lines:
    """What is felt at equal packets: the hybrid's numbers and `adaptive`'s."""
    head = (
        "signal", "packets/s", "k of adaptive", "RMS [N]", "RMS [JND]", "largest step [N]", "99.9 % step [JND]",
    )  # fmt: skip
    found = {(row.signal, row.variant): row for row in matches}
    rows = []
    for signal in signals(matches):
        both = [found.get((signal, variant)) for variant in variants]
        if None not in both:
            rows.append(_felt(signal, [row for row in both if row is not None]))
    yield from table(head, rows)


def _felt(signal: str, both: Sequence[Match]) -> list[str]:
    def pair(figure: str, digits: int) -> str:
        return ", ".join(f"{getattr(row, figure):.{digits}f}" for row in both)

    cells = [pair(figure, digits) for figure, digits in zip(FELT, (4, 2, 3, 2), strict=True)]
    return [signal, pair("packets_per_s", 1), f"{both[-1].weber:.3f}", *cells]


def felt_means(matches: Sequence[Match], variants: Sequence[tuple[str, str]]) -> Lines:
    """Ratios at equal packets of variants to references, over the signals of those."""
    head = ("", "against", "signals", "RMS [N]", "RMS [JND]", "largest step [N]", "99.9 % step [JND]")
    rows = []
    for variant, reference in variants:
        means = [band(geometric_mean(compared(matches, variant, figure, reference))) for figure in FELT]
        count = len(compared(matches, variant, FELT[0], reference))
        rows.append([variant, reference, str(count), *means])
    yield from table(head, rows)


def ablations(results: Results) -> list[tuple[str, list[Ratio]]]:
    """Packets with a part off over those with all parts, for each part; the hybrid has none of them."""
    whole = results.of(RATES, half="reported", floor_n=FLOOR_N, variant=ADAPTIVE)
    found = [(name, ratios(whole + results.of(ABLATION, variant=name), name, ADAPTIVE)) for name in ABLATIONS]
    hybrid = results.of(RATES, half="reported", floor_n=FLOOR_N, variant=HYBRID)
    return [*found, ("the paper's bank and choice", ratios(whole + hybrid, HYBRID, ADAPTIVE))]


def ablation_table(results: Results) -> Lines:
    head = ("", "packets over those of adaptive", "most on", "least on")
    yield from table(
        head,
        ([name, band(geometric_mean(found)), *_extremes(found)] for name, found in ablations(results)),
    )


def tuning_table(results: Results) -> Lines:
    """Neighbours of the constants, on the half that chose them."""
    whole = results.of(RATES, half="chosen", floor_n=FLOOR_N, variant=ADAPTIVE)
    rows = []
    for name in TUNINGS:
        found = ratios(whole + results.of(TUNING, variant=name), name, ADAPTIVE)
        rows.append([name, band(geometric_mean(found))])
    yield from table(("instead", "packets over those of adaptive"), rows)


def rubbed_table(results: Results) -> Lines:
    rows = []
    for scene in RUBBED_AND_MOVED:
        found = rubbed(results, scene)
        if found:
            each = ", ".join(f"{one.value:.2f}" for one in found)
            rows.append([NAMES[scene], f"{overall(found):.2f}", spread(found), each])
    yield from table(("scene", "geometric mean over seeds", "least to largest", "each"), rows)


def limit_table(limits: Sequence[Rate], rates: Sequence[Rate]) -> Lines:
    """The clairvoyant bounds beside what is sent."""
    bounds, real = figures(limits), figures(rates)
    yield from table(
        ("signal", "zoh: limit", "linear: limit", "hybrid: limit", "hybrid", "adaptive"),
        (
            [
                signal,
                *(number(bounds.get((signal, family))) for family in ("zoh", "linear", HYBRID)),
                *(number(real.get((signal, variant))) for variant in (HYBRID, ADAPTIVE)),
            ]
            for signal in signals(limits)
        ),
    )


def cost_table(costs: Sequence[Cost]) -> Lines:
    yield from table(
        ("", "ticks", "median [us]", "mean [us]", "p99 [us]", "worst [us]"),
        (
            [
                row.variant, str(row.ticks), f"{row.median_us:.1f}", f"{row.mean_us:.1f}", f"{row.p99_us:.0f}",
                f"{row.worst_us:.0f}",
            ]
            for row in costs
        ),
    )  # fmt: skip


def figures(rows: Iterable[Rate]) -> Figures:
    return {(row.signal, row.variant): row.packets_per_s for row in rows}


def signals(rows: Iterable[Rate | Match]) -> list[str]:
    """Names in the order of the rows."""
    return list(dict.fromkeys(row.signal for row in rows))


def number(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _over(rates: Figures, signal: str) -> str:
    mine, hybrid = rates.get((signal, ADAPTIVE)), rates.get((signal, HYBRID))
    return number(mine / hybrid if mine is not None and hybrid else None, 2)


def _extremes(found: Sequence[Ratio]) -> list[str]:
    """The signals on which a part is worth most and least."""
    if not found:
        return ["-", "-"]
    ends = max(found, key=lambda one: one.value), min(found, key=lambda one: one.value)
    return [f"{one.signal} ({one.value:.2f})" for one in ends]
