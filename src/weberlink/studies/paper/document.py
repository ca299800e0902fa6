"""The page "The paper and us" as Markdown, from the measurements of `weberlink study paper`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from weberlink.studies.curves import Observation
from weberlink.studies.paper.claims import CLAIMS, WEBER, ClaimResult, measure


@dataclass(frozen=True)
class PaperCondition:
    """One set of signals, coded with every predictor.

    Args:
        key: short name, for folders.
        title: a heading.
        text: how the numbers were measured.
        observations: packet rate and RMS error [JND] of each unit, predictor and Weber factor; may be empty.
    """

    key: str
    title: str
    text: str
    observations: Sequence[Observation]

    @property
    def results(self) -> list[ClaimResult]:
        return [measure(claim, self.observations) for claim in CLAIMS]

    @property
    def units(self) -> list[str]:
        return list(dict.fromkeys(one.unit for one in self.observations))


HEAD = """# The paper and us

What X. Xu, J. Kammerl, R. Chaudhari and E. Steinbach report in "Hybrid signal-based and geometry-based prediction for
haptic data reduction" (HAVE 2011), beside what is measured with this code. Made by `make figures`, not edited by hand.

The paper's numbers are of a simulated scene that people touched with a real device, and its quality is their rating.
Here nobody was asked: the quality is the RMS error of the force in JNDs, one JND being 10 % of the force or 0.04 N,
and "equal quality" means the error that the reference of the claim has at k = 0.10. Ratings of people come from
`weberlink study experiment` alone. The floor of the deadband is 0.02 N throughout.

A saving is the geometric mean over signals, with the 95 % interval of a bootstrap over them. A claim *holds* if all of
that interval saves at least as much as claimed, and *fails* if all of it saves less; otherwise, and for a single
signal, it is *undecided*. Where a predictor never reaches the quality of the reference, at none of its Weber factors,
there is no saving to average: such signals are counted beside the verdict. The last column of the longer tables names
them, and those on which the predictor saves nothing.
"""


def document(conditions: Sequence[PaperCondition], caption: str, *, drawn: bool) -> str:
    """The whole page; `drawn` says whether its figures are beside it."""
    return "\n".join(_lines(conditions, caption, drawn=drawn)) + "\n"


def _lines(conditions: Sequence[PaperCondition], caption: str, *, drawn: bool) -> Iterator[str]:
    yield HEAD
    yield from _summary(conditions)
    for condition in conditions:
        yield f"\n## {condition.title}\n"
        yield condition.text
        if not condition.observations:
            yield "\nNot measured in this run: no signals were given."
            continue
        yield from _claims(condition)
        if drawn:
            yield from _figures(condition)
    if drawn:
        yield f"\n## Forces over time\n\nOf the last scene above, the codec alone, k = {WEBER:.2f}.\n"
        yield "![Force over time with the sends marked (the paper's Figs. 2 and 3)](force.png)\n"
    yield f"\n---\n{caption}"


def _summary(conditions: Sequence[PaperCondition]) -> Iterator[str]:
    yield "| claim | paper | " + " | ".join(condition.title for condition in conditions) + " |"
    yield "|---|---|" + "---|" * len(conditions)
    columns = [condition.results for condition in conditions]
    for claim, *found in zip(CLAIMS, *columns, strict=True):
        cells = [_measured(one) for one in found]
        yield f"| {claim.predictor} against {claim.reference}, {claim.conditions} | {_fewer(claim.fewer)} | " + (
            " | ".join(cells) + " |"
        )


def _measured(found: ClaimResult) -> str:
    if found.fewer is None:
        return "-"
    return f"{_fewer(found.fewer.mean)} ({', '.join([found.verdict, *_never(found)])})"


def _never(found: ClaimResult) -> list[str]:
    """How many signals never reach the quality, if any."""
    count = len(found.unreached)
    return [f"{count} of {found.signals} never reach{'' if count > 1 else 'es'} the quality"] if count else []


def _claims(condition: PaperCondition) -> Iterator[str]:
    yield "\n| claim | paper | here (95 %) | signals | verdict | saves nothing on |"
    yield "|---|---|---|---|---|---|"
    for found in condition.results:
        claim, fewer = found.claim, found.fewer
        here = "-" if fewer is None else f"{_fewer(fewer.mean)} ({_bare(fewer.low)} to {_bare(fewer.high)})"
        yield (
            f"| {claim.predictor} against {claim.reference}, {claim.conditions} | {_fewer(claim.fewer)} | {here} | "
            f"{found.units} of {found.signals} | {found.verdict} | {_exceptions(found)} |"
        )


def _exceptions(found: ClaimResult) -> str:
    """Units where the predictor saves nothing or never reaches the quality."""
    parts = [f"{unit} ({_signed(found.ratios[unit] - 1.0)})" for unit in found.failing]
    parts += [f"{unit} (never reaches the quality)" for unit in found.unreached]
    return ", ".join(parts) or "-"


def _figures(condition: PaperCondition) -> Iterator[str]:
    yield ""
    for name, words in (
        ("packet_rate", "Packet rate over Weber factor (the paper's Fig. 7)"),
        ("quality", "Error over Weber factor (Fig. 8)"),
        ("quality_over_rate", "Error over packet rate (Fig. 9)"),
    ):
        yield f"![{words}]({condition.key}/{name}.png)\n"


def _fewer(share: float) -> str:
    return f"{_bare(share)} fewer" if share >= 0.0 else f"{_bare(-share)} more"


def _bare(share: float) -> str:
    return f"{round(100 * share)} %"  # an integer has no negative zero


def _signed(share: float) -> str:
    return f"{100 * share:+.0f} %"
