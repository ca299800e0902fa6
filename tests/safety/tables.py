"""The figures as tables of Markdown: the worst of each row."""

from collections.abc import Callable, Iterable, Sequence

from tests.safety.held import ALL, ALONE, Held
from tests.safety.run import Run

COLUMNS = (
    ("agreed round trip", lambda run: run.figures.round_trip_ms, "{:.0f} ms"),
    ("robot stops", lambda run: run.figures.robot_ms, "{:.0f} ms"),
    ("hand free", lambda run: run.figures.force_ms, "{:.0f} ms"),
    ("robot moved at loop age", lambda run: run.figures.robot_age_ms, "{:.0f} ms"),
    ("force at loop age", lambda run: run.figures.force_age_ms, "{:.0f} ms"),
    ("beyond the hand", lambda run: run.figures.beyond_mm, "{:.1f} mm"),
    ("on the hand", lambda run: run.figures.hand_n, "{:.1f} N"),
    ("robot", lambda run: run.figures.robot_n, "{:.1f} N"),
    ("step", lambda run: run.figures.step_n, "{:.2f} N"),
)


def by_fault(runs: Iterable[Run]) -> list[str]:
    """The worst over motions and predictors, for each fault of the link and scheme of control."""
    return _table("fault of the link | control", runs, lambda run: (run.case.fault, run.case.scheme))


def by_delay(runs: Iterable[Run]) -> list[str]:
    """The worst over everything else for one cut, for each delay and fault of the link."""
    cuts = [run for run in runs if not run.case.flap_hz]
    return _table("one way | fault of the link", cuts, lambda run: (_delays(run), run.case.fault))


def _delays(run: Run) -> str:
    there, back = (1e3 * each for each in run.case.delay_s)
    return f"{there:g} ms" if there == back else f"{there:g} and {back:g} ms"


def by_predictor(runs: Iterable[Run]) -> list[str]:
    """The worst over everything else, for each pair of predictors."""
    return _table("force | position", runs, lambda run: (run.case.force, run.case.position))


def _table(heads: str, runs: Iterable[Run], key: Callable[[Run], tuple[str, str]]) -> list[str]:
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault(key(run), []).append(run)
    lines = [f"| {heads} | {' | '.join(name for name, _, _ in COLUMNS)} | faults of master, slave | broke a law |"]
    lines.append("|---|---|" + "---:|" * len(COLUMNS) + "---|---:|")
    for (first, second), group in groups.items():
        cells = [_worst(group, value, form) for _, value, form in COLUMNS]
        faults = ", ".join(_names(group, side) for side in (0, 1))
        broken = sum(bool(run.violations) for run in group)
        lines.append(f"| {first} | {second} | {' | '.join(cells)} | {faults} | {broken} of {len(group)} |")
    return lines


def _worst(group: Sequence[Run], value: Callable[[Run], float | None], form: str) -> str:
    values = [found for run in group if run.figures is not None and (found := value(run)) is not None]
    return form.format(max(values)) if values else "-"


def _names(group: Sequence[Run], side: int) -> str:
    named = {name for run in group if run.figures is not None for name in run.figures.faults[side] or ("none",)}
    return "/".join(sorted(name.lower() for name in named))


def of_held(rows: Iterable[Held]) -> list[str]:
    """Executed updates that were too old, by age and direction; the last rows are of links that are always slow."""
    ages: dict[tuple[str, float], dict[tuple[str, str], Held]] = {}
    for row in rows:
        ages.setdefault(("" if row.mode in (ALONE, ALL) else "always ", row.age_s), {})[row.direction, row.mode] = row
    modes = sorted({where for group in ages.values() for where in group if where[1] in (ALONE, ALL)})
    lines = [f"| age | {' | '.join(f'{way}, {mode}' for way, mode in modes)} |", "|---:|" + "---:|" * len(modes)]
    for (prefix, age), group in ages.items():
        if prefix:
            lines += [
                f"| {prefix}{1e3 * age:.0f} ms {way} | {row.too_old} of {row.executed} |" + " |" * (len(modes) - 1)
                for (way, _), row in group.items()
            ]
        else:
            cells = [f"{group[where].too_old} of {group[where].held}" if where in group else "-" for where in modes]
            lines.append(f"| {age:.3f} s | {' | '.join(cells)} |")
    return lines
