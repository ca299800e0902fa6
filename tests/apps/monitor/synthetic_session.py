"""A session as the server tells it, made by formulas: a hand circles on a dome of 5 mm on a plane."""

from math import cos, hypot, pi, sin
from typing import Any

from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault

Message = dict[str, Any]

ROWS_PER_S = 250
RADIUS, CENTRE_Z, STIFFNESS, DEPTH = 0.05, -0.045, 500.0, 0.006
WEBER = 0.1
SENT_EVERY = 20
"""Rows between two updates."""
ENGAGED = 4
CHANGES = ["weber", "predictor"]
BANK = ["zoh", "linear", "plane", "sphere"]
SCENE: list[Message] = [
    {"shape": "plane", "point_m": [0, 0, 0], "normal": [0, 0, 1]},
    {"shape": "sphere", "center_m": [0, 0, CENTRE_Z], "radius_m": RADIUS, "inside": False},
]
EVERY_SHAPE: list[Message] = [
    *SCENE,
    {"shape": "sphere", "center_m": [0.03, 0, 0.03], "radius_m": 0.02, "inside": True, "carve": []},
    {
        "shape": "box",
        "center_m": [-0.03, 0, 0],
        "size_m": [0.02, 0.02, 0.02],
        "rotation_deg": [0, 0, 30],
        "inside": False,
    },
    {"shape": "box", "center_m": [0, 0.03, 0], "size_m": [0.02, 0.01, 0.02], "rotation_deg": None, "inside": True},
    {"shape": "height_field", "center_m": [0, 0, 0], "heights_m": [[0, 0.001], [0.002, 0]], "spacing_m": 0.01},
    {"shape": "height_field", "center_m": [0, 0, 0], "heights_m": None, "spacing_m": None},
    {"shape": "plane", "point_m": [0, 0, 0], "normal": [0, 0, 1], "carve": [SCENE[1], SCENE[0]]},
]


def description(side: str, changes: list[str] | None = None) -> Message:
    """Of a daemon."""
    return {
        "side": side,
        "file": "configs/loopback.yaml",
        "pid": 4242,
        "rate_hz": 1000,
        "system": {},
        "bank": BANK,
        "changes": CHANGES if changes is None else changes,
    }


def hello_of_six(**other: Any) -> Message:
    """The greeting of a session with torque and orientation, whose tool is a stick."""
    stick = {"slave": {"robot": {"driver": "point", "tool": {"points_m": [[0.03, 0, 0], [-0.03, 0, 0]]}}}}
    sides = {
        side: description(side) | {"torque_bank": ["zoh", "linear"], "system": stick} for side in ("master", "slave")
    }
    return hello(sides=sides, **other)


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
        "settings": {"weber": WEBER, "predictor": "hybrid"},
        "scheme": "bounded",
        "generation": 0,
        "rate_hz": 1000,
        "states": {str(state.value): state.name.lower() for state in State},
        "faults": {str(fault.value): fault.name.lower() for fault in Fault},
    } | other


def samples(side: str, begin: float, end: float, **other: Any) -> Message:
    """Rows of a side from `begin` to `end` [s]; `other` are columns with one value for all rows."""
    first, last = round(begin * ROWS_PER_S), round(end * ROWS_PER_S)
    rows = [_row(side, k) for k in range(first, last)]
    columns: Message = {name: [row[name] for row in rows] for name in rows[0]}
    for name, values in columns.items():
        if isinstance(values[0], tuple):
            columns[name] = [list(axis) for axis in zip(*values, strict=True)]
    columns |= {name: [value] * len(rows) for name, value in other.items()}
    return {"type": "samples", "side": side, "t": [k / ROWS_PER_S for k in range(first, last)], "columns": columns}


def rotation(side: str, begin: float, end: float) -> Message:
    """Rows of a side in a session of six: a turn of 0.3 rad and a torque of 50 mN m, about y."""
    rows = samples(side, begin, end)
    about_y = [[0.0] * len(rows["t"]), [1.0] * len(rows["t"]), [0.0] * len(rows["t"])]
    turned, torque = ([[size * part for part in axis] for axis in about_y] for size in (0.3, 0.05))
    rows["columns"] |= {
        "rotation_raw": torque if side == "slave" else turned,
        "rotation_output": turned if side == "slave" else torque,
        "rotation_bound": [0.005] * len(rows["t"]),
        "rotation_sent": [int(k % (3 * SENT_EVERY) == 0) for k in range(len(rows["t"]))],
    }
    return rows


def felt(begin: float, end: float, deadbands: float | None = 0.4) -> Message:
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


def _row(side: str, k: int) -> Message:
    t = k / ROWS_PER_S
    angle = pi * t
    reach = RADIUS - DEPTH * (0.6 + 0.4 * sin(2.0 * angle))
    x, y = 0.012 * cos(angle), 0.012 * sin(angle)
    across = hypot(x, y)
    up = (reach * reach - across * across) ** 0.5
    position = (x, y, CENTRE_Z + up)
    force = STIFFNESS * (RADIUS - reach)
    vector = tuple(force * part / reach for part in (x, y, up))
    late = (k // SENT_EVERY) * SENT_EVERY / ROWS_PER_S
    row: Message = {
        "position": position,
        "raw": vector if side == "slave" else position,
        "output": tuple(f * (1.0 + 0.04 * sin(40.0 * (t - late))) for f in vector) if side == "master" else position,
        "bound": WEBER * force,
        "energy": 0.002,
        "surface": (0.0, 0.0, CENTRE_Z),
        "surface_size": RADIUS,
        "surface_stiffness": STIFFNESS,
        "lateness_us": 60.0 + 40.0 * sin(k),
        "work_us": 45.0,
        "rtt_us": 320.0 + 30.0 * sin(0.1 * k),
        "one_way_us": 150.0,
        "ticks_missed": 0,
        "datagrams_sent": 2 * (k // SENT_EVERY),
        "updates_sent": k // SENT_EVERY,
        "state": ENGAGED,
        "fault": 0,
        "sent": int(k % SENT_EVERY == 0),
        "model": 3,
    }
    return row


ARM = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]


def hello_of_arm(**other: Any) -> Message:
    """The greeting of a session of two arms."""
    return hello(axes=ARM, scene=[], predictors=["zoh"], changes=["weber"], **other)


def arm(side: str, begin: float, end: float) -> Message:
    """Rows of an arm: each axis swings, and the follower touches something while it is on one side."""
    rows = samples(side, begin, end)
    for name in ("position", "raw", "output", "bound", "surface", "surface_size", "surface_stiffness", "model"):
        del rows["columns"][name]
    angles = [[0.4 * sin(2.0 * t + axis) for t in rows["t"]] for axis in range(len(ARM))]
    torques = [[max(0.0, 0.5 * angle) for angle in axis] for axis in angles]
    felt = [[0.97 * torque for torque in axis] for axis in torques]
    count = range(round(begin * ROWS_PER_S), round(end * ROWS_PER_S))
    rows["columns"] |= {
        "joint_position": angles if side == "master" else [[angle - 0.01 for angle in axis] for axis in angles],
        "joint_raw": angles if side == "master" else torques,
        "joint_output": felt if side == "master" else angles,
        "gripper_updates_sent": [k // (3 * SENT_EVERY) for k in count],
        "gripper_sent": [int(k % (3 * SENT_EVERY) == 0) for k in count],
    }
    if side == "slave":
        rows["columns"]["joint_bound"] = [[max(0.02, 0.13 * torque) for torque in axis] for axis in torques]
    return rows
