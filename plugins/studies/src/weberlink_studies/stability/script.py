"""What happens in a cell: the motion of its hand, and the scene that it touches."""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

from weberlink_studies.stability.cells import DEPTH, SystemCell

HEIGHT = 0.01  # start of the hand above the object [m]

SWAY_M = 0.0125  # amplitude of a moving wall [m], slower than the hand's intended depth so that the contact can last

FASTEST_SWAY_HZ = 50.0  # A faster wall has a larger amplitude; also the upper limit of the configuration

Step = dict[str, Any]


@dataclass(frozen=True)
class CellTiming:
    """Times of the script [s]: pauses grow with delay and inertia, the motion is otherwise the same."""

    press: float  # the hand begins to go down for the first time
    hold: float  # its intended position is `DEPTH` from here on
    release: float  # it begins to come up
    end: float
    steps: tuple[Step, ...]  # the motion as a script of the `operator` device


def timing(cell: SystemCell) -> CellTiming:
    """The script of a cell: wait for the session, press, hold, release, tap, wait for the link.

    Other objects than a plane, and friction, are explored before the press instead of tapped after it. The hold lasts
    0.6 s, four round trips and three periods of the hand, so that two windows of it show whether an oscillation dies
    out.
    """
    trip = cell.round_trip_s + 2.0 * cell.jitter_s
    period = 2.0 * pi * sqrt(cell.mass_kg / cell.hand_stiffness_n_m)
    lead = 0.3 + 2.5 * trip + (1.5 if cell.loss else 0.0)
    hold = 0.6 + 4.0 * trip + 3.0 * period
    down = 0.4
    wait: Step = {"motion": "rest", "duration_s": lead}
    if cell.robot == "arm":
        return _arm_timing(1.5 + lead, 1.0 + 4.0 * trip, 0.2 + trip)  # its arms are aligned first
    exploration = _exploration(cell)
    press = {
        "motion": "press", "at_m": [0.0, 0.0, 0.0], "depth_m": DEPTH, "height_m": HEIGHT,
        "duration_s": down, "hold_s": hold, "approach_s": 0.01,
    }  # fmt: skip
    tap = {
        "motion": "tap", "at_m": [0.0, 0.0, 0.0], "depth_m": DEPTH, "height_m": HEIGHT,
        "frequency_hz": 2.0, "count": 1, "approach_s": 0.01,
    }  # fmt: skip
    after = [] if exploration or cell.wall_speed_m_s else [tap]
    first = lead + (0.0 if exploration else 0.01)
    hold_at = sum(map(_length, (wait, *exploration))) + 0.01 + down
    steps = (wait, *exploration, press, *after, {"motion": "rest", "duration_s": 0.2 + trip})
    return CellTiming(first, hold_at, hold_at + hold, sum(map(_length, steps)), steps)


def scene(cell: SystemCell) -> list[dict[str, Any]]:
    """The scene of a cell without joints, as in a configuration file."""
    shapes: dict[str, dict[str, Any]] = {
        "plane": {"shape": "plane"},
        "ball": {"shape": "sphere", "center_m": [0.0, 0.0, -BALL_M], "radius_m": BALL_M},
        "box": {"shape": "box", "center_m": [0.0, 0.0, -EDGE_M], "size_m": [2.0 * EDGE_M] * 3},
    }
    thing = shapes[cell.contact] | {"stiffness_n_m": cell.stiffness_n_m}
    if cell.wall_damping_n_s_m:
        thing["damping_n_s_m"] = cell.wall_damping_n_s_m
    if cell.friction:
        thing["friction"] = {"static": cell.friction, "dynamic": cell.friction}
    if cell.wall_speed_m_s:  # a triangle of 4 f a m/s
        frequency = min(FASTEST_SWAY_HZ, 0.25 * cell.wall_speed_m_s / SWAY_M)
        amplitude = 0.25 * cell.wall_speed_m_s / frequency
        thing["motion"] = {"amplitude_m": amplitude, "frequency_hz": frequency, "wave": "triangle"}
    return [thing]


BALL_M = 0.03  # radius of the ball [m]
EDGE_M = 0.02  # half an edge of the box [m]


def _exploration(cell: SystemCell) -> list[Step]:
    """Over a surface there and back, or off the edge of a box."""
    if cell.contact == "box":
        return [_slide([0.0, 0.3 * EDGE_M], [1.5 * EDGE_M, 0.3 * EDGE_M], 1), _reach(0.0)]
    if cell.robot == "tool":
        return [{"motion": "turn", "turn_deg": [0.0, 10.0, 0.0], "duration_s": 0.8}]
    if cell.contact == "ball" or cell.friction:
        return [_slide([-0.5 * BALL_M, 0.0], [0.5 * BALL_M, 0.0], 2), _reach(0.0)]
    return []


def _arm_timing(lead: float, hold: float, after: float) -> CellTiming:
    """An arm presses a table, holds, and comes back. The motion of the arm lags: the contact is made within 0.6 s."""
    home, low = [0.0, 0.018, -0.214, 1.597, 0.0], [0.0, 0.06, 0.335, 1.005, 0.0]
    steps = (
        {"motion": "hold", "duration_s": lead},
        {"motion": "move", "duration_s": 1.0, "joints_rad": low},
        {"motion": "hold", "duration_s": 0.6 + hold},
        {"motion": "move", "duration_s": 0.7, "joints_rad": home},
        {"motion": "hold", "duration_s": after},
    )
    return CellTiming(lead, lead + 1.6, lead + 1.6 + hold, lead + 2.3 + hold + after, steps)


def _slide(begin: list[float], end: list[float], passes: int) -> Step:
    points = [[*begin, 0.0], [*end, 0.0]]
    return {"motion": "slide", "points_m": points, "depth_m": DEPTH, "duration_s": 0.8, "passes": passes,
            "approach_s": 0.4}  # fmt: skip


def _reach(x: float) -> Step:
    return {"motion": "reach", "to_m": [x, 0.0, HEIGHT], "duration_s": 0.6}


def _length(step: Step) -> float:
    """Duration of a step [s]."""
    if step["motion"] == "press":
        return float(step["approach_s"] + 2.0 * step["duration_s"] + step["hold_s"])
    if step["motion"] == "tap":
        return float(step["approach_s"] + step["count"] / step["frequency_hz"])
    if step["motion"] == "slide":
        return float(step["approach_s"] + step["passes"] * step["duration_s"])
    return float(step["duration_s"])
