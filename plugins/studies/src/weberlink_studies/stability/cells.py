"""A cell of the stability map: the parameters of a whole system, its limits, and the ideal force of its wall."""

from dataclasses import dataclass
from itertools import product
from math import ceil
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
    def torque(self) -> str:
        """Prefix of the fields of the records by whose torque the cell is judged; empty where it is a force."""
        return {"tool": "rotation_", "arm": "joint_"}.get(self.robot, "")

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
        if self.wall_speed_m_s or self.torque:
            return None
        return DEPTH / (1.0 / self.wall.hand.static_stiffness + 1.0 / self.displayed_n_m)

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
