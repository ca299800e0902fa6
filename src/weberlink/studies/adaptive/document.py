"""The page of the study as Markdown: its order and its wording."""

from collections.abc import Iterator, Sequence

from weberlink.codec.adaptive import MEMORY, PRESENT
from weberlink.codec.predictors import ADAPTIVE, ADAPTIVE_BANK, HYBRID, PREDICTORS
from weberlink.studies.adaptive import tables
from weberlink.studies.adaptive.comparison import AdaptiveResults, RateRow
from weberlink.studies.adaptive.signals import CHOSEN_RECORDINGS, AdaptiveScope, Half
from weberlink.studies.adaptive.tables import PUBLISHED_FLOOR_N
from weberlink.studies.adaptive.targets import targets
from weberlink.studies.adaptive.variants import ALL_SINGLES, FLOOR_N, SINGLES
from weberlink.studies.adaptive.work import LIMITS, QUIET, RATES, UNSEEN, smoothed_name

BUSY_PER_S = 5.0
HALVES: dict[Half, str] = {"reported": "held-out", "chosen": "tuning"}
"""Names of the halves of the signals: parameters were chosen on the tuning half alone."""
FIGURES = {
    "packets": "Packets of adaptive over those of the hybrid, by signal",
    "ablation": "Packets without a part over those with all parts",
    "felt": "Error and steps at equal packets",
}
"""Figures beside the page, and their captions."""

HEAD = f"""# `{ADAPTIVE}` against the paper's hybrid

`weberlink adaptive` made these measurements and wrote this page; all rows are in [adaptive.json](adaptive.json).
Unless stated otherwise, k = 0.10 and the floor is {FLOOR_N:g} N. The reference of the deadband is the measured force;
the wire steps are the default ones (1 mN, 10 um). The link has no loss and no delay. No person took part: the
felt force is judged by its error.

## Method

When the paper's `{HYBRID}` must send, it chooses the predictor (of {", ".join(SINGLES)}) with the smallest error at
that instant, and fits each to the two samples sent last. `{ADAPTIVE}` runs a *shadow encoder* for every way to
make a model: a deadband loop of its own, which sends when its own prediction leaves the deadband. It chooses the
way whose shadow sent least often recently. The receiver does not need to know this, since choice and parameters
travel in the update. The bank:

- `trend`: a line through the expected course of the signal, by fixed linear filters of the latest samples.
- `affine`: stiffness matrix and drift by ridge least squares over the latest samples.
- `surface`: a patch with stiffness, curvature, Coulomb friction and motion along its normal, estimated from the
  samples of a contact tick by tick. Three hypotheses compete: frictionless and still, frictional and still, moving.
- {", ".join(f"`{name}`" for name in ADAPTIVE_BANK if name in SINGLES)}: as in the paper.

A ratio is packets over packets on the same signal. A mean of ratios is geometric over groups, with the 95 %
interval of a bootstrap over groups (10,000 resamples): all seeds of a scene are one group, every recording is one.
With so few groups the interval is somewhat narrow.
"""

RECORDED = """`tue_*`: a person teleoperating a robot of one degree of freedom that taps aluminium (rigid), foam, a
spring or nothing (free); position and contact force at the robot, 2 kHz averaged to 1 kHz. `omega3_*`: a person
moving a 3-DoF omega.3 in a guidance field, which is no contact and has no surface; 500 Hz interpolated to 1 kHz.
Both are converted from public recordings under the MIT licence
(github.com/Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments and
github.com/xhtsansiro/A_Dynamical-System-Approach-to-Shared-Control), nothing filtered.
"""

CHOSEN = f"""These parameters come from the tuning half: the time constant of the record ({MEMORY:g} ticks), the
weight of the present error ({PRESENT:g} sends), the doubt in `trend` and `affine` ({PREDICTORS["trend"].doubt:g}), and
the filters of `codec/predictors/trend.py`, which are least squares of the mean of the next 20 samples, and of the line
through the next 40, on differences of the latest ones (`src/weberlink/studies/adaptive/filters.py` computes them again
from the recordings). The form of the candidates was developed on signals of both halves, and the packets of the
held-out half were visible meanwhile. Neighbours of the constants, on the tuning half:"""

PACKETS = f"""Ratios of `{ADAPTIVE}`, below 1 where it sends less. The best of four is the best of {", ".join(SINGLES)}
on each signal by itself, which is known only afterwards; the best of seven is that of {", ".join(ALL_SINGLES)}."""

EQUAL = f"""For each signal, bisection finds the Weber factor at which `{ADAPTIVE}` sends as often as the hybrid does at
0.10, to 2 % where the counts allow it (packets do not fall with the factor everywhere), in doubt with fewer packets;
the floor shrinks with it, so that the whole deadband does. One JND is 10 % of the force, at least 0.04 N.
A step is the change of the displayed force from one tick to the next, which includes changes of the contact itself.
In each cell first the hybrid, then `{ADAPTIVE}`."""

SMOOTH = """Smooth updates spread the change of a new model over a ramp. The lag is the length of the ramp (a tick
is 1 ms); the share is the part of the deadband that the ramp may use; the rest of a change is applied at once.
Ratios at the same packets, on the recordings and one seed of each scene:"""

PARTS = """Packets without the part over those with all parts, on the held-out half: above 1 where the part saves
packets, with the signals on which it saves most and least."""

LIMIT = f"""No encoder of these families could send less than this, in packets per second, even if it knew the
future (`src/weberlink/studies/evaluate/clairvoyant/`); the limit is loose in three dimensions. The limit of `trend`,
`affine` and `surface` is not known, so `{ADAPTIVE}` may be below the limit of the hybrid's bank."""

COST = """Encode plus decode of a tick in CPython on the machine of the last line, on parts of the held-out
signals, after all other work. The worst tick includes whatever else the machine did."""


def document(results: AdaptiveResults, scope: AdaptiveScope, caption: str, *, drawn: bool) -> str:
    """The whole page.

    Args:
        results: of the study.
        scope: of the study.
        caption: the environment in which the numbers were made.
        drawn: whether figures lie beside the page.
    """
    return "\n".join(_lines(results, scope, caption, drawn=drawn)) + "\n"


def _lines(results: AdaptiveResults, scope: AdaptiveScope, caption: str, *, drawn: bool) -> Iterator[str]:
    yield HEAD
    yield from _signals(results, scope)
    yield "\n## Targets\n\nOn the held-out half of the signals; intervals are 95 %."
    yield from tables.target_table(targets(results))
    yield from _packets(results, scope, drawn=drawn)
    yield from _felt(results, scope, drawn=drawn)
    yield f"\n## What each part is worth\n\n{PARTS}"
    yield from tables.ablation_table(results)
    yield from _figure("ablation", drawn=drawn)
    yield "\n## Friction and motion\n"
    yield f"Packets of `{ADAPTIVE}` over those of the hybrid, for each held-out seed."
    yield from tables.friction_table(results)
    yield from _losses(results)
    limits = results.of(LIMITS)
    if limits:
        yield f"\n## The clairvoyant limit\n\n{LIMIT}"
        yield from tables.limit_table(limits, results.of(RATES, floor_n=FLOOR_N))
    yield f"\n## Cost\n\n{COST}"
    yield from tables.cost_table(results.costs)
    yield f"\n---\n{caption}"


def _signals(results: AdaptiveResults, scope: AdaptiveScope) -> Iterator[str]:
    main = results.of(RATES, variant=ADAPTIVE, floor_n=FLOOR_N)
    people = {half: [row.signal for row in main if (row.kind, row.half) == ("recording", half)] for half in HALVES}
    others = [str(seed) for seed in scope.seeds if seed != 1]
    yield "## Signals, and how parameters were chosen\n"
    if people["chosen"] and set(people["chosen"]) <= CHOSEN_RECORDINGS:
        yield RECORDED
    yield f"""Scenes: {", ".join(scope.scenes)}. Each was explored for {scope.duration_s:g} s by a modelled hand
(`src/weberlink/studies/evaluate/scenes.py`), with 2 mN rms of sensor noise on each axis unless stated otherwise; a
seed is another motion.
"""
    yield f"- Tuning half, on which parameters were chosen: {_listed(people['chosen'])}, and scene seed 1."
    yield f"- Held-out half, which judges them: {_listed(people['reported'])}, and scene seeds {_listed(others)}.\n"
    yield CHOSEN
    yield from tables.tuning_table(results)


def _packets(results: AdaptiveResults, scope: AdaptiveScope, *, drawn: bool) -> Iterator[str]:
    yield f"\n## Packets\n\n{PACKETS}"
    yield from tables.summary_table(list(_groups(results, scope)))
    yield from _figure("packets", drawn=drawn)
    for half, name in HALVES.items():
        rows = results.of(RATES, half=half, floor_n=FLOOR_N)
        if rows:
            yield f"\n### {name.capitalize()} half\n\nPackets per second at a floor of {FLOOR_N:g} N."
            yield from tables.rate_table(rows, (HYBRID, ADAPTIVE, *ALL_SINGLES))
    few = (HYBRID, ADAPTIVE, *SINGLES)
    known = results.of(RATES, kind="recording", floor_n=PUBLISHED_FLOOR_N)
    if known:
        yield f"\n### Floor {PUBLISHED_FLOOR_N:g} N\n"
        yield "Recordings beside the counts of an independent implementation of the paper's hybrid (without wire"
        yield "steps), then the scenes."
        yield from tables.published_table(known)
        scenes = results.of(RATES, kind="scene", half="reported", floor_n=PUBLISHED_FLOOR_N)
        yield from tables.rate_table(scenes, few)
    for part, title, text in (
        (UNSEEN, "Further seeds", "Scenes with two more seeds, which were not used while the codec was developed."),
        (QUIET, "Scenes without noise", "No sensor is like that: geometry and fits of two samples are exact then."),
    ):
        rows = results.of(part, half="reported")
        if rows:
            yield f"\n### {title}\n\n{text}"
            yield from tables.rate_table(rows, few)


def _groups(results: AdaptiveResults, scope: AdaptiveScope) -> Iterator[tuple[str, Sequence[RateRow]]]:
    for floor in scope.floors_n:
        for half, name in HALVES.items():
            rows = results.of(RATES, half=half, floor_n=floor)
            yield f"{name} half, floor {floor:g} N", rows
            if half == "reported":
                yield "of these, recordings", [row for row in rows if row.kind == "recording"]
                yield "of these, scenes", [row for row in rows if row.kind == "scene"]
                yield f"of these, where hybrid sends {BUSY_PER_S:g}/s or more", busy(rows)
    yield "scenes, further seeds", results.of(UNSEEN)
    yield "scenes without noise, held-out half", results.of(QUIET, half="reported")


def busy(rows: Sequence[RateRow]) -> list[RateRow]:
    """Rows of the signals that the hybrid sends often; a ratio of few packets says little."""
    often = {row.signal for row in rows if row.variant == HYBRID and row.packets_per_s >= BUSY_PER_S}
    return [row for row in rows if row.signal in often]


def _felt(results: AdaptiveResults, scope: AdaptiveScope, *, drawn: bool) -> Iterator[str]:
    yield f"\n## At equal packets\n\n{EQUAL}"
    yield from tables.match_table(results.matches)
    yield from _figure("felt", drawn=drawn)
    yield f"\n{SMOOTH}"
    smoothed = [smoothed_name(ticks, share) for ticks, share in scope.smoothings]
    pairs = [(ADAPTIVE, HYBRID), *((name, HYBRID) for name in smoothed), *((name, ADAPTIVE) for name in smoothed)]
    yield from tables.felt_means(results.matches, pairs)


def _losses(results: AdaptiveResults) -> Iterator[str]:
    yield "\n## Where it loses"
    for half, name in HALVES.items():
        rows = results.of(RATES, half=half, floor_n=FLOOR_N)
        if rows:
            yield f"\nOn the {name} half:\n"
            yield from tables.losses(rows, [match for match in results.matches if match.half == half])
    known = results.of(RATES, half="reported", floor_n=PUBLISHED_FLOOR_N)
    for title, rows in (
        (f"On the held-out half, floor {PUBLISHED_FLOOR_N:g} N", known),
        ("On scenes with further seeds", results.of(UNSEEN)),
        ("On scenes without noise", results.of(QUIET, half="reported")),
    ):
        if rows:
            yield f"\n{title}:\n"
            yield from tables.losses(rows, [])


def _figure(name: str, *, drawn: bool) -> Iterator[str]:
    if drawn:
        yield f"\n![{FIGURES[name]}]({name}.png)"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
