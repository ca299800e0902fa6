"""Models of the protocol hold in every state, and each fault put in is found; `make model` runs all of them."""

from pathlib import Path

import pytest

from trials.model.__main__ import FORMER, MUTANTS, PASSING, Run, missing_tool, verify

pytestmark = pytest.mark.skipif(missing_tool() is not None, reason="spin and gcc are not installed: make system")
QUICK = {
    "link 4: no replay window": False,
    "streams: one of each end": True,
    "streams: who returns does not know that it is shown": False,
}


CHOSEN = [run for run in (*PASSING, *FORMER, *MUTANTS) if run.name in QUICK]


@pytest.mark.parametrize("run", CHOSEN, ids=lambda run: run.name)
def test_protocol_holds_in_every_state_and_faults_do_not(run: Run, tmp_path: Path) -> None:
    found = verify(run, tmp_path, is_quick=not QUICK[run.name])
    assert found.holds is QUICK[run.name], found.failure
    assert not found.holds or (found.is_exhaustive and found.states > 1000)
