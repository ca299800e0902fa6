"""A live session with a device behind an emulated service: a wall is felt, and a service that dies ends the session."""

import os
import signal
from pathlib import Path
from time import monotonic

import pytest

from tests.apps.emulated import Emulated, norm
from tests.program import Program, document, faults_of
from tests.wait import until
from weberlink.master.devices.inverse3.device import Inverse3Device
from weberlink.master.devices.inverse3.options import Inverse3Options

pytestmark = pytest.mark.realtime

FILE = """
axes: xyz
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: session, silence_ms: 500}}
master:
  device: {{driver: inverse3, port: "{port}", reply_ms: 100, grip: wireless_verse_grip, signs_checked: {checked}}}
  limits: {{device_ms: 500}}
slave:
  robot: {{driver: point, workspace_m: 0.3}}
  scene: [{{shape: plane, point_m: [0, 0, 0], stiffness_n_m: 200}}]
  limits: {{robot_ms: 500}}
"""
PRESS = "handle.script=[{motion: press, at_m: [0, 0, 0], depth_m: 0.04, duration_s: 0.3, approach_s: 0.3, hold_s: 600}]"


def file_for(service: Emulated, folder: Path) -> Path:
    file = folder / "inverse3.yaml"
    checked = Inverse3Device.fingerprint(Inverse3Options())
    file.write_text(FILE.format(port=service.port, checked=checked), encoding="utf-8")
    return file


def test_wall_of_a_session_is_felt_through_the_service(tmp_path: Path) -> None:
    with Emulated("inverse3", tmp_path, PRESS) as service:
        with Program("loopback", file_for(service, tmp_path), "--json", "-") as program:
            program.engaged("master")
            until(lambda: service.status()["force"][2] > 1.0, "a push up out of the floor")
            program.send(signal.SIGINT)
            status, output, errors = program.finish()
        summary = document(output)
        assert status == 0, errors
        assert faults_of(summary) == {"master": {}, "slave": {}}
        assert service.status()["force"] == [0.0, 0.0, 0.0]


@pytest.mark.hunt
@pytest.mark.parametrize(
    ("number", "reason"), [(signal.SIGKILL, "closed the connection"), (signal.SIGSTOP, "no answer within 100 ms")]
)
def test_service_that_stops_ends_the_session_with_reason(tmp_path: Path, number: signal.Signals, reason: str) -> None:
    with (
        Emulated("inverse3", tmp_path, PRESS) as service,
        Program("loopback", file_for(service, tmp_path), "--json", "-") as program,
    ):
        program.engaged("master")
        service.send(number)
        status, output, _ = program.finish()
    summary = document(output)
    assert status == 1
    assert "device fault: inverse3" in summary["outcome"] or "no new position" in summary["outcome"], summary
    assert reason in summary["outcome"]


@pytest.mark.hunt
@pytest.mark.realtime(alone=True)
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_stopped_master_leaves_no_force_in_contact(tmp_path: Path, number: signal.Signals) -> None:
    with (
        Emulated("inverse3", tmp_path, PRESS) as service,
        Program("loopback", file_for(service, tmp_path), "--json", "-") as program,
    ):
        master = program.engaged("master").pid
        until(lambda: service.status()["force"][2] > 1.0, "a push")
        sent_at = monotonic()
        os.kill(master, number)
        ended = until(lambda: norm((seen := service.status())["force"]) == 0.0 and seen["now"], "no force")
        assert ended - sent_at <= 0.1
        if number is signal.SIGSTOP:
            os.kill(master, signal.SIGCONT)
