"""The `ratings` command: the ledgers of an experiment as a document, tables and figures."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from weberlink.studies.experiment.analysis import EXPLANATION, MARK, SEED, TESTED_AGAINST, Analysis, analyse
from weberlink.studies.experiment.answers import Whose, gather
from weberlink.studies.experiment.ledger import LedgerError
from weberlink.studies.experiment.plan import HIGHEST, LOWEST
from weberlink.studies.experiment.statistics import Crossing, Reach, Saving
from weberlink.system.configuration import ConfigurationError
from weberlink.system.environment import environment, footer
from weberlink.system.extras import need


@dataclass(frozen=True)
class Ratings:
    """An analysed study with its document, table and figures."""

    analysis: Analysis
    facts: dict[str, Any]

    @property
    def document(self) -> dict[str, Any]:
        return self.analysis.document | {"environment": self.facts}

    @property
    def table(self) -> Table:
        return table_of(self.analysis, footer(self.facts, SEED))

    def draw(self, folder: Path) -> None:
        """Write the three figures of the paper, and their points as CSV.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from weberlink.studies.curve_figures import QualityAxis, draw_curves  # noqa: PLC0415 - slow import

        folder.mkdir(parents=True, exist_ok=True)
        draw_curves(
            self.analysis.curves,
            folder,
            quality=QualityAxis(label="rating", better="higher", limits=(LOWEST, HIGHEST), column="rating"),
            caption=footer(self.facts, SEED),
            title=self.analysis.who,
            mark=self.analysis.mark,
            units="simulated subjects" if self.analysis.mark else "subjects",
        )

    def write_csv(self, path: Path) -> None:
        """Write every rating as a table.

        Raises:
            OSError: if the file cannot be written.
        """
        self.analysis.answers.write_csv(path)


def run(folder: Path, *, level: float, only: str | None, plots: bool) -> Ratings:
    """Analyse a folder of ledgers.

    Args:
        folder: of `experiment --out`.
        level: rating at which packets are compared.
        only: "people" or "simulated"; None if there is one kind.
        plots: whether figures will be drawn.

    Raises:
        ConfigurationError: for an argument or a ledger that cannot be used, or a missing package.
    """
    need("scipy", "statistics", "ratings")
    if plots:
        need("matplotlib", "plots", "--plots")
    if not folder.is_dir():
        raise ConfigurationError(f"{folder}: no such folder; expected the folder of experiment --out")
    try:
        answers = gather(folder, _whose(only))
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None
    return Ratings(analyse(answers, level), environment())


def _whose(only: str | None) -> Whose | None:
    kinds: dict[str, Whose] = {"people": "people", "simulated": "simulated"}
    if only is not None and only not in kinds:
        raise ConfigurationError(f"--only: expected people or simulated, not {only!r}")
    return None if only is None else kinds[only]


def table_of(analysis: Analysis, caption: str) -> Table:
    """All tables below each other, and the environment in which they were made."""
    whole = Table.grid()
    if analysis.mark is not None:
        whole.add_row(Text(f"{MARK}: {EXPLANATION}", style="bold red"))
    whole.add_row(_subjects(analysis))
    sure = ", with its 95 % confidence interval" if len(analysis.answers.subjects) > 1 else ""
    for title, table in (
        (f"mean rating, {LOWEST} to {HIGHEST}{sure}", _ratings(analysis)),
        ("packets per second", _rates(analysis)),
    ):
        whole.add_row(Text(f"\n{title}", style="bold"))
        whole.add_row(table)
    whole.add_row("")
    for line in _test_lines(analysis):
        whole.add_row(line)
    if any(test.p is not None for test in analysis.tests.against):
        whole.add_row(_signed_ranks(analysis))
    whole.add_row(Text(f"\npackets per second at a mean rating of {analysis.savings.level:g}", style="bold"))
    whole.add_row(_savings(analysis))
    whole.add_row("")
    whole.add_row(Text(caption, style="dim"))
    return whole


def _subjects(analysis: Analysis) -> str:
    answers = analysis.answers
    trials = len(answers.plan.trials)
    left_out = ", ".join(f"{number} ({rated} of {trials})" for number, rated in answers.incomplete.items())
    complete = f"{analysis.who} with {trials} trials of {answers.plan.duration_s:g} s"
    return complete + (f"; incomplete, left out: {left_out}" if left_out else "")


def _over_webers(analysis: Analysis) -> Table:
    table = _table("predictor")
    for weber in analysis.answers.webers:
        table.add_column(f"k {100 * weber:g} %", justify="right", no_wrap=True)
    return table


def _ratings(analysis: Analysis) -> Table:
    table = _over_webers(analysis)
    sure = len(analysis.answers.subjects) > 1
    for predictor, points in analysis.curves.items():
        bands = [point.quality for point in points]
        table.add_row(predictor, *(f"{band.mean:.2f}" for band in bands))
        if sure:
            table.add_row("", *(f"{band.low:.1f}-{band.high:.1f}" for band in bands), style="dim")
    return table


def _rates(analysis: Analysis) -> Table:
    table = _over_webers(analysis)
    for predictor, points in analysis.curves.items():
        table.add_row(predictor, *(f"{point.packets_per_s.mean:.1f}" for point in points))
    return table


def _test_lines(analysis: Analysis) -> Iterator[str]:
    for name, test in (("predictors", analysis.tests.predictors), ("Weber factors", analysis.tests.webers)):
        if test.chi_squared is None or test.p is None or test.kendalls_w is None:
            yield f"{name}, Friedman: {test.remark}"
            continue
        yield (
            f"{name}, Friedman: chi2({test.degrees}) = {test.chi_squared:.2f}, {_p(test.p, 'p ')}, "
            f"Kendall's W {test.kendalls_w:.2f}" + (f"; {test.remark}" if test.remark else "")
        )


def _signed_ranks(analysis: Analysis) -> Table:
    table = _table(f"against {TESTED_AGAINST}, Wilcoxon")
    for name in ("median difference", "W", "p", "p, Holm"):
        table.add_column(name, justify="right", no_wrap=True)
    for test in analysis.tests.against:
        if test.w is not None and test.p is not None and test.p_holm is not None:
            difference = f"{test.median_difference:+.2f}"
            table.add_row(test.name, difference, f"{test.w:g}", _p(test.p), _p(test.p_holm))
    return table


def _savings(analysis: Analysis) -> Table:
    table = _table("predictor")
    for name in ("packets/s", *(f"fewer than {base}" for base in analysis.savings.against)):
        table.add_column(name, justify="right", no_wrap=True)
    for predictor, crossing in analysis.savings.crossings.items():
        shares = [_share(by_name[predictor]) for by_name in analysis.savings.against.values()]
        own = [predictor == base for base in analysis.savings.against]
        table.add_row(
            predictor,
            _rate(crossing),
            *("" if mine else share for mine, share in zip(own, shares, strict=True)),
        )
    return table


def _table(first: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(first, no_wrap=True)
    return table


def _p(p: float, prefix: str = "") -> str:
    equals = "= " if prefix else ""
    return f"{prefix}< 0.001" if p < 0.001 else f"{prefix}{equals}{p:.3f}"


def _rate(crossing: Crossing) -> str:
    if crossing.packets_per_s is None:
        return crossing.reach.value
    return f"{'<= ' if crossing.reach is Reach.ABOVE else ''}{crossing.packets_per_s:.1f}"


def _share(saving: Saving) -> str:
    if saving.share is None:
        return "-"
    text = f"{'>= ' if saving.at_least else ''}{100 * saving.share:.0f} %"
    if saving.low is None or saving.high is None:
        return text
    return f"{text} ({100 * saving.low:.0f} to {100 * saving.high:.0f})"
