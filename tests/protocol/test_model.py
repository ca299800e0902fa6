"""The models of the protocol: the new one holds in every state, today's fails, and so does each fault put in."""

from pathlib import Path

import pytest

from tests.protocol.model.spin import MUTANTS, PASSING, TODAY, Run, missing_tool, verify

pytestmark = pytest.mark.skipif(missing_tool() is not None, reason="spin and gcc are not installed: make system")


@pytest.mark.parametrize("run", PASSING, ids=lambda run: run.name)
def test_protocol_holds_in_every_state(run: Run, tmp_path: Path) -> None:
    found = verify(run, tmp_path)
    assert found.holds, found.failure
    assert found.is_exhaustive
    assert found.states > 1000


@pytest.mark.parametrize("run", [*TODAY, *MUTANTS], ids=lambda run: run.name)
def test_faulty_protocol_fails(run: Run, tmp_path: Path) -> None:
    assert not verify(run, tmp_path, is_quick=True).holds
