"""doctor --link against a waiting slave: two processes, sockets, and a link with known faults."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.program import Program, document, free_port
from tests.session.systems import CONFIGS


@pytest.mark.realtime
def test_waiting_slave_is_measured_and_stays_at_rest(tmp_path: Path) -> None:
    address, summary = f"127.0.0.1:{free_port()}", tmp_path / "slave.json"
    faults = ("link.emulate={delay_ms: 20, loss: 0.1, burst: 3}", "link.silence_ms=2000", "control.scheme=none")
    settings = (f"link.listen={address}", f"link.slave={address}", *faults)
    common = [str(CONFIGS / "loopback.yaml"), *(f"--set={each}" for each in settings)]
    with Program("slave", *common, "--json", summary) as slave:
        slave.telemetry("slave")
        doctor = ["doctor", *common, "--link", address, "--duration", "2", "--json", "-"]
        command = [sys.executable, "-m", "weberlink", *doctor]
        found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        slave.send(15)
        slave.finish()
    told = json.loads(found.stdout)
    assert told["link"]["rtt_ms"]["min"] == pytest.approx(41.0, abs=4.0)
    for way in ("to_slave", "to_master"):
        assert told["link"][way]["delay_ms"] == pytest.approx(20.5, abs=4.0)
        assert 0.01 < told["link"][way]["loss"] < 0.3
    assert (told["paths"][0]["remote"], told["paths"][0]["dscp"]) == (address, 46)
    at_rest = document(summary.read_text())
    assert at_rest["position"]["packets"] == at_rest["force"]["packets"] == 0
