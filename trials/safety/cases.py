"""The cases: motion of the operator, fault of the link, predictors and control scheme."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from weberlink.codec.predictors import ADAPTIVE, HYBRID, PREDICTORS

CUT = 0.9  # when the link fails [s]
DARK, LONG_DARK, FLAPPING = 0.6, 4.6, 2.0
"""Length of a cut, of one in which the session expires, and of a time in which the link flaps [s]."""
AFTER = 1.2  # how long the link is good after the fault [s]

MOTIONS = {
    # At full speed through free space when the link fails.
    "free": (
        (-0.055, 0.0, 0.03),
        "[{motion: rest, duration_s: 0.7}, {motion: reach, to_m: [0.055, 0, 0.03], duration_s: 0.35},"
        " {motion: rest, duration_s: 9}]",
    ),
    # On the way into the contact and along the surface when the link fails; afterwards the hand leaves.
    "press": (
        (-0.02, 0.0, 0.02),
        "[{motion: rest, duration_s: 0.7}, {motion: reach, to_m: [0.02, 0, -0.03], duration_s: 0.35},"
        " {motion: rest, duration_s: 0.1}, {motion: reach, to_m: [0.02, 0, 0.03], duration_s: 0.3},"
        " {motion: rest, duration_s: 9}]",
    ),
    # Leaving the contact when the link fails; pressing again when it is good again.
    "away": (
        (0.0, 0.0, 0.02),
        "[{motion: rest, duration_s: 0.1}, {motion: reach, to_m: [0, 0, -0.03], duration_s: 0.3},"
        " {motion: rest, duration_s: 0.4}, {motion: reach, to_m: [0.03, 0, 0.04], duration_s: 0.35},"
        " {motion: reach, to_m: [0, 0, -0.03], duration_s: 0.3},"
        " {motion: rest, duration_s: 9}]",
    ),
}
TO_SLAVE, TO_MASTER, BOTH = DIRECTIONS = ("to slave", "to master", "both ways")
SCHEMES = ("none", "bounded")
FLAPS_HZ = (1.0, 2.0, 5.0, 10.0, 20.0)
ALL_HZ = 5.0  # with all predictors: each cut is as long as the silence limit
ROBOT_N_M = 2500.0
"""Stiffness of the robot towards its command [N/m]; a contact pushes its tip back by force / stiffness."""
DELAYS_S = (0.0, 0.05, 0.15)  # one way [s]
DEFAULT = (HYBRID, "linear")
PREDICTION = (
    *((force, "linear") for force in (*PREDICTORS, HYBRID, ADAPTIVE)),
    *((HYBRID, position) for position in ("zoh", "path", HYBRID, ADAPTIVE)),
)
"""(force, position)."""


@dataclass(frozen=True)
class Case:
    """One run."""

    motion: str  # of `MOTIONS`
    direction: str  # of `DIRECTIONS`, in which datagrams are lost
    scheme: str = "none"  # of control
    force: str = HYBRID  # predictors
    position: str = "linear"
    flap_hz: float = 0.0  # 0 for one cut of `dark` seconds; otherwise the link is cut for half of each period
    dark: float = DARK  # length of the cut [s]
    retract: bool = False  # whether the robot backs off when the session is lost; it holds otherwise
    delay_s: tuple[float, float] = (0.002, 0.002)  # one-way delay of the link to the slave and to the master [s]

    @property
    def fault(self) -> str:
        cut = f"{self.flap_hz:g} Hz" if self.flap_hz else "long cut" if self.dark > DARK else "cut"
        return f"{cut} {self.direction}"

    @property
    def restored(self) -> float:
        """When the link is good again for good [s]."""
        return CUT + (FLAPPING if self.flap_hz else self.dark)

    @property
    def longest_dark(self) -> float:
        """Length of the longest cut [s]."""
        return 0.5 / self.flap_hz if self.flap_hz else self.dark

    @property
    def blackouts(self) -> tuple[tuple[float, float], ...]:
        """Of a direction that is cut: (start, duration) [s]."""
        period, count = (1.0 / self.flap_hz, round(FLAPPING * self.flap_hz)) if self.flap_hz else (0.0, 1)
        return tuple((CUT + number * period, self.longest_dark) for number in range(count))

    @property
    def overrides(self) -> tuple[str, ...]:
        """Of configs/loopback.yaml, as of `--set`."""
        home, script = MOTIONS[self.motion]
        return (
            f"codec.force.predictor={self.force}",
            f"codec.position.predictor={self.position}",
            f"control.scheme={self.scheme}",
            f"master.device.home_m={list(home)}",
            f"master.device.script={script}",
            f"slave.robot.home_m={list(home)}",
            f"slave.robot.stiffness_n_m={ROBOT_N_M}",
            "slave.scene=[{shape: plane, stiffness_n_m: 500}]",
            f"slave.limits.on_silence={'retract' if self.retract else 'hold'}",
        )


def every() -> Iterator[Case]:
    """Cuts and flaps of every frequency with the default predictors, cuts and one frequency with all; and special ones.

    Special are a robot that retracts, a session that ends meanwhile, and a link that is slow in one direction.
    """
    faults = (*product((0.0, ALL_HZ), PREDICTION), *((flap, DEFAULT) for flap in FLAPS_HZ if flap != ALL_HZ))
    for delay, direction, (flap, (force, position)), scheme, motion in product(
        DELAYS_S, DIRECTIONS, faults, SCHEMES, MOTIONS
    ):
        yield Case(motion, direction, scheme, force, position, flap, delay_s=(delay, delay))
    for direction, motion in product(DIRECTIONS, MOTIONS):
        yield Case(motion, direction, retract=True)
        yield Case(motion, direction, dark=LONG_DARK)
        yield Case(motion, direction, delay_s=(0.03, 0.002))
        yield Case(motion, direction, delay_s=(0.002, 0.03))
