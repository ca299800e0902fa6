"""The page of the study as Markdown: what stands where. The wording is in `words`; every number comes from the rows."""

from collections.abc import Iterator, Sequence

from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.studies.adaptive import tables, words
from weberlink.studies.adaptive.losses import losses
from weberlink.studies.adaptive.published import FLOOR_N as PUBLISHED_FLOOR_N
from weberlink.studies.adaptive.rows import Rate, Results
from weberlink.studies.adaptive.signals import CHOSEN_RECORDINGS, Half, Scope
from weberlink.studies.adaptive.variants import ALL_SINGLES, FLOOR_N, SINGLES
from weberlink.studies.adaptive.verdict import targets
from weberlink.studies.adaptive.work import LIMITS, QUIET, RATES, UNSEEN, smoothed_name

BUSY_PER_S = 5.0
HALVES: tuple[Half, Half] = ("reported", "chosen")


def document(results: Results, scope: Scope, caption: str, *, drawn: bool) -> str:
    """The whole page.

    Args:
        results: of the study.
        scope: that was looked at.
        caption: the environment in which the numbers were made.
        drawn: whether figures lie beside the page.
    """
    return "\n".join(_lines(results, scope, caption, drawn=drawn)) + "\n"


def _lines(results: Results, scope: Scope, caption: str, *, drawn: bool) -> Iterator[str]:
    yield words.HEAD
    yield from _signals(results, scope)
    yield f"\n## What it was to show\n\n{words.TARGETS}"
    yield from tables.target_table(targets(results))
    yield from _packets(results, scope, drawn=drawn)
    yield from _felt(results, scope, drawn=drawn)
    yield f"\n## What each part is worth\n\n{words.PARTS}"
    yield from tables.ablation_table(results)
    yield from _figure("ablation", drawn=drawn)
    yield f"\n## Friction and motion\n\n{words.RUBBED}"
    yield from tables.rubbed_table(results)
    yield from _losses(results)
    yield from _limits(results)
    yield f"\n## Cost\n\n{words.COST}"
    yield from tables.cost_table(results.costs)
    yield f"\n---\n{caption}"


def _signals(results: Results, scope: Scope) -> Iterator[str]:
    main = results.of(RATES, variant=ADAPTIVE, floor_n=FLOOR_N)
    people = {half: [row.signal for row in main if (row.kind, row.half) == ("recording", half)] for half in HALVES}
    others = [str(seed) for seed in scope.seeds if seed != 1]
    yield "## Signals, and how parameters were chosen\n"
    if people["chosen"] and set(people["chosen"]) <= CHOSEN_RECORDINGS:
        yield words.RECORDED
    yield f"Scenes: {', '.join(scope.scenes)}. Each was explored for {scope.duration_s:g} s by {words.EXPLORED}\n"
    yield f"- Parameters were chosen on: {_listed(people['chosen'])}, and scene seed 1."
    yield f"- Everything is reported on: {_listed(people['reported'])}, and scene seeds {_listed(others)}.\n"
    yield words.CHOSEN
    yield from tables.tuning_table(results)


def _packets(results: Results, scope: Scope, *, drawn: bool) -> Iterator[str]:
    yield f"\n## Packets\n\n{words.PACKETS}"
    yield from tables.summary_table(list(_groups(results, scope)))
    yield from _figure("packets", drawn=drawn)
    for half in HALVES:
        rows = results.of(RATES, half=half, floor_n=FLOOR_N)
        if rows:
            yield f"\n### The half that chose {words.HALVES[half]}\n\nPackets per second at a floor of {FLOOR_N:g} N."
            yield from tables.rate_table(rows, (HYBRID, ADAPTIVE, *ALL_SINGLES))
    known = results.of(RATES, kind="recording", floor_n=PUBLISHED_FLOOR_N)
    if known:
        yield f"\n### Floor {PUBLISHED_FLOOR_N:g} N\n\n{words.PUBLISHED}"
        yield from tables.published_table(known)
        scenes = results.of(RATES, kind="scene", half="reported", floor_n=PUBLISHED_FLOOR_N)
        yield from tables.rate_table(scenes, (HYBRID, ADAPTIVE, *SINGLES))
    for part, title, text in ((UNSEEN, "Further seeds", words.UNSEEN), (QUIET, "Scenes without noise", words.QUIET)):
        rows = results.of(part, half="reported")
        if rows:
            yield f"\n### {title}\n\n{text}"
            yield from tables.rate_table(rows, (HYBRID, ADAPTIVE, *SINGLES))


def _groups(results: Results, scope: Scope) -> Iterator[tuple[str, Sequence[Rate]]]:
    for floor in scope.floors_n:
        for half in HALVES:
            rows = results.of(RATES, half=half, floor_n=floor)
            yield f"half that chose {words.HALVES[half]}, floor {floor:g} N", rows
            if half == "reported":
                yield "of these, recordings", [row for row in rows if row.kind == "recording"]
                yield "of these, scenes", [row for row in rows if row.kind == "scene"]
                yield f"of these, where hybrid sends {BUSY_PER_S:g}/s or more", busy(rows)
    yield "scenes, further seeds", results.of(UNSEEN)
    yield "scenes without noise, half that chose nothing", results.of(QUIET, half="reported")


def busy(rows: Sequence[Rate]) -> list[Rate]:
    """Those of signals that the hybrid sends often: of few packets a ratio says little."""
    often = {row.signal for row in rows if row.variant == HYBRID and row.packets_per_s >= BUSY_PER_S}
    return [row for row in rows if row.signal in often]


def _felt(results: Results, scope: Scope, *, drawn: bool) -> Iterator[str]:
    yield f"\n## At equal packets\n\n{words.EQUAL}"
    yield from tables.match_table(results.matches, (HYBRID, ADAPTIVE))
    yield from _figure("felt", drawn=drawn)
    yield f"\n{words.SMOOTH}"
    smoothed = [smoothed_name(ticks, share) for ticks, share in scope.smoothings]
    pairs = [(ADAPTIVE, HYBRID), *((name, HYBRID) for name in smoothed), *((name, ADAPTIVE) for name in smoothed)]
    yield from tables.felt_means(results.matches, pairs)


def _losses(results: Results) -> Iterator[str]:
    yield "\n## Where it loses"
    for half in HALVES:
        rows = results.of(RATES, half=half, floor_n=FLOOR_N)
        if rows:
            yield f"\nOn the half that chose {words.HALVES[half]}:\n"
            yield from losses(rows, [match for match in results.matches if match.half == half])
    known = results.of(RATES, half="reported", floor_n=PUBLISHED_FLOOR_N)
    further, quiet = results.of(UNSEEN), results.of(QUIET, half="reported")
    where = f"On the half that chose nothing, floor {PUBLISHED_FLOOR_N:g} N"
    for title, rows in ((where, known), ("On scenes with further seeds", further), ("On scenes without noise", quiet)):
        if rows:
            yield f"\n{title}:\n"
            yield from losses(rows, [])


def _limits(results: Results) -> Iterator[str]:
    limits = results.of(LIMITS)
    if limits:
        yield f"\n## The clairvoyant limit\n\n{words.LIMITS}"
        yield from tables.limit_table(limits, results.of(RATES, floor_n=FLOOR_N))


def _figure(name: str, *, drawn: bool) -> Iterator[str]:
    if drawn:
        yield f"\n![{words.FIGURES[name]}]({name}.png)"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
