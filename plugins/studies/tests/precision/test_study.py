"""The work-precision study of the integrators: rows, orders, fronts, divergence, table, figure."""

from typing import Any

import pytest

pytest.importorskip("scipy")
pytest.importorskip("pandas")

from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink_studies.frame import FrameResult, data_frame
from weberlink_studies.precision.problems import HalfSpace, Problem, ProblemSurface
from weberlink_studies.precision.study import Effort, recommendation, run

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


@pytest.fixture(scope="module")
def result() -> FrameResult:
    return run(Effort(finest=32, repeats=1, problems=[WALL]))


def test_every_integrator_meets_its_order(result: FrameResult) -> None:
    orders = result.document["orders"]
    assert {(order["integrator"], order["quantity"]) for order in orders} == {
        (name, quantity) for name in INTEGRATORS for quantity in ("position", "force")
    }
    for order in orders:
        assert order["holds"], order
        if not order["exact_in_theory"]:
            assert order["order"] == pytest.approx(order["order_in_theory"], abs=0.2)


ROW = {
    "integrator": "i", "substeps_per_tick": 1, "recommended": False, "diverged": False, "energy_gained": 0.0,
    "run_time_spread": 0.0, "run_time_ms_per_s": 1.0, "position_error": 1e-3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("chosen", "other", "excess", "on_front"),
    [
        ({}, {"run_time_ms_per_s": 0.5, "position_error": 2e-3}, 1.0, True),
        ({}, {"position_error": 0.7e-3}, 1.0 / 0.7, True),
        ({}, {"run_time_ms_per_s": 1.04, "position_error": 0.5e-3}, 2.0, False),  # as quick, within the noise
        ({"run_time_spread": 0.4}, {"run_time_ms_per_s": 1.15, "position_error": 1e-4}, 10.0, False),
        ({}, {"run_time_ms_per_s": 0.5, "position_error": 1e-6, "substeps_per_tick": 0.5}, 1.0, True),  # no tick
        ({"position_error": 3e-14}, {"run_time_ms_per_s": 0.9, "position_error": 1e-15}, 1.0, True),  # unresolved
        ({"diverged": True}, {"run_time_ms_per_s": 2.0}, None, False),
    ],
)
def test_a_choice_is_compared_with_all_that_take_no_more_time(
    chosen: dict[str, Any], other: dict[str, Any], excess: float | None, on_front: bool
) -> None:
    rows = [ROW | chosen | {"recommended": True}, ROW | {"integrator": "other"} | other]
    found = recommendation(data_frame(rows), floor=1e-12)
    assert found is not None
    assert found["on_front"] is on_front
    if excess is not None:
        assert found["error_excess"] == pytest.approx(excess)
        assert found["rival"] == ("i" if excess == 1.0 else "other")
