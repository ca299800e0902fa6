"""A cell of the stability map: the parameters of a whole system, its limits, and the ideal force of its wall."""

from dataclasses import asdict, dataclass, replace
from math import ceil, sqrt
from typing import Any, Literal

from weberlink.studies.stability.wall import Grip, SampledWall, bisect, bracket, gain_limit, passivity_limit
from weberlink.system.composition.coupling import FIT_MARGIN

DEPTH = 0.015
"""Intended depth of the press [m]."""

COUPLING_N_M = 3000.0 / FIT_MARGIN
"""Stiffness of the robots towards their command [N/m]: their default with the `operator` device of the shipped file."""

CONTACT_LIMIT_N = 10.0
"""Largest force with which a robot should press [N], what the operator can be shown: the default of
`slave.limits.contact_n` with the shipped `master.limits.force_n`."""

SENSOR_RANGE_N = 30.0
"""Range of the force sensor of the computed robots [N], their default `force_n`."""

RobotName = Literal["point", "simulated"]
Contact = Literal["plane", "ball", "box"]


@dataclass(frozen=True)
class SystemCell:
    """A whole system: an operator's hand, a link, a robot and what it touches. The defaults are those of the shipped
    files.

    Args:
        slice: part of the map.
        scheme: of control, as in the configuration.
        predictor: of the force channel.
        position_predictor: of the position channel.
        stiffness_n_m: of the object.
        mass_kg: of device and hand, as the next two; of the arm alone with another grip than firm.
        damping_n_s_m: of device and hand.
        hand_stiffness_n_m: of the hand.
        grip: how the hand holds the device.
        robot: what touches the object.
        robot_mass_kg: of `simulated`.
        robot_damping_n_s_m: of `simulated`; None for critical.
        contact: the object; all are touched from above at z = 0.
        friction: coefficient of the object, static and dynamic.
        wall_damping_n_s_m: of the object.
        wall_speed_m_s: speed at which the object goes up and down; 0 for one at rest.
        rate_hz: of both sides.
        round_trip_s: constant delay, half of it each way.
        jitter_s: largest additional delay each way, uniform.
        loss: share of datagrams lost.
        weber: Weber factor of both channels.
        floor_n: absolute threshold of the force.
        bound_m: position error at rest that stays unsent.
        seed: of the link.
        case: name of an extreme.
    """

    slice: str
    scheme: str = "bounded"
    predictor: str = "hybrid"
    position_predictor: str = "linear"
    stiffness_n_m: float = 500.0
    mass_kg: float = 0.3
    damping_n_s_m: float = 8.0
    hand_stiffness_n_m: float = 300.0
    grip: Grip = "firm"
    robot: RobotName = "point"
    robot_mass_kg: float = 0.2
    robot_damping_n_s_m: float | None = None
    contact: Contact = "plane"
    friction: float = 0.0
    wall_damping_n_s_m: float = 0.0
    wall_speed_m_s: float = 0.0
    rate_hz: float = 1000.0
    round_trip_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    weber: float = 0.1
    floor_n: float = 0.02
    bound_m: float = 0.0002
    seed: int = 0
    case: str = ""

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
    def ideal_n(self) -> float | None:
        """Force of the hold on the ideal local wall of the device [N]; None for a wall that does not rest.

        That is the wall as the robot can display it, rendered at the device without delay: at rest the springs of hand
        and wall share the intended depth.
        """
        if self.wall_speed_m_s:
            return None
        return DEPTH / (1.0 / self.wall.hand.static_stiffness + 1.0 / self.displayed_n_m)

    @property
    def variant(self) -> str:
        """What sets this cell apart in its slice beside scheme, stiffness and round trip, in at most 16 characters."""
        if self.case:
            return self.case
        if self.slice == "walls":
            name = self.robot if self.robot == "point" else weight(self.robot_mass_kg)
            light = " light" if self.robot_damping_n_s_m is not None else ""
            return name + light + (" lossy" if self.loss else "") + (" zoh" if self.predictor == "zoh" else "")
        if self.slice == "hands":
            return self.grip
        if self.slice == "loss":
            return f"jitter {1e3 * self.jitter_s:g} ms"
        if self.slice == "far hands":
            return f"{self.damping_n_s_m:g} Ns/m {self.rate_hz:g} Hz"
        return "uncoded" if self.position_predictor == "zoh" else ""

    def limits(self) -> dict[str, float]:
        """Without coding: stiffness [N/m] up to which the loop is stable with this hand, and passive with any."""
        return {"stable_to_n_m": gain_limit(self.wall), "passive_to_n_m": passivity_limit(self.wall)}

    def least_damping(self) -> float:
        """Without coding: damping of device and hand [N s/m] from which the loop is stable."""

        def is_stable(damping: float) -> bool:
            return gain_limit(replace(self.wall, damping_n_s_m=damping)) > self.stiffness_n_m

        return bisect(is_stable, *bracket(is_stable, self.damping_n_s_m), 1e-3)

    def as_json(self) -> dict[str, Any]:
        return asdict(self) | {"ideal_n": self.ideal_n}


def lightly_damped(mass_kg: float) -> float:
    """A tenth of the critical damping of a robot of this mass [N s/m]."""
    return float(f"{0.2 * sqrt(COUPLING_N_M * mass_kg):.2g}")


def weight(mass_kg: float) -> str:
    return f"{mass_kg:g} kg" if mass_kg >= 1.0 else f"{1e3 * mass_kg:g} g"
