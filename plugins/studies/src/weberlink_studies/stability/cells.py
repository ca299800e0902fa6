"""A cell of the stability map: its whole system, its limits, the motion of its hand and the scene that it touches."""

from dataclasses import dataclass
from itertools import product
from math import ceil, pi, sqrt
from typing import Any, Literal

from weberlink.session.composition.coupling import FIT_MARGIN
from weberlink_studies.stability.wall import Grip, SampledWall, gain_limit, passivity_limit

DEPTH = 0.015  # intended depth of the press [m]
COUPLING_N_M = 3000.0 / FIT_MARGIN
"""Stiffness of the robots towards their command [N/m]: their default with the `operator` device of the shipped file."""

CONTACT_LIMIT_N = 10.0
"""Largest force with which a robot should press [N], what the operator can be shown: the default of
`slave.limits.contact_n` with the shipped `master.limits.force_n`."""

SENSOR_RANGE_N = 30.0  # range of the force sensor of the computed robots [N], their default `force_n`

RobotName = Literal["point", "simulated", "tool", "arm"]
"""The last two are judged by torque: a stick with three points of contact, and an arm of joints (extra: mujoco)."""
Contact = Literal["plane", "ball", "box"]


@dataclass(frozen=True)
class SystemCell:
    """A whole system: an operator's hand, a link, a robot and what it touches. The defaults are those of the shipped
    files.
    """

    family: str  # row of the map, or `extremes`
    scheme: str = "bounded"  # of control, as in the configuration
    predictor: str = "hybrid"  # of the force channel
    position_predictor: str = "linear"  # of the position channel
    stiffness_n_m: float = 500.0  # of the object; of the joints with `arm` [N m/rad]
    mass_kg: float = 0.3  # of device and hand, as the next two; of the arm alone with another grip than firm
    damping_n_s_m: float = 8.0  # of device and hand
    hand_stiffness_n_m: float = 300.0  # of the hand
    grip: Grip = "firm"  # how the hand holds the device
    robot: RobotName = "point"  # what touches the object; `tool` is turned by 10 degrees
    robot_mass_kg: float = 0.2  # of `simulated`
    robot_damping_n_s_m: float | None = None  # of `simulated`; None for critical
    contact: Contact = "plane"  # the object; all are touched from above at z = 0
    friction: float = 0.0  # coefficient of the object, static and dynamic
    wall_damping_n_s_m: float = 0.0  # of the object
    wall_speed_m_s: float = 0.0  # speed at which the object goes up and down; 0 for one at rest
    rate_hz: float = 1000.0  # of both sides
    round_trip_s: float = 0.0  # constant delay, half of it each way
    jitter_s: float = 0.0  # largest additional delay each way, uniform
    loss: float = 0.0  # share of datagrams lost
    weber: float = 0.1  # Weber factor of both channels
    floor_n: float = 0.02  # absolute threshold of the force
    bound_m: float = 0.0002  # position error at rest that stays unsent
    seed: int = 0  # of the link
    case: str = ""  # name of an extreme

    @property
    def wall(self) -> SampledWall:
        """The sampled wall that corresponds to this cell without coding and loss."""
        one_way = ceil(0.5 * self.round_trip_s * self.rate_hz - 1e-9)
        return SampledWall(
            self.mass_kg,
            self.damping_n_s_m,
            self.hand_stiffness_n_m,
            1.0 / self.rate_hz,
            one_way + max(1, one_way),  # a force received within a tick is applied in the next one
            grip=self.grip,
        )

    @property
    def displayed_n_m(self) -> float:
        """Stiffness of the wall as the robot displays it [N/m]: no stiffer than its coupling, or in series with it."""
        wall, robot = self.stiffness_n_m, COUPLING_N_M
        return min(wall, robot) if self.robot == "point" else wall * robot / (wall + robot)

    @property
    def by_torque(self) -> bool:
        """Whether the cell is judged by a torque, not by a force."""
        return self.robot in ("tool", "arm")

    @property
    def floor(self) -> float:
        """Absolute threshold of the force or torque that is felt [N], [N m]."""
        return {"tool": 0.005, "arm": 0.03}.get(self.robot, self.floor_n)

    @property
    def ideal_n(self) -> float | None:
        """Force of the hold on the ideal local wall of the device [N]; None where that is not a force, or not at rest.

        That is the wall as the robot can display it, rendered at the device without delay: at rest the springs of hand
        and wall share the intended depth.
        """
        if self.wall_speed_m_s or self.by_torque:
            return None
        hand = self.wall.hand
        held = 0.0 if hand.held is None else 1.0 / hand.held.stiffness_n_m
        return DEPTH / (1.0 / hand.stiffness_n_m + held + 1.0 / self.displayed_n_m)

    def limits(self) -> dict[str, float]:
        """Without coding: stiffness [N/m] up to which the loop is stable with this hand, and passive with any."""
        return {"stable_to_n_m": gain_limit(self.wall), "passive_to_n_m": passivity_limit(self.wall)}


FAMILIES: dict[str, dict[str, Any]] = {
    "plane": {},
    "damping 1 N s/m": {"wall_damping_n_s_m": 1.0, "predictor": "surface"},
    "friction 0.3": {"friction": 0.3, "predictor": "surface"},
    "both": {"friction": 0.3, "wall_damping_n_s_m": 1.0},
    "ball": {"contact": "ball", "predictor": "surface"},
    "box, edge": {"contact": "box", "predictor": "surface"},
    "wall at 0.1 m/s": {"wall_speed_m_s": 0.1, "predictor": "surface"},
    "30 % lost, jitter": {"jitter_s": 0.01, "loss": 0.3},
    "fingertip grip": {"grip": "fingertip"},
    "robot of 5 g": {"robot": "simulated", "robot_mass_kg": 0.005},
    "robot of 1 kg": {"robot": "simulated", "robot_mass_kg": 1.0},
    "rotation: torque": {"robot": "tool"},
    "joints: torque": {"robot": "arm"},
}
"""Rows of the map. Friction and motion of an object are in the models of the predictor `surface` alone."""

SCHEMES = ("none", "bounded", "baseline-tdpa")
STIFFNESSES = {"arm": (30.0, 100.0)}
"""Of the map: of the arm's joints [N m/rad]; 500 and 1e7 N/m of an object elsewhere."""
FULL_STIFFNESSES = {"arm": (10.0, 30.0, 100.0, 300.0, 1000.0)}
TRIPS, FULL_TRIPS = (0.0, 0.02, 0.1, 0.5), (0.0, 0.002, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Round trips [s]."""

FAR: dict[str, Any] = {"round_trip_s": 0.1}
EXTREMES: dict[str, dict[str, Any]] = {
    "hand 1 mg": {"mass_kg": 1e-6} | FAR,
    "hand 1 t": {"mass_kg": 1e3} | FAR,
    "hand 1e6 N s/m": {"damping_n_s_m": 1e6} | FAR,
    "robot 1 mg": {"robot": "simulated", "robot_mass_kg": 1e-6, "stiffness_n_m": 1e7} | FAR,
    "robot 1 t": {"robot": "simulated", "robot_mass_kg": 1e3, "stiffness_n_m": 1e7} | FAR,
    "robot 1e6 N s/m": {"robot": "simulated", "robot_damping_n_s_m": 1e6} | FAR,
    "wall 1e-3 N/m": {"stiffness_n_m": 1e-3} | FAR,
    "wall 1e9 N/m": {"stiffness_n_m": 1e9} | FAR,
    "10 Hz": {"rate_hz": 10.0, "stiffness_n_m": 1e4} | FAR,
    "10 kHz": {"rate_hz": 1e4, "stiffness_n_m": 1e7} | FAR,
    "wall at 5 m/s": {"wall_speed_m_s": 5.0} | FAR,
    "2 s, 30 % lost": {"round_trip_s": 2.0, "jitter_s": 0.1, "loss": 0.3, "stiffness_n_m": 1e7},
}
"""One parameter at the end of its range each. Delay makes each of them harder."""


def cells(seed: int, *, full: bool) -> list[SystemCell]:
    """All cells: every family with every scheme, then the extremes."""
    known, usual = (FULL_STIFFNESSES, (100.0, 500.0, 1e3, 1e4, 1e5, 1e7)) if full else (STIFFNESSES, (500.0, 1e7))
    mapped = [
        SystemCell(name, scheme, stiffness_n_m=stiffness, round_trip_s=trip, seed=seed, **family)
        for name, family in FAMILIES.items()
        for scheme in SCHEMES
        for stiffness in known.get(family.get("robot", ""), usual)
        for trip in (FULL_TRIPS if full else TRIPS)
    ]
    schemes = SCHEMES if full else ("bounded",)
    extremes = product(EXTREMES.items(), schemes)
    return mapped + [SystemCell("extremes", scheme, case=c, seed=seed, **more) for (c, more), scheme in extremes]


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
