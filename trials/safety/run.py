"""Cases (motion of the operator, fault of the link, predictors, scheme): run one, measure it, and check the laws."""

import json
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import accumulate, product
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.program import ENGAGED, Records
from tests.safety.observed_link import ObservedLink, agreed_by, observed
from tests.session.systems import configuration
from weberlink.codec.choice import CHOICES, HYBRID
from weberlink.codec.predictors import PREDICTORS, suits
from weberlink.config import Configuration
from weberlink.protocol.emulation import Emulation
from weberlink.session.simulation import as_array
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import FORCE

CUT = 0.9  # when the link fails [s]
DARK, LONG_DARK, FLAPPING = 0.6, 4.6, 2.0
"""Length of a cut, of one in which the session expires, and of a time in which the link flaps [s]."""
AFTER = 1.2  # how long the link is good after the fault [s]

Step = tuple[float] | tuple[float, float, float, float]
MOTIONS: dict[str, tuple[tuple[float, float, float], tuple[Step, ...]]] = {
    # At full speed through free space when the link fails.
    "free": ((-0.055, 0.0, 0.03), ((0.7,), (0.35, 0.055, 0.0, 0.03), (9.0,))),
    # On the way into the contact and along the surface when the link fails; afterwards the hand leaves.
    "press": ((-0.02, 0.0, 0.02), ((0.7,), (0.35, 0.02, 0.0, -0.03), (0.1,), (0.3, 0.02, 0.0, 0.03), (9.0,))),
    # Leaving the contact when the link fails; pressing again when it is good again.
    "away": (
        (0.0, 0.0, 0.02),
        ((0.1,), (0.3, 0.0, 0.0, -0.03), (0.4,), (0.35, 0.03, 0.0, 0.04), (0.3, 0.0, 0.0, -0.03), (9.0,)),
    ),
}
"""Home [m], and steps of the hand: how long it takes [s], and where it reaches [m] unless it rests."""
TO_SLAVE, TO_MASTER, BOTH = DIRECTIONS = ("to slave", "to master", "both ways")
SCHEMES = ("none", "bounded")
FLAPS_HZ = (1.0, 2.0, 5.0, 10.0, 20.0)
ALL_HZ = 5.0  # with all predictors: each cut is as long as the silence limit
ROBOT_N_M = 2500.0  # stiffness towards its command [N/m]; a contact pushes its tip back by force / stiffness
DELAYS_S = (0.0, 0.05, 0.15)  # one way [s]
DEFAULT = (HYBRID, "linear")
POSITIONS = (*(name for name in PREDICTORS if name != "linear" and suits(name, "position")), *CHOICES)
PREDICTION = (
    *((force, "linear") for force in (*PREDICTORS, *CHOICES)),
    *((HYBRID, position) for position in POSITIONS),
)
"""(force, position)."""


@dataclass(frozen=True)
class Case:
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
        return CUT + (FLAPPING if self.flap_hz else self.dark)

    @property
    def longest_dark(self) -> float:
        return 0.5 / self.flap_hz if self.flap_hz else self.dark

    @property
    def blackouts(self) -> tuple[tuple[float, float], ...]:
        """Of a direction that is cut: (start, duration) [s]."""
        period, count = (1.0 / self.flap_hz, round(FLAPPING * self.flap_hz)) if self.flap_hz else (0.0, 1)
        return tuple((CUT + number * period, self.longest_dark) for number in range(count))

    @property
    def overrides(self) -> tuple[str, ...]:
        home, steps = MOTIONS[self.motion]
        script = [
            {"duration_s": seconds} | ({"motion": "reach", "to_m": to} if to else {"motion": "rest"})
            for seconds, *to in steps
        ]
        return (
            f"codec.force.predictor={self.force}",
            f"codec.position.predictor={self.position}",
            f"control.scheme={self.scheme}",
            f"master.device.home_m={list(home)}",
            f"master.device.script={json.dumps(script)}",
            f"slave.robot.home_m={list(home)}",
            f"slave.robot.stiffness_n_m={ROBOT_N_M}",
            "slave.scene=[{shape: plane, stiffness_n_m: 500}]",
            f"slave.limits.on_silence={'retract' if self.retract else 'hold'}",
        )


def every() -> Iterator[Case]:
    """Cuts and flaps of every frequency with the default predictors, cuts and one frequency with all; special ones."""
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


STILL = 1e-9  # smaller steps [m] and forces [N] count as none
WALL_M_S = 1.0  # the force may change as fast as on the device's stiffest wall, touched at this speed [m/s]
BACK_S = 0.5  # after the link is good again, and two round trips: both ends engage and the force fades in [s]
CODING_M = 0.5e-3  # what the coding of a position may be off, twice: its deadband at rest and a step of the wire [m]


@dataclass(frozen=True)
class Run:
    """A case, its figures (none if a side raised an error), and the laws that it broke."""

    case: Case
    figures: dict[str, Any]
    violations: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        return {"fault": self.case.fault, **asdict(self.case), **self.figures, "violations": self.violations}


def run(case: Case) -> Run:
    loaded = configuration(*case.overrides)
    ways = [
        ObservedLink(Emulation(delay_s=delay, blackouts=case.blackouts if case.direction in (way, BOTH) else ()))
        for way, delay in zip((TO_SLAVE, TO_MASTER), case.delay_s, strict=True)
    ]
    simulated = observed(loaded, *ways)
    ticks = round((case.restored + AFTER + 4.0 * sum(case.delay_s)) / loaded.system.tick_period)
    records, agreed = [], 0.0
    try:
        for number in range(ticks):
            records.append(simulated.step())
            if number * loaded.system.tick_period < case.restored:
                agreed = max(agreed, agreed_by(simulated))
    except Exception as error:
        return Run(case, {}, (f"a loop ended with {type(error).__name__}: {error}",))
    masters, slaves = zip(*records, strict=True)
    figures = measure(case, as_array(masters), as_array(slaves), ways, agreed, loaded)
    return Run(case, figures, tuple(violated(case, figures, loaded)))


def measure(
    case: Case, master: Records, slave: Records, ways: list[ObservedLink], agreed: float, loaded: Configuration
) -> dict[str, Any]:
    at, limit, tick = master["at"], loaded.system.link.silence_ms * 1e-3 + agreed, loaded.system.tick_period
    failing = (at >= CUT) & (at < case.restored)
    shown, reached, place = master["output"][:, FORCE], slave["output"][:, FORCE], master["position"][:, FORCE]
    force, moved, went = np.linalg.norm(shown, axis=1), _steps(reached), _steps(place)
    alone = failing & (slave["state"] != ENGAGED)
    moving = failing & (moved > STILL) & ~(alone & case.retract)  # how it backs off is measured apart
    felt = failing & (force > STILL)
    after = (at >= case.restored - tick) & (at < case.restored + BACK_S + 2.0 * sum(case.delay_s))
    back = after & (master["state"] == ENGAGED)
    before = (at > CUT - limit) & (at < CUT + limit)
    retreat = np.diff(reached[alone], axis=0) if alone.any() and not case.flap_hz else np.zeros((0, 3))
    pressed = float(slave["raw"][alone][0, 2]) / ROBOT_N_M if len(retreat) else 0.0
    envelope = loaded.system.master.limits.force_n / (loaded.system.master.limits.ramp_ms * 1e-3)
    named = [failing & (side["fault"] != Fault.NONE) for side in (master, slave)]
    return {
        # From the cut to the last tick in which the robot was still commanded to move, and with a force on the hand.
        "robot_ms": None if case.flap_hz else 1e3 * float((at[moving] - CUT).max(initial=0.0)),
        "force_ms": None if case.flap_hz else 1e3 * float((at[felt] - CUT).max(initial=0.0)),
        # The largest true age of the loop in such a tick.
        "robot_age_ms": 1e3 * float(loop_ages(ways[1], ways[0], at)[moving].max(initial=0.0)),
        "force_age_ms": 1e3 * float(loop_ages(ways[0], ways[1], at)[felt].max(initial=0.0)),
        # How far the robot was from the nearest place where the hand had been by then, and the hand moves within
        # the limit at its largest speed before the cut.
        "beyond_mm": 1e3 * _beyond(place, reached, np.flatnonzero(failing)),
        "allowed_mm": 1e3 * float(went[before].max()) / tick * limit,
        # How far the robot was sent up from where its tip was without a session, and how far otherwise.
        "backed_mm": 1e3 * (float(retreat[:, 2].sum()) - pressed),
        "astray_mm": 1e3 * float(np.abs(retreat[:, :2]).sum() - np.minimum(retreat[:, 2], 0.0).sum()),
        "hand_n": float(force[at >= CUT].max()),
        "robot_n": float(np.linalg.norm(slave["raw"][failing, FORCE], axis=1).max()),
        "step_n": float(_steps(shown[at >= CUT]).max()),  # in a tick, from the cut on
        # Once the link is good: above an even rise of the force; of the robot in a tick, beyond the hand.
        "early_n": float((force[back] - envelope * (at[back] - at[back][:1] + tick)).max(initial=0.0)),
        "step_mm": 1e3 * max(0.0, float(moved[after][1:].max() - went[after].max())),
        "fault_ms": [1e3 * float(at[when][0] - CUT) if when.any() else None for when in named],  # from the cut
        "faults": [
            sorted(Fault(value).name for value in set(side["fault"][when].tolist()))
            for side, when in zip((master, slave), named, strict=True)
        ],
        "returned": bool(master["state"][-1] == slave["state"][-1] == ENGAGED),
        # The age and the time after a cut may exceed the silence limit by this, agreed until the link was good again.
        "round_trip_ms": 1e3 * agreed,
    }


def violated(case: Case, figures: dict[str, Any], loaded: Configuration) -> list[str]:
    system, limits, coding_mm = loaded.system, loaded.system.master.limits, 1e3 * CODING_M
    limit_ms, tick = system.link.silence_ms + figures["round_trip_ms"], system.tick_period
    within = limit_ms + 1e3 * tick + 0.01
    assert loaded.device is not None
    wall_n = loaded.device.options.stiffness_n_m * WALL_M_S * tick  # type: ignore[attr-defined]
    is_silent = case.longest_dark > 1e-3 * limit_ms + sum(case.delay_s)  # cut for longer than the limits
    is_one_cut = is_silent and not case.flap_hz
    approach_mm = 1e3 * system.slave.limits.approach_speed_m_s * tick + coding_mm
    backs_off = is_silent and case.retract
    laws = (
        ("the robot moved at a loop age of [ms]", figures["robot_age_ms"], within, True),
        ("force was on the hand at a loop age of [ms]", figures["force_age_ms"], within, True),
        ("the robot moved after the cut for [ms]", figures["robot_ms"] or 0.0, within, True),
        ("force was on the hand after the cut for [ms]", figures["force_ms"] or 0.0, within, True),
        ("the robot went beyond the hand [mm]", figures["beyond_mm"], figures["allowed_mm"] + coding_mm, True),
        ("force on the hand [N]", figures["hand_n"], limits.force_n * (1.0 + 1e-9), True),
        ("change of the force in a tick [N]", figures["step_n"], wall_n * (1.0 + 1e-9), True),
        ("without a session at the end", float(not figures["returned"]), 0.0, True),
        ("the force came back above its ramp [N]", figures["early_n"], STILL, is_one_cut),
        ("the robot came back in a tick by [mm]", figures["step_mm"], approach_mm, is_one_cut),
        ("the robot backed off [mm]", figures["backed_mm"], 1e3 * system.slave.limits.retract_m + 0.1, backs_off),
        ("the robot moved otherwise [mm]", figures["astray_mm"], coding_mm, backs_off),
        *(
            (f"the {side} names a fault after [ms]", inf if first is None else first, within, not case.flap_hz)
            if is_one_cut
            else (f"the {side} names no fault", float(first is None), 0.0, is_silent)
            for side, first in zip(("master", "slave"), figures["fault_ms"], strict=True)
        ),
    )
    return [f"{law}: {figure:.4g}, {most:.4g} allowed" for law, figure, most, holds in laws if holds and figure > most]


def loop_ages(outward: ObservedLink, inward: ObservedLink, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Time since the departure of the newest datagram that the peer is known to have received [s], at one end."""
    outward_at = [arrival for arrival, _ in outward.arrivals]
    newest = [-inf, *accumulate((departure for _, departure in outward.arrivals), max)]
    confirmed = [newest[bisect_right(outward_at, departure)] for _, departure in inward.arrivals]
    best = np.array([-inf, *accumulate(confirmed, max)])
    told_at = np.array([arrival for arrival, _ in inward.arrivals])
    ages: NDArray[np.float64] = times - best[np.searchsorted(told_at, times, side="right")]
    return ages


def _steps(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far it went in each tick, shape (n,)."""
    steps: NDArray[np.float64] = np.linalg.norm(np.diff(values, axis=0, prepend=values[:1]), axis=1)
    return steps


def _beyond(hand: NDArray[np.float64], robot: NDArray[np.float64], ticks: NDArray[np.int64]) -> float:
    """Largest distance of the robot, at these ticks, from the nearest place where the hand had been by then [m]."""
    farthest = 0.0
    where: NDArray[np.float64] | None = None
    for tick in ticks[::5]:
        if where is None or np.any(robot[tick] != where):
            where = robot[tick]
            farthest = max(farthest, float(np.min(np.linalg.norm(hand[: tick + 1] - where, axis=1))))
    return farthest
