"""Six degrees of freedom as two daemons over UDP, recorded, and the recording as it is read again."""

from pathlib import Path

import pytest

from tests.program import Program, document
from tests.system.systems import CONFIGS

pytestmark = pytest.mark.realtime


@pytest.mark.hunt
def test_a_live_session_turns_the_tool_is_reported_and_its_recording_says_the_same(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    out, recording = tmp_path / "out.json", tmp_path / "session.mcap"
    with Program(
        "loopback", CONFIGS / "rotation.yaml", "--duration", 2.5, "--json", out, "--record", recording
    ) as program:
        status, output, errors = program.finish()
    assert (status, errors) == (0, "")
    live = document(out.read_text())
    torque, orientation = live["torque"], live["orientation"]
    assert torque["packets"] > 5
    assert orientation["packets"] > 5
    assert torque["reduction"] > 0.9
    assert orientation["reduction"] > 0.9
    assert 0.0 < torque["error_rms"] < 0.05
    assert 0.0 < orientation["error_rms"] < 0.05
    assert sum(torque["selected"].values()) == torque["packets"]
    assert "torque" in output
    assert "orientation" in output
    assert all(len(line) <= 80 for line in output.splitlines())

    with Program("record", "info", recording, "--json", "-") as program:
        status, told, errors = program.finish()
    assert (status, errors) == (0, "")
    read = document(told)
    for channel, figures in (("torque", torque), ("orientation", orientation)):
        assert read[channel]["packets"] == figures["packets"]
        assert read[channel]["error_rms"] == pytest.approx(figures["error_rms"], rel=1e-6)
    assert read["energy"]["dissipated_j"] == pytest.approx(live["energy"]["dissipated_j"], rel=1e-6)
