"""The work-precision study of the integrators: rows, orders, fronts, divergence, tables, figure."""

import io
import json
from dataclasses import replace
from math import inf, sqrt
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

pytest.importorskip("scipy")

from weberlink.geometry.vector import Vector
from weberlink.slave.integrators import INTEGRATORS
from weberlink.slave.integrators.contract import ControlledMass, IntegrationScheme, MassState
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.precision.command import summary
from weberlink.studies.precision.measurement import (
    IntegratorRow,
    Point,
    StepSize,
    best_in_time,
    energy_gained,
    fitted_order,
    front,
    measured,
)
from weberlink.studies.precision.problems import PROBLEMS, HalfSpace, Problem, ProblemSurface
from weberlink.studies.precision.reference import reference
from weberlink.studies.precision.study import Effort, ProblemResult, Recommendation, recommendation, study

SMALL = Effort(finest=32, repeats=1)
BY_NAME = {problem.name: problem for problem in PROBLEMS}
WALL = Problem(
    "wall",
    "2e4 N/m",
    ControlledMass(0.2, 5000.0, 40.0),
    (ProblemSurface(HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 2e4),),
    ((0.0, (0.0, 0.0, -0.004)),),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, -0.1),
    duration=0.016,
    smooth=frozenset({"position", "force"}),
)


class Exploding:
    """A method that doubles its distance at every step until nothing finite is left."""

    def __init__(self, body: ControlledMass, scene: Scene | None) -> None:
        pass

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        x, y, z = motion.position
        return MassState((x * 1e200 + 1.0, y, z), motion.velocity, motion.force)


EXPLODING = IntegrationScheme(f"{__name__}:Exploding", order=1, l_stable=False)


@pytest.fixture(scope="module")
def result() -> ProblemResult:
    (result,) = study(SMALL, [WALL], INTEGRATORS, chooser=lambda _: ("exact", 1))
    return result


def test_every_integrator_meets_its_order(result: ProblemResult) -> None:
    assert {(order.integrator, order.quantity) for order in result.orders} == {
        (name, quantity) for name in INTEGRATORS for quantity in ("position", "force")
    }
    for order in result.orders:
        assert order.holds, order
        if not order.exact:
            assert order.fitted == pytest.approx(order.theory, abs=0.2)


@pytest.mark.parametrize("name", ["heavy_10kg", "impact_2m_s", "grazing", "oblique", "overdamped"])
def test_exact_is_exact_on_linear_contact(name: str) -> None:
    problem = BY_NAME[name]
    known = reference(problem)
    for step in (StepSize(ticks=4), StepSize(), StepSize(substeps=7)):
        row = measured(problem, "exact", INTEGRATORS["exact"], step, known, repeats=1)
        assert row.position_error <= 1e-9
        assert row.force_error <= 1e-9


def test_the_document_has_every_combination(result: ProblemResult) -> None:
    document = json.loads(json.dumps(result.as_json(), allow_nan=False))
    steps = [1e6 * step.length for step in SMALL.steps(WALL)]
    assert [(row["integrator"], row["step_us"]) for row in document["rows"]] == [
        (name, step) for name in INTEGRATORS for step in steps
    ]
    assert document["reference_agreement"] <= 1e-9
    assert document["recommended"]["on_front"]
    assert sum(row["recommended"] for row in document["rows"]) == 1
    assert any(row["on_front"] for row in document["rows"])


def test_divergence_is_marked_and_never_on_the_front() -> None:
    problem = BY_NAME["overdamped"]
    schemes = {"semi_implicit": INTEGRATORS["semi_implicit"], "exploding": EXPLODING, "exact": INTEGRATORS["exact"]}
    (result,) = study(Effort(finest=1, repeats=1), [problem], schemes, chooser=lambda _: ("exploding", 1))
    document = json.loads(json.dumps(result.as_json(), allow_nan=False))
    lost = [row for row in document["rows"] if row["integrator"] != "exact"]
    assert all(row["diverged"] and not row["on_front"] for row in lost)
    assert [row["position_error"] for row in lost if row["integrator"] == "exploding"] == [None] * 3
    assert all(row["position_error"] > 1.0 for row in lost if row["integrator"] == "semi_implicit")
    assert not document["recommended"]["on_front"]
    assert "diverged" in text(result)


def text(result: ProblemResult) -> str:
    console = Console(file=io.StringIO(), width=80, color_system=None)
    console.print(summary([result]))
    output = console.file.getvalue()  # type: ignore[attr-defined]
    assert max(len(line.rstrip()) for line in output.splitlines()) <= 80
    assert "…" not in output
    return str(output)


def test_the_tables_fit_80_columns(result: ProblemResult) -> None:
    output = text(result)
    for word in (WALL.name, *INTEGRATORS, "exact", "auto", "itself"):
        assert word in output


def test_a_beaten_choice_names_its_rival(result: ProblemResult) -> None:
    assert result.recommendation is not None
    chosen = replace(result.recommendation.row, problem="a_long_name", integrator="semi_implicit", run_time=0.0125)
    rival = replace(chosen, step=StepSize(substeps=64), position_error=2e-4)
    chosen = replace(chosen, step=StepSize(substeps=16), position_error=2e-3, energy_gained=0.25)
    beaten = Recommendation(chosen, rival, rival)
    output = text(replace(result, problem=replace(WALL, name="a_long_name"), recommendation=beaten))
    for word in ("a_long_name", "2e-03", "2e-01", "semi_implicit 64", "10.00", "12.5"):
        assert word in output


def row(run_time: float, error: float, *, spread: float = 0.0, gained: float = 0.0) -> IntegratorRow:
    return IntegratorRow("p", "i", StepSize(), error, error, error, error, gained, run_time, spread, 3)


def test_a_recommendation_is_compared_with_all_that_take_no_more_time() -> None:
    chosen = row(1.0, 1e-3)
    for other in (row(0.5, 2e-3), row(2.0, 1e-6), row(1.0, 0.7e-3)):
        assert recommendation(chosen, [chosen, other], 1e-12).on_front
    for other in (row(0.5, 0.5e-3), row(1.04, 0.5e-3)):  # the second as quick, within the noise
        beaten = recommendation(chosen, [chosen, other], 1e-12)
        assert not beaten.on_front
        assert beaten.excess == pytest.approx(2.0)
    assert not recommendation(row(1.0, 1e-3, spread=0.4), [chosen, row(1.15, 1e-4)], 1e-12).on_front


def test_energy_that_another_does_not_gain_is_off_the_front() -> None:
    chosen = row(1.0, 1e-3, gained=0.02)
    assert recommendation(chosen, [chosen, row(2.0, 1e-3)], 1e-12).on_front
    other = recommendation(chosen, [chosen, row(0.5, 2e-3, gained=0.01)], 1e-12)
    assert other.gain_excess == pytest.approx(0.01)
    assert not other.on_front


def test_unresolved_errors_count_as_equal() -> None:
    chosen = row(1.0, 3e-14)
    assert recommendation(chosen, [chosen, row(0.9, 1e-15)], 1e-12).rival is chosen
    assert recommendation(row(1.0, 3e-12), [chosen], 1e-12).excess == pytest.approx(3.0)


def test_a_bounce_gains_what_the_integrator_adds() -> None:
    """Without control the mass leaves at its speed; leaving faster by a tenth is a gain of 1 - 1 / 1.21."""
    body, up = ControlledMass(0.2, 0.0, 0.0), (0.0, 0.0, 1.0)
    floor = ProblemSurface(HalfSpace((0.0, 0.0, 0.0), up), 2e4)
    problem = Problem("b", "", body, (floor,), ((0.0, up),), (0.0, 0.0, 0.001), (0.0, 0.0, -1.0))
    deepest = MassState((0.0, 0.0, -sqrt(0.2 / 2e4)), (0.0, 0.0, 0.0), (0.0, 0.0, sqrt(0.2 * 2e4)))
    away = MassState((0.0, 0.0, 0.001), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    faster = replace_velocity(away, 1.1)
    zero = (0.0, 0.0, 0.0)
    assert energy_gained(problem, [deepest, away], zero, 1) == pytest.approx(0.0, abs=1e-12)
    assert energy_gained(problem, [deepest, faster], zero, 1) == pytest.approx(1.0 - 1.0 / 1.21)
    assert energy_gained(problem, [deepest, replace_velocity(away, inf)], zero, 1) == inf


def replace_velocity(motion: MassState, speed: float) -> MassState:
    return motion._replace(velocity=(0.0, 0.0, speed))


def test_the_figure_is_drawn_with_what_diverged(result: ProblemResult, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from weberlink.studies.precision.figures import work_precision  # noqa: PLC0415

    lost = study(Effort(finest=2, repeats=1), [WALL], {"exploding": EXPLODING}, chooser=lambda _: ("exploding", 1))
    work_precision([result, *lost], tmp_path / "work_precision.png", "the environment")
    assert (tmp_path / "work_precision.png").read_bytes().startswith(b"\x89PNG")


STEPS = [2.0**-n for n in range(12)]


@given(st.floats(0.5, 6.0), st.floats(1e-3, 1e3))
def test_a_power_law_gives_its_power(order: float, constant: float) -> None:
    errors = [constant * step**order for step in STEPS]
    fitted = fitted_order(STEPS, errors, 1e-15)
    usable = sum(1e-15 < error < 0.03 for error in errors)
    assert (fitted is None) == (usable < 3)
    if fitted is not None:
        assert fitted == pytest.approx(order, abs=1e-6)


def test_only_asymptotic_errors_are_fitted() -> None:
    errors: list[float | None] = [None, 5.0, 0.9, *[0.02 * 4.0**-n for n in range(4)], *[1e-13] * 5]
    assert fitted_order(STEPS, errors, 1e-12) == pytest.approx(2.0)
    assert fitted_order(STEPS, [None, inf, *[1e-14] * 10], 1e-12) is None


values = st.one_of(st.sampled_from([1.0, 2.0, 3.0]), st.floats(1e-6, 1e6))
points = st.lists(st.tuples(values, st.one_of(values, st.just(inf))), max_size=12)


@given(points, values)
def test_the_front_is_what_nothing_dominates(cloud: list[Point], error: float) -> None:
    best: list[Point] = []  # by rising run time, each with a smaller error than all before
    for time, wrong in sorted(cloud):
        if wrong < min((known for _, known in best), default=inf):
            best.append((time, wrong))
    assert front(cloud) == [point in best for point in cloud]
    index = best_in_time(cloud, error)
    quick = [wrong for time, wrong in cloud if time <= error]
    if index is None:
        assert not quick
    else:
        assert cloud[index][0] <= error
        assert cloud[index][1] == min(quick)
