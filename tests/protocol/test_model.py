"""The models of the protocol hold in every state, and each mutant fails; `make model` runs all of them."""

from pathlib import Path

import pytest

from tests.protocol.model.spin import FORMER, MUTANTS, PASSING, Run, missing_tool, verify

pytestmark = pytest.mark.skipif(missing_tool() is not None, reason="spin and gcc are not installed: make system")

QUICK = {
    "link: R changes, datagrams held until stamps and echoes wrap",
    "link 4: no replay window",
    "link 19: next proposal at once",
}


def chosen(*groups: tuple[Run, ...]) -> list[object]:
    """Every run; those that take long explore."""
    return [
        pytest.param(run, id=run.name, marks=() if run.name in QUICK else pytest.mark.hunt)
        for runs in groups
        for run in runs
    ]


@pytest.mark.parametrize("run", chosen(PASSING))
def test_protocol_holds_in_every_state(run: Run, tmp_path: Path) -> None:
    found = verify(run, tmp_path)
    assert found.holds, found.failure
    assert found.is_exhaustive
    assert found.states > 1000


@pytest.mark.parametrize("run", chosen(FORMER, MUTANTS))
def test_faulty_protocol_fails(run: Run, tmp_path: Path) -> None:
    assert not verify(run, tmp_path, is_quick=True).holds
