"""The `ratings` command: the ledgers of an experiment as a document, tables and figures."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table
from rich.text import Text

from weberlink.studies.experiment.analysis import EXPLANATION, MARK, SEED, TESTED_AGAINST, Analysis, analyse
from weberlink.studies.experiment.answers import StudyRatings, Whose, gather
from weberlink.studies.experiment.ledger import LedgerError
from weberlink.studies.experiment.plan import HIGHEST, LOWEST
from weberlink.studies.experiment.statistics import Crossing, Reach, Saving
from weberlink.studies.result import StudyResult, plain_table
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.environment import environment, footer


@dataclass(frozen=True)
class Ratings(StudyResult):
    """An analysed study, whose ratings can be written as CSV."""

    answers: StudyRatings

    def write_csv(self, path: Path) -> None:
        """Write every rating as a table.

        Raises:
            OSError: if the file cannot be written.
        """
        self.answers.write_csv(path)


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
    if not folder.is_dir():
        raise ConfigurationError(f"{folder}: no such folder; expected the folder of experiment --out")
    need("scipy", "studies", "ratings")
    if plots:
        need("matplotlib", "studies", "--plots")
    try:
        answers = gather(folder, _whose(only))
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None
    analysis, facts = analyse(answers, level), environment()
    caption = footer(facts, SEED)

    def draw(folder: Path) -> None:
        from weberlink.studies.curve_figures import CurveFigures, QualityAxis  # noqa: PLC0415 - slow import

        CurveFigures(
            analysis.curves,
            quality=QualityAxis("rating", "higher", limits=(LOWEST, HIGHEST), column="rating", words=answers.scale),
            caption=caption,
            title=analysis.who,
            mark=analysis.mark,
            units="simulated subjects" if analysis.mark else "subjects",
        ).write(folder)

    return Ratings(analysis.document | {"environment": facts}, table_of(analysis, caption), draw, answers)


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
    whole.add_row(Text("scale: " + ", ".join(f"{level} {words}" for level, words in analysis.answers.scale.items())))
    sure = ", with its 95 % confidence interval" if len(analysis.answers.subjects) > 1 else ""
    for title, table in (
        (f"mean rating{sure}", _ratings(analysis)),
        ("packets per second", _rates(analysis)),
    ):
        whole.add_row(Text(f"\n{title}", style="bold"))
        whole.add_row(table)
    whole.add_row("")
    for line in _test_lines(analysis):
        whole.add_row(line)
    if any(test.p is not None for test in analysis.against):
        whole.add_row(_signed_ranks(analysis))
    whole.add_row(Text(f"\npackets per second at a mean rating of {analysis.level:g}", style="bold"))
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
    return plain_table("predictor", *(f"k {100 * weber:g} %" for weber in analysis.answers.webers))


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
    for name, test in (("predictors", analysis.by_predictor), ("Weber factors", analysis.by_weber)):
        if test.chi_squared is None or test.p is None or test.kendalls_w is None:
            yield f"{name}, Friedman: {test.remark}"
            continue
        yield (
            f"{name}, Friedman: chi2({test.degrees}) = {test.chi_squared:.2f}, {_p(test.p, 'p ')}, "
            f"Kendall's W {test.kendalls_w:.2f}" + (f"; {test.remark}" if test.remark else "")
        )


def _signed_ranks(analysis: Analysis) -> Table:
    table = plain_table(f"against {TESTED_AGAINST}, Wilcoxon", "median difference", "W", "p", "p, Holm")
    for test in analysis.against:
        if test.w is not None and test.p is not None and test.p_holm is not None:
            difference = f"{test.median_difference:+.2f}"
            table.add_row(test.name, difference, f"{test.w:g}", _p(test.p), _p(test.p_holm))
    return table


def _savings(analysis: Analysis) -> Table:
    table = plain_table("predictor", "packets/s", *(f"fewer than {base}" for base in analysis.savings))
    for predictor, crossing in analysis.crossings.items():
        shares = [_share(by_name[predictor]) for by_name in analysis.savings.values()]
        own = [predictor == base for base in analysis.savings]
        table.add_row(
            predictor,
            _rate(crossing),
            *("" if mine else share for mine, share in zip(own, shares, strict=True)),
        )
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
