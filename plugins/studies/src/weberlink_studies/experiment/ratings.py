"""The `ratings` command: means with confidence, tests, and packets at equal quality, from the ledgers of an experiment.

A case of the study is a subject who has rated every trial, a row is a rating. Ledgers that are not comparable are
refused.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from weberlink.config import ConfigurationError
from weberlink_studies.curves import RATE, curves
from weberlink_studies.experiment.ledger import LedgerError, SubjectProgress, path_of, read, subjects
from weberlink_studies.experiment.plan import HIGHEST, LOWEST, TrialPlan
from weberlink_studies.experiment.statistics import ABOVE, against, friedman, savings
from weberlink_studies.frame import FrameResult, Row, Study, data_frame
from weberlink_studies.paper.claims import PREDICTORS
from weberlink_studies.result import Column, frame_table, plain_table

if TYPE_CHECKING:
    from pandas import DataFrame

FIGURES = (
    "packets_per_s", "reduction", "error_rms", "violation_fraction",
    "error_rms_jnd", "log_error_rms_jnd", "jump_median_jnd", "jump_p99_jnd", "jump_max_jnd",
)  # fmt: skip
PEOPLE, SIMULATED = "people", "simulated"


@dataclass(frozen=True)
class StudyRatings:
    """The ledgers of all subjects who have rated every trial."""

    complete: Sequence[SubjectProgress]  # in the order of their numbers; at least one, and all comparable
    # subjects that are left out, with their number of rated trials. Their last conditions are missing, so means would
    # compare different people.
    incomplete: Mapping[int, int]

    @property
    def plan(self) -> TrialPlan:
        """That of the first subject; the others are compatible with it."""
        return self.complete[0].plan


def rows_of(progress: SubjectProgress) -> list[Row]:
    """A row for each rating of a subject, in the order of the trials."""
    return [
        {
            "subject": progress.plan.subject,
            "simulated": progress.plan.simulated,
            "trial": number,
            "attempt": entry.attempt,
            "predictor": entry.predictor,
            "weber": entry.weber,
            "rating": entry.rating,
            **{name: entry.figures.get(name) for name in FIGURES},
        }
        for number, entry in sorted(progress.rated.items())
    ]


def gather(folder: Path, whose: str | None) -> StudyRatings:
    """The answers in a folder."""
    found = {kind: subjects(folder, simulated=kind == SIMULATED) for kind in (PEOPLE, SIMULATED)}
    if whose is None and all(found.values()):
        raise LedgerError(
            f"{folder}: has ledgers of people and of a program, which cannot be analysed together; "
            "choose with --only people or --only simulated"
        )
    whose = whose or (SIMULATED if found[SIMULATED] else PEOPLE)
    paths = {subject: path_of(folder, subject, simulated=whose == SIMULATED) for subject in found[whose]}
    ledgers = {subject: read(path) for subject, path in paths.items()}
    complete: dict[int, SubjectProgress] = {}
    for subject, progress in ledgers.items():
        if progress is not None:
            _check(progress, paths[subject], subject, whose)
            if not progress.remaining:
                complete[subject] = progress
    if not complete:
        kind = "simulated subject" if whose == SIMULATED else "person"
        raise LedgerError(f"{folder}: no {kind} has rated all trials; {len(ledgers)} incomplete")
    first, *others = complete
    for other in others:
        _check_alike(complete[first].plan, complete[other].plan, paths[first], paths[other])
    incomplete = {
        subject: len(progress.rated) if progress is not None else 0
        for subject, progress in ledgers.items()
        if subject not in complete
    }
    return StudyRatings(list(complete.values()), incomplete)


def _check(progress: SubjectProgress, path: Path, subject: int, whose: str) -> None:
    plan = progress.plan
    if plan.simulated != (whose == SIMULATED) or plan.subject != subject:
        is_of = f"{'simulated ' if plan.simulated else ''}subject {plan.subject}"
        raise LedgerError(f"{path}:1: is the ledger of {is_of}, which does not match its file name")
    for number, entry in progress.rated.items():
        rate = entry.figures.get("packets_per_s")
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 <= rate < inf:
            raise LedgerError(f"{path}: trial {number}: expected figures with packets_per_s, not {rate!r}")


def _check_alike(one: TrialPlan, other: TrialPlan, first: Path, second: Path) -> None:
    """Check that two subjects took part in the same study."""
    for differs, what in (
        (one.digest != other.digest, "another configuration"),
        (one.duration_s != other.duration_s, "trials of another length"),
        (one.wording != other.wording, "another wording of the scale"),
        (set(one.trials) != set(other.trials), "other trials"),
    ):
        if differs:
            raise LedgerError(f"{second}: has {what} than {first}; put each study into a folder of its own")


SEED = 0  # seed of the bootstrap
MARK = "SIMULATED RATINGS"
EXPLANATION = "a program rated by a rule from the felt error; no person took part"
BASES = ("zoh", "linear")  # predictors with which the paper compares packets
TESTED_AGAINST = "zoh"
LEAST_P = 0.001  # smaller ones are printed as less than this


@dataclass(frozen=True)
class RatingsOptions:
    """What is analysed."""

    answers: StudyRatings  # the ledgers
    level: float  # of the scale, at which packets are compared

    @property
    def mark(self) -> str | None:
        """The mark of simulated ratings; None if people rated."""
        return MARK if self.answers.plan.simulated else None

    @property
    def who(self) -> str:
        """Number and kind of the subjects."""
        count = len(self.answers.complete)
        return f"{count} {'simulated ' if self.mark else ''}{'subject' if count == 1 else 'subjects'}"

    @cached_property
    def analysis(self) -> dict[str, Any]:
        """Means, tests and savings, as in the JSON document."""
        from pandas import MultiIndex  # noqa: PLC0415 - heavy, an extra

        plan = self.answers.plan
        rows = data_frame([row for progress in self.answers.complete for row in rows_of(progress)])
        known = [*PREDICTORS, *sorted({*rows.predictor} - {*PREDICTORS})]
        rows = rows.sort_values("predictor", key=lambda column: column.map(known.index), kind="stable")
        means = curves(rows.rename(columns={"subject": "unit"}), "rating", seed=SEED)
        names = list(means.predictor.unique())
        by_predictor = rows.pivot_table(index="subject", columns="predictor", values="rating")[names]
        by_weber = rows.pivot_table(index="subject", columns="weber", values="rating")
        every = MultiIndex.from_product([names, by_weber.columns])
        rates, ratings = (
            rows.pivot(index="subject", columns=["predictor", "weber"], values=name)
            .reindex(columns=every)
            .to_numpy(float)
            .reshape(len(rows.subject.unique()), len(names), -1)
            for name in (RATE, "rating")
        )
        saved = savings(rates, ratings, self.level, [names.index(base) for base in BASES], seed=SEED)
        return {
            "simulated": plan.simulated,
            "mark": f"{MARK}: {EXPLANATION}" if self.mark else None,
            "subjects": [progress.plan.subject for progress in self.answers.complete],
            "incomplete": [{"subject": subject, "rated": rated} for subject, rated in self.answers.incomplete.items()],
            "duration_s": plan.duration_s,
            "wording": {str(level): words for level, words in plan.wording.items()},
            "configuration_digest": plan.digest,
            "means": means.to_dict("records"),
            "tests": {
                "friedman_predictors": friedman(by_predictor),
                "friedman_webers": friedman(by_weber),
                f"signed_rank_against_{TESTED_AGAINST}": against(by_predictor, TESTED_AGAINST),
            },
            "savings": {
                "level": self.level,
                "predictors": [
                    {"predictor": name, "reach": one["reach"], "packets_per_s": one["packets_per_s"]}
                    | {f"fewer_than_{base}": one["fewer_than"][names.index(base)] for base in BASES}
                    for name, one in zip(names, saved, strict=True)
                ],
            },
        }


def _tables(options: RatingsOptions, _rows: "DataFrame", _run_time_s: float, caption: str) -> RenderableType:
    """All tables below each other, and the environment in which they were made."""
    plan, document, many = options.answers.plan, options.analysis, len(options.answers.complete) > 1
    means = data_frame(document["means"])
    trials = len(plan.trials)
    left_out = ", ".join(f"{number} ({rated} of {trials})" for number, rated in options.answers.incomplete.items())
    subjects = f"{options.who} with {trials} trials of {plan.duration_s:g} s"
    scale = ", ".join(f"{level} {plan.wording[level]}" for level in sorted(plan.wording, reverse=True))
    heads = [f"k {100 * weber:g} %" for weber in sorted(means.weber.unique())]
    rating, rate = plain_table("predictor", *heads), plain_table("predictor", *heads)
    for name, mine in means.groupby("predictor", sort=False):
        rating.add_row(name, *mine.rating_mean.map("{:.2f}".format))
        if many:
            bands = zip(mine.rating_low, mine.rating_high, strict=True)
            rating.add_row("", *(f"{low:.1f}-{high:.1f}" for low, high in bands), style="dim")
        rate.add_row(name, *mine.packets_per_s_mean.map("{:.1f}".format))
    tests = document["tests"]
    ranks = data_frame(tests[f"signed_rank_against_{TESTED_AGAINST}"])
    return Group(
        *([Text(f"{MARK}: {EXPLANATION}", style="bold red")] if options.mark else []),
        subjects + (f"; incomplete, left out: {left_out}" if left_out else ""),
        Text(f"scale: {scale}"),
        Text(f"\nmean rating{', with its 95 % confidence interval' if many else ''}", style="bold"),
        rating,
        Text("\npackets per second", style="bold"),
        rate,
        "",
        *_friedman_lines(tests),
        *([frame_table(ranks, RANKS)] if ranks.p.notna().all() else []),
        Text(f"\npackets per second at a mean rating of {options.level:g}", style="bold"),
        _savings(document["savings"]["predictors"]),
        "",
        Text(caption, style="dim"),
    )


def _friedman_lines(tests: dict[str, Any]) -> Iterator[str]:
    for name, test in (("predictors", tests["friedman_predictors"]), ("Weber factors", tests["friedman_webers"])):
        if test["p"] is None:
            yield f"{name}, Friedman: {test['remark']}"
            continue
        p = f"p {'' if test['p'] < LEAST_P else '= '}{_p(test['p'])}"
        yield (
            f"{name}, Friedman: chi2({test['degrees']}) = {test['chi_squared']:.2f}, {p}, "
            f"Kendall's W {test['kendalls_w']:.2f}" + (f"; {test['remark']}" if test["remark"] else "")
        )


def _p(p: float) -> str:
    return f"< {LEAST_P}" if p < LEAST_P else f"{p:.3f}"


RANKS = {
    "name": Column(f"against {TESTED_AGAINST}, Wilcoxon"),
    "median_difference": Column("median difference", "{:+.2f}"),
    "w": Column("W", "{:g}"),
    "p": Column("p", _p),
    "p_holm": Column("p, Holm", _p),
}


def _savings(predictors: Sequence[dict[str, Any]]) -> Table:
    table = plain_table("predictor", "packets/s", *(f"fewer than {base}" for base in BASES))
    for one in predictors:
        rate, is_bound = one["packets_per_s"], one["reach"] == ABOVE
        table.add_row(
            one["predictor"],
            one["reach"] if rate is None else f"{'<= ' if is_bound else ''}{rate:.1f}",
            *("" if one["predictor"] == base else _share(one[f"fewer_than_{base}"]) for base in BASES),
        )
    return table


def _share(saving: dict[str, Any]) -> str:
    if saving["share"] is None:
        return "-"
    text = f"{'>= ' if saving['at_least'] else ''}{100 * saving['share']:.0f} %"
    return text if saving["low"] is None else f"{text} ({100 * saving['low']:.0f} to {100 * saving['high']:.0f})"


def _plots(options: RatingsOptions, _rows: "DataFrame", folder: Path, caption: str) -> None:
    from weberlink_studies.curve_figures import CurveFigures, QualityAxis  # noqa: PLC0415 - imports matplotlib

    axis = QualityAxis("rating", "rating", "higher", (LOWEST, HIGHEST), options.answers.plan.wording)
    units = "simulated subjects" if options.mark else "subjects"
    CurveFigures(data_frame(options.analysis["means"]), axis, caption, options.who, options.mark, units).write(folder)


STUDY: Study[RatingsOptions, SubjectProgress] = Study(
    "ratings",
    lambda options: options.answers.complete,
    rows_of,
    _tables,
    _plots,
    lambda _: 0.0,
    lambda options, _: options.analysis,
    SEED,
)


def run(folder: Path, *, level: float, only: str | None) -> FrameResult:
    """Analyse a folder of ledgers."""
    if not folder.is_dir():
        raise ConfigurationError(f"{folder}: no such folder; expected the folder of experiment --out")
    if only not in {None, PEOPLE, SIMULATED}:
        raise ConfigurationError(f"--only: expected people or simulated, not {only!r}")
    try:
        return STUDY.result(RatingsOptions(gather(folder, only), level))
    except LedgerError as error:
        raise ConfigurationError(str(error)) from None
