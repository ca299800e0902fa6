"""doctor --link against a waiting slave: two processes, sockets, and a link with known faults."""

import json
import subprocess
import sys
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket

import pytest

from tests.system.systems import CONFIGS
from tests.wait import until

pytestmark = pytest.mark.realtime
PROGRAM = (sys.executable, "-m", "weberlink")
FAULTS = ("link.emulate={delay_ms: 20, loss: 0.1, burst: 3}", "link.silence_ms=2000", "control.scheme=none")


def free_port() -> int:
    with socket(AF_INET, SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def test_waiting_slave_is_measured_and_stays_at_rest(tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    settings = [f"link.listen={address}", f"link.slave={address}", *FAULTS]
    common = [str(CONFIGS / "loopback.yaml"), *(word for each in settings for word in ("--set", each))]
    summary = tmp_path / "slave.json"
    slave = subprocess.Popen([*PROGRAM, "slave", *common, "--json", str(summary)], stdout=subprocess.DEVNULL)
    try:
        until(lambda: _is_bound(address), "the slave to listen")
        doctor = [*PROGRAM, "doctor", *common, "--link", address, "--duration", "2", "--json", "-"]
        found = subprocess.run(doctor, capture_output=True, text=True, check=False, timeout=60)
    finally:
        slave.terminate()
        slave.wait(30)
    document = json.loads(found.stdout)
    link = document["link"]
    assert link["rtt_ms"]["min"] == pytest.approx(41.0, abs=4.0)
    for way in ("to_slave", "to_master"):
        assert link[way]["delay_ms"] == pytest.approx(20.5, abs=4.0)
        assert 0.01 < link[way]["loss"] < 0.3
        assert link[way]["burst"] > 1.3
    assert document["paths"][0]["remote"] == address
    assert document["paths"][0]["dscp"] == 46
    (told,) = (each for each in document["findings"] if each["check"] == "control scheme")
    assert told["fix"] == "--set control.scheme=bounded"
    at_rest = json.loads(summary.read_text())
    assert at_rest["position"]["packets"] == at_rest["force"]["packets"] == 0


def _is_bound(address: str) -> bool:
    """Whether somebody holds the port."""
    host, port = address.split(":")
    with socket(AF_INET, SOCK_DGRAM) as probe:
        try:
            probe.bind((host, int(port)))
        except OSError:
            return True
    return False
