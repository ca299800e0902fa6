"""`weberlink bridge foxglove` as a process beside a live session."""

import os
import signal
from pathlib import Path

import pytest

from tests.apps.bridge.foxglove_client import FoxgloveClient
from tests.apps.monitor.monitors import Monitor
from tests.program import PATIENT, Program, document, faults_of
from tests.wait import until
from weberlink.system.control_socket import ask
from weberlink.telemetry.ring import default_path


@pytest.mark.realtime
@pytest.mark.hunt
def test_parameters_are_changed_live_and_a_killed_bridge_is_not_noticed(tmp_path: Path) -> None:
    out = tmp_path / "report.json"
    length = ("--json", out, "--set", "link.emulate={}", *PATIENT)
    with Program("loopback", *length) as program:
        slave = program.engaged("slave")
        mine = ("--session", program.pid, "--allow-changes")
        with Monitor(tmp_path, *mine, command="bridge foxglove") as bridge:
            port = int(bridge.until_said(r"ws://127.0.0.1:(\d+)"))
            bridge.until_said("slave at")
            with FoxgloveClient(port, {"/weberlink/bodies"}) as client:
                assert client.set("weber", 0.2) == 0.2
                assert client.set("delay_ms", 1) == 1.0
                assert client.set("weber", 1.2) == 0.2
                refused = until(lambda: [each for each in client.told if each["op"] == "status"], "the refusal")
                assert "from 0 to less than 1" in refused[-1]["message"]
                until(lambda: client.messages["/weberlink/bodies"], "the 3-D view")
            os.kill(bridge.pid, signal.SIGKILL)
        until(lambda: slave.last["weber"] == pytest.approx(0.2), "the change in the records")
        assert ask(default_path(f"{program.pid}-slave"), {"stop": "seen"})["accepted"]
        status, _, errors = program.finish()
    assert status == 0, errors
    assert not any(faults_of(document(out.read_text())).values())
