"""A session of two arms, made by formulas: what its daemons would record."""

import numpy as np
import yaml

from tests.session.systems import CONFIGS
from weberlink.config import load
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE, Records
from weberlink.telemetry.record import ALL, RECORD
from weberlink.telemetry.row import Row

RATE = 1000.0
NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
AXES = len(NAMES) + 1  # of the joints and the gripper
_CODEC = {
    "joints": {
        "names": list(NAMES),
        "angle": {"bound_rad": 0.005, "predictor": "linear"},
        "torque": {"weber": 0.13, "floor_nm": 0.02, "predictor": "zoh"},
    },
    "gripper": {
        "angle": {"bound_rad": 0.01, "predictor": "linear"},
        "torque": {"weber": 0.13, "floor_nm": 0.02, "predictor": "zoh"},
    },
}
_CARTESIAN = load(CONFIGS / "loopback.yaml").system.model_dump(mode="json")
SYSTEM = _CARTESIAN | {"codec": _CARTESIAN["codec"] | _CODEC, "slave": {"robot": {"driver": "so101_follower"}}}
"""A configuration as daemons and recordings hold it."""
GRIPPER_RAD = (-0.2, 1.8)
FACTS = {
    "lower_rad": f"-2 -2 -2 -2 -2 {GRIPPER_RAD[0]}",
    "upper_rad": f"2 2 2 2 2 {GRIPPER_RAD[1]}",
    "bank": "zoh linear",
    "configuration": yaml.safe_dump(SYSTEM),
    "clock": "real",
}
SENT_EVERY, GRIPPER_SENT_EVERY = 25, 50


def angles(tick: int, lag: int = 0) -> tuple[float, ...]:
    """Angles of all axes [rad]; the follower lags."""
    return tuple(float(0.5 * np.sin(0.002 * (tick - lag) + axis)) for axis in range(AXES))


def torques(tick: int, gain: float = 1.0) -> tuple[float, ...]:
    """Torques of all axes [N m]."""
    return tuple(0.2 * gain * max(0.0, value) for value in angles(tick))


def record(side: str, tick: int, *, began: float = 10.0, lead_from: int = 0) -> Records:
    """The record of a tick, filled as a side fills it."""
    row = Row()
    row.at, row.tick = began + tick / RATE, tick
    row.peer_at = tick / RATE
    row.weber = 0.13
    row.state = State.ENGAGED.value
    row.ramping = int(tick < lead_from)
    row.lateness_us, row.work_us, row.rtt_us, row.one_way_us = 60.0, 80.0, 320.0, 160.0
    row.updates_sent = tick // SENT_EVERY + 1
    row.second_updates_sent = tick // GRIPPER_SENT_EVERY + 1
    row.sent, row.second_sent = int(tick % SENT_EVERY == 0), int(tick % GRIPPER_SENT_EVERY == 0)
    row.datagrams_sent = row.updates_sent
    if side == "master":
        row.position = row.raw = row.coded = row.predicted = angles(tick)
        row.decoded = row.output = torques(tick, 0.95)
    else:
        row.position, row.output = angles(tick, 8), angles(tick, 4)
        row.raw = row.coded = row.predicted = torques(tick)
        row.decoded = torques(tick, 0.95)
    return np.frombuffer(RECORD.pack(*ALL.values(row)), DTYPE)


def records(side: str, ticks: int, **other: float) -> Records:
    return np.concatenate([record(side, tick, **other) for tick in range(ticks)])  # type: ignore[arg-type]
