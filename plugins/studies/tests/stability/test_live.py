"""A rigid wall behind a delay, felt through two real processes, against the same system in virtual time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.program import PATIENT, ROOT, Program
from weberlink.system.composition.link import account
from weberlink.telemetry.recording.reader import read_recording
from weberlink_studies.stability.cells import SystemCell
from weberlink_studies.stability.script import timing
from weberlink_studies.stability.study import configuration, judge, overrides
from weberlink_studies.stability.verdict import verdict


@pytest.mark.realtime(alone=True)
@pytest.mark.hunt
def test_a_rigid_wall_is_felt_as_in_virtual_time(tmp_path: Path) -> None:
    """1e5 N/m, 50 ms each way."""
    cell = SystemCell("live", stiffness_n_m=1e5, round_trip_s=0.1)
    when, path = timing(cell), tmp_path / "live.mcap"
    sets = [text for override in overrides(cell, when) for text in ("--set", override)]
    with Program("loopback", ROOT / "configs/loopback.yaml", *sets, *PATIENT, "--record", path) as program:
        code, _, errors = program.finish()
    assert code == 0, errors
    recording = read_recording(path)
    master, slave = (recording.records[side].copy() for side in ("master", "slave"))
    start = master["at"][0]
    slave = slave[np.searchsorted(slave["at"], master["at"]).clip(0, len(slave) - 1)]
    master["at"] -= start
    slave["at"] -= start
    # The script begins when the device opens, up to 0.1 s before the first record.
    bound = account(configuration(cell, when).system)
    live = verdict(cell, replace(when, release=when.release - 0.1), (master, slave), bound)
    virtual = judge(cell)
    assert live["state"] == virtual["state"] == "settled"
    for name in ("felt_share", "pressed_share"):
        assert live[name] == pytest.approx(virtual[name], abs=0.1)
    assert live["felt_share"] > 0.85
    assert live["bound_share"] <= 1.0
