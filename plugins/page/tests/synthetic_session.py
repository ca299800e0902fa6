"""A session as the server tells it, made by formulas: a hand circles on a dome on a plane, and is pushed back."""

from typing import Any

import numpy as np

from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault

Message = dict[str, Any]
ROWS_PER_S = 250
SENT_EVERY = 20
"""Rows between two updates."""
CHANGES = ["weber", "predictor"]
BANK = ["zoh", "linear", "plane", "sphere"]
ARM = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
SCENE: list[Message] = [
    {"shape": "plane", "point_m": [0, 0, 0], "normal": [0, 0, 1]},
    {"shape": "sphere", "center_m": [0, 0, -0.045], "radius_m": 0.05, "inside": False},
]


def description(side: str, changes: list[str] | None = None, **system: Any) -> Message:
    """Of a daemon."""
    told = {"side": side, "file": "configs/loopback.yaml", "pid": 4242, "rate_hz": 1000, "system": system, "bank": BANK}
    torque = {"torque_bank": ["zoh", "linear"]} if system else {}
    return told | torque | {"changes": CHANGES if changes is None else changes}


def hello(**other: Any) -> Message:
    """The greeting; `other` replaces what is said."""
    return {
        "type": "hello",
        "session": "1234",
        "token": None,
        "rooms": {"start": False, "scenes": [], "scene": None},
        "readonly": False,
        "sides": {side: description(side) for side in ("master", "slave")},
        "present": ["master", "slave"],
        "scene": SCENE,
        "changes": CHANGES,
        "predictors": [*BANK, "hybrid"],
        "settings": {"weber": 0.1, "predictor": "hybrid"},
        "scheme": "bounded",
        "generation": 0,
        "rate_hz": 1000,
        "states": {str(state.value): state.name.lower() for state in State},
        "faults": {str(fault.value): fault.name.lower() for fault in Fault},
    } | other


def hello_of_six() -> Message:
    """The greeting of a session with torque and orientation, whose tool is a stick."""
    stick = {"robot": {"driver": "point", "tool": {"points_m": [[0.03, 0, 0], [-0.03, 0, 0]]}}}
    return hello(sides={side: description(side, slave=stick) for side in ("master", "slave")})


def rows_of(side: str, begin: float, end: float) -> tuple[Any, Message]:
    """Times, and the rows of a side without its motion."""
    count = np.arange(round(begin * ROWS_PER_S), round(end * ROWS_PER_S))
    steady = {"energy": 0.002, "work_us": 45.0, "one_way_us": 150.0, "ticks_missed": 0, "state": 4, "fault": 0}
    columns: Message = {name: [value] * len(count) for name, value in steady.items()}
    columns["lateness_us"] = (60.0 + 40.0 * np.sin(count)).tolist()
    columns["rtt_us"] = (320.0 + 30.0 * np.sin(0.1 * count)).tolist()
    columns["datagrams_sent"] = (2 * (count // SENT_EVERY)).tolist()
    columns["updates_sent"] = (count // SENT_EVERY).tolist()
    columns["sent"] = (count % SENT_EVERY == 0).astype(int).tolist()
    t = count / ROWS_PER_S
    return t, {"type": "samples", "side": side, "t": t.tolist(), "columns": columns}


def samples(side: str, begin: float, end: float, *, is_turned: bool = False) -> Message:
    """Rows of a side from `begin` to `end` [s]; a turned one has 0.3 rad and 50 mN m, both about y."""
    t, rows = rows_of(side, begin, end)
    reach = 0.05 - 0.006 * (0.6 + 0.4 * np.sin(2.0 * np.pi * t))
    outwards = np.array([0.24 * np.cos(np.pi * t), 0.24 * np.sin(np.pi * t), np.full(len(t), 0.971)])
    position, force = reach * outwards, 500.0 * (0.05 - reach) * outwards
    position[2] -= 0.045
    felt = force * (1.0 + 0.04 * np.sin(40.0 * t))
    steady = {"surface_size": 0.05, "surface_stiffness": 500.0, "model": 3}
    rows["columns"] |= {name: [value] * len(t) for name, value in steady.items()} | {
        "position": position.tolist(),
        "raw": (force if side == "slave" else position).tolist(),
        "output": (felt if side == "master" else position).tolist(),
        "bound": (0.1 * np.linalg.norm(force, axis=0)).tolist(),
        "surface": [[0.0] * len(t), [0.0] * len(t), [-0.045] * len(t)],
    }
    if is_turned:
        turn, torque = ([[0.0] * len(t), [size] * len(t), [0.0] * len(t)] for size in (0.3, 0.05))
        rows["columns"] |= {
            "rotation_raw": torque if side == "slave" else turn,
            "rotation_output": turn if side == "slave" else torque,
            "rotation_bound": [0.005] * len(t),
            "rotation_sent": rows["columns"]["sent"],
        }
    return rows


def arm(side: str, begin: float, end: float) -> Message:
    """Rows of an arm: each axis swings, and the follower touches something while it is on one side."""
    t, rows = rows_of(side, begin, end)
    angles = np.array([0.4 * np.sin(2.0 * t + axis) for axis in range(len(ARM))])
    torques = np.maximum(0.0, 0.5 * angles)
    rows["columns"] |= {
        "joint_position": angles.tolist(),
        "joint_raw": (angles if side == "master" else torques).tolist(),
        "joint_output": (0.97 * torques if side == "master" else angles).tolist(),
        "gripper_updates_sent": rows["columns"]["updates_sent"],
        "gripper_sent": rows["columns"]["sent"],
    }
    if side == "slave":
        rows["columns"]["joint_bound"] = np.maximum(0.02, 0.13 * torques).tolist()
    return rows


def felt(begin: float, end: float, deadbands: float = 0.4) -> Message:
    """The felt error, constant."""
    t = [k / ROWS_PER_S for k in range(round(begin * ROWS_PER_S), round(end * ROWS_PER_S))]
    columns = {"deadbands": deadbands, "error_n": 0.1, "bound_n": 0.25}
    return {"type": "felt", "t": t} | {name: [value] * len(t) for name, value in columns.items()}


def figures(report: Message, **other: Any) -> Message:
    """All figures so far, as the report has them."""
    return {
        "type": "figures",
        "session": "1234",
        "figures": report,
        "faults": {"master": {}, "slave": {}},
        "faults_now": {"master": None, "slave": None},
        "ended": False,
        "seen_from_start": True,
        "packets_per_s_now": {"force": 12.0, "position": 38.0},
        "reduction_now": {"force": 0.988, "position": 0.962},
    } | other
