"""The `ratings` command: the ledgers of an experiment into means, tests and savings, as a document, tables, figures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from evaluation.curves import Curves, Point, curves
from evaluation.environment import environment, footer
from evaluation.experiment.answers import Answers, Whose, gather
from evaluation.experiment.ledger import LedgerError
from evaluation.experiment.savings import Crossing, Reach, Saving, savings
from evaluation.experiment.scale import HIGHEST, LOWEST
from weberlink.configuration import ConfigurationError

if TYPE_CHECKING:
    from evaluation.experiment.statistics import Friedman, SignedRank

SEED = 0
"""Of the bootstrap."""
MARK = "SIMULATED RATINGS"
EXPLANATION = "a program rated, by a rule from the felt error; no person felt anything"
BASES = ("zoh", "linear")
"""What the paper compares packets with."""
TESTED_AGAINST = "zoh"


@dataclass(frozen=True)
class Tests:
    """What the ratings say beyond chance.

    Args:
        predictors: whether they differ, over each subject's means over Weber factors.
        webers: whether Weber factors differ, over each subject's means over predictors.
        against: each other predictor against `TESTED_AGAINST`.
    """

    predictors: "Friedman"
    webers: "Friedman"
    against: Sequence["SignedRank"]

    def as_json(self) -> dict[str, Any]:
        return {
            "friedman_predictors": self.predictors.as_json(),
            "friedman_webers": self.webers.as_json(),
            f"signed_rank_against_{TESTED_AGAINST}": [test.as_json() for test in self.against],
        }


@dataclass(frozen=True)
class Savings:
    """Packets at a level.

    Args:
        level: of the scale.
        crossings: by predictor.
        against: by what is compared with, then by predictor.
    """

    level: float
    crossings: Mapping[str, Crossing]
    against: Mapping[str, Mapping[str, Saving]]

    def as_json(self) -> dict[str, Any]:
        return {
            "level": self.level,
            "predictors": [
                {"predictor": name, "reach": crossing.reach.value, "packets_per_s": crossing.packets_per_s}
                | {f"fewer_than_{base}": by_name[name].as_json() for base, by_name in self.against.items()}
                for name, crossing in self.crossings.items()
            ],
        }


@dataclass(frozen=True)
class Ratings:
    """An analysed study, and how it is shown."""

    answers: Answers
    curves: Curves
    tests: Tests
    savings: Savings
    facts: dict[str, Any]

    @property
    def mark(self) -> str | None:
        return MARK if self.answers.simulated else None

    @property
    def document(self) -> dict[str, Any]:
        answers = self.answers
        return {
            "simulated": answers.simulated,
            "mark": f"{MARK}: {EXPLANATION}" if answers.simulated else None,
            "subjects": answers.subjects,
            "incomplete": [{"subject": subject, "rated": rated} for subject, rated in answers.incomplete.items()],
            "duration_s": answers.plan.duration_s,
            "wording": dict(answers.plan.wording),
            "configuration_digest": answers.plan.digest,
            "rows": [_row(point) for points in self.curves.values() for point in points],
            "tests": self.tests.as_json(),
            "savings": self.savings.as_json(),
            "seed": SEED,
            "environment": self.facts,
        }

    @property
    def table(self) -> Table:
        whole = Table.grid()
        if self.mark is not None:
            whole.add_row(Text(f"{MARK}: {EXPLANATION}", style="bold red"))
        whole.add_row(self._subjects())
        sure = ", with its 95 % confidence interval" if len(self.answers.subjects) > 1 else ""
        for title, table in (
            (f"mean rating, {LOWEST} to {HIGHEST}{sure}", self._ratings()),
            ("packets per second", self._rates()),
        ):
            whole.add_row(Text(f"\n{title}", style="bold"))
            whole.add_row(table)
        whole.add_row("")
        for line in self._test_lines():
            whole.add_row(line)
        if any(test.p is not None for test in self.tests.against):
            whole.add_row(self._signed_ranks())
        whole.add_row(Text(f"\npackets per second at a mean rating of {self.savings.level:g}", style="bold"))
        whole.add_row(self._savings())
        whole.add_row("")
        whole.add_row(Text(footer(self.facts, SEED), style="dim"))
        return whole

    def draw(self, folder: Path) -> None:
        """Write the three figures of the paper, and their points as CSV.

        Raises:
            OSError: if the folder or a file in it cannot be made.
        """
        from evaluation.curve_figures import QualityAxis, draw_curves  # noqa: PLC0415 - heavy, and seldom wanted

        folder.mkdir(parents=True, exist_ok=True)
        who = f"{'simulated ' if self.answers.simulated else ''}subjects"
        draw_curves(
            self.curves,
            folder,
            quality=QualityAxis(label="rating", better="higher", limits=(LOWEST, HIGHEST), column="rating"),
            caption=footer(self.facts, SEED),
            title=self._who(),
            mark=self.mark,
            units=who,
        )

    def write_csv(self, path: Path) -> None:
        """Every rating, for programs of statistics.

        Raises:
            OSError: if the file cannot be written.
        """
        self.answers.write_csv(path)

    def _who(self) -> str:
        count = len(self.answers.subjects)
        return f"{count} {'simulated ' if self.answers.simulated else ''}{'subject' if count == 1 else 'subjects'}"

    def _subjects(self) -> str:
        answers = self.answers
        trials = len(answers.plan.trials)
        left_out = ", ".join(f"{number} ({rated} of {trials})" for number, rated in answers.incomplete.items())
        complete = f"{self._who()} with {trials} trials of {answers.plan.duration_s:g} s"
        return complete + (f"; incomplete, left out: {left_out}" if left_out else "")

    def _over_webers(self) -> Table:
        table = _table("predictor")
        for weber in self.answers.webers:
            table.add_column(f"k {100 * weber:g} %", justify="right", no_wrap=True)
        return table

    def _ratings(self) -> Table:
        table = self._over_webers()
        sure = len(self.answers.subjects) > 1
        for predictor, points in self.curves.items():
            bands = [point.quality for point in points]
            table.add_row(predictor, *(f"{band.mean:.2f}" for band in bands))
            if sure:
                table.add_row("", *(f"{band.low:.1f}-{band.high:.1f}" for band in bands), style="dim")
        return table

    def _rates(self) -> Table:
        table = self._over_webers()
        for predictor, points in self.curves.items():
            table.add_row(predictor, *(f"{point.packets_per_s.mean:.1f}" for point in points))
        return table

    def _test_lines(self) -> Iterator[str]:
        for name, test in (("predictors", self.tests.predictors), ("Weber factors", self.tests.webers)):
            if test.chi_squared is None or test.p is None or test.kendalls_w is None:
                yield f"{name}, Friedman: {test.remark}"
                continue
            yield (
                f"{name}, Friedman: chi2({test.degrees}) = {test.chi_squared:.2f}, {_p(test.p, 'p ')}, "
                f"Kendall's W {test.kendalls_w:.2f}" + (f"; {test.remark}" if test.remark else "")
            )

    def _signed_ranks(self) -> Table:
        table = _table(f"against {TESTED_AGAINST}, Wilcoxon")
        for name in ("median difference", "W", "p", "p, Holm"):
            table.add_column(name, justify="right", no_wrap=True)
        for test in self.tests.against:
            if test.w is not None and test.p is not None and test.p_holm is not None:
                difference = f"{test.median_difference:+.2f}"
                table.add_row(test.name, difference, f"{test.w:g}", _p(test.p), _p(test.p_holm))
        return table

    def _savings(self) -> Table:
        table = _table("predictor")
        for name in ("packets/s", *(f"fewer than {base}" for base in self.savings.against)):
            table.add_column(name, justify="right", no_wrap=True)
        for predictor, crossing in self.savings.crossings.items():
            shares = [_share(by_name[predictor]) for by_name in self.savings.against.values()]
            own = [predictor == base for base in self.savings.against]
            table.add_row(
                predictor,
                _rate(crossing),
                *("" if mine else share for mine, share in zip(own, shares, strict=True)),
            )
        return table


def run(folder: Path, *, level: float, only: str | None, plots: bool) -> Ratings:
    """Analyse a folder of ledgers.

    Args:
        folder: as `experiment --out` made it.
        level: rating at which packets are compared.
        only: "people" or "simulated"; None where there is one kind.
        plots: whether figures will be wanted.

    Raises:
        ConfigurationError: for an argument or a ledger that cannot be used, or a missing package.
    """
    if find_spec("scipy") is None:
        raise ConfigurationError('ratings: needs scipy; install it with: pip install "weberlink[statistics]"')
    if plots and find_spec("matplotlib") is None:
        raise ConfigurationError('--plots: needs matplotlib; install it with: pip install "weberlink[plots]"')
    if not folder.is_dir():
        raise ConfigurationError(f"{folder}: no such folder; expected the one that experiment --out named")
    try:
        answers = gather(folder, _whose(only))
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None
    return Ratings(
        answers, curves(answers.observations, seed=SEED), _tests(answers), _all_savings(answers, level), environment()
    )


def _whose(only: str | None) -> Whose | None:
    kinds: dict[str, Whose] = {"people": "people", "simulated": "simulated"}
    if only is not None and only not in kinds:
        raise ConfigurationError(f"--only: expected people or simulated, not {only!r}")
    return None if only is None else kinds[only]


def _tests(answers: Answers) -> Tests:
    from evaluation.experiment.statistics import against, friedman  # noqa: PLC0415 - needs scipy

    ratings = answers.ratings()
    over_webers = ratings.mean(axis=2)
    by_predictor = dict(zip(answers.predictors, over_webers.T, strict=True))
    base = by_predictor.pop(TESTED_AGAINST)
    return Tests(friedman(over_webers), friedman(ratings.mean(axis=1)), against(base, by_predictor))


def _all_savings(answers: Answers, level: float) -> Savings:
    rates, ratings = answers.packet_rates(), answers.ratings()
    names = answers.predictors
    crossings: dict[str, Crossing] = {}
    by_base: dict[str, dict[str, Saving]] = {}
    for base in BASES:
        found, saved = savings(rates, ratings, level, names.index(base), seed=SEED)
        crossings = dict(zip(names, found, strict=True))
        by_base[base] = dict(zip(names, saved, strict=True))
    return Savings(level, crossings, by_base)


def _row(point: Point) -> dict[str, Any]:
    return {
        "predictor": point.predictor,
        "weber": point.weber,
        "subjects": point.units,
        "rating": point.quality._asdict(),
        "packets_per_s": point.packets_per_s._asdict(),
    }


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
