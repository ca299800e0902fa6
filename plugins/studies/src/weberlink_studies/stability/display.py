"""What is felt of a scene: whole systems of many scenes, delays, links and hands in virtual time.

The reference of a cell is the force that the same hand feels of the same scene under `none` without delay; the hand
yields to what it feels, so the motions of both differ too.
"""

from functools import lru_cache
from importlib.resources import files
from itertools import product, starmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import load
from weberlink.figures.felt import longest_run
from weberlink.figures.session import Records
from weberlink.session.composition.channels import account
from weberlink_studies.frame import Row
from weberlink_studies.stability.simulated import recorded
from weberlink_studies.stability.verdict import bound_share

Floats = NDArray[np.float64]

PLANE = "slave.scene=[{{shape: plane, stiffness_n_m: {:g}{}}}]"
LIGHT = "slave.robot.driver=simulated"  # 10 g on a spring of 2500 N/m
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "plane": ("scene-plane", (PLANE.format(500, ""),)),
    "damping 1": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 1.0"),)),
    "damping 3": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 3.0"),)),
    "friction": ("scene-plane", (PLANE.format(500, ", friction: {static: 0.3, dynamic: 0.3}"),)),
    "dome": ("loopback", ()),
    "height field": ("scene-height-field", ()),
    "1e4 N/m": ("scene-plane", (PLANE.format(1e4, ""),)),
    "1e5 N/m, light": ("scene-plane", (PLANE.format(1e5, ""), LIGHT)),
    "moving": ("scene-moving", ()),
    "box": ("scene-box", ()),
    "both": ("scene-plane", ()),
    "damped, surface": ("scene-plane", (PLANE.format(500, ", damping_n_s_m: 1.0"), "codec.force.predictor=surface")),
    "both, adaptive": ("scene-plane", ("codec.force.predictor=adaptive",)),
    "dome, zoh": ("loopback", ("codec.force.predictor=zoh",)),
}
"""By name: file of the shipped configurations, and overrides. The last four are tried with few links and hands."""
MAIN = tuple(SCENES)[:10]
HANDS: dict[str, tuple[str, ...]] = {
    "default": (),
    "light": ("master.device.hand={mass_kg: 0.1, damping_n_s_m: 3, stiffness_n_m: 100}",),
    "stiff": ("master.device.hand={mass_kg: 0.5, damping_n_s_m: 15, stiffness_n_m: 800}",),
    "pinch": ("master.device.hand={grasp: pinch}",),
}


class DisplayCell(NamedTuple):
    """One run: scene and hand by name, delay each way [ms]; a lossy link has jitter and loses 5 % in bursts."""

    scene: str
    delay_ms: int
    link: str = "clean"
    hand: str = "default"


def cells() -> list[DisplayCell]:
    """The 156 cells: clean and lossy links, other hands, and the last scenes."""
    touched = ("plane", "friction", "dome", "1e4 N/m")
    return [
        *starmap(DisplayCell, product(MAIN, (0, 5, 10, 20, 50, 100, 250))),
        *starmap(DisplayCell, product(MAIN, (5, 20, 100), ["lossy"])),
        *starmap(DisplayCell, product(touched, (0, 20, 100), ["clean"], tuple(HANDS)[1:])),
        *starmap(DisplayCell, product(tuple(SCENES)[10:], (0, 20, 50, 100, 250))),
    ]


def rows_of(case: tuple[DisplayCell, str]) -> list[Row]:
    """Run a cell with a scheme; an error becomes the `failure` of a row without figures.

    "felt" is the force on the hand, "pressed" that on the robot at the same time. The figures of a row:

        ideal_error_n, error_n  RMS of felt minus reference, and minus pressed, which contains the delay
        shifted_error_n  the least RMS of felt minus pressed over a shift in time
        contacts       begins and ends of the robot's contact
        ghost_s        longest time with more than 1 N felt and nothing pressed
        energy_out_j   largest energy that the hand got out beyond what it gave
        bound_share    largest share of the bound of the account that was got out
        tracking_m     RMS of the robot's command, that of the delay later, minus the hand, from the first second on
        impulse_ratio  integral of felt over that of pressed
        peak_n         largest force pressed
        ripple_n       RMS of felt without its mean over 21 ticks
    """
    cell, scheme = case
    try:
        figures = _measure(cell, scheme)
    except Exception as error:  # one broken cell must not end the study
        figures = {"failure": f"{type(error).__name__}: {error}"}
    return [cell._asdict() | {"scheme": scheme} | figures]


def _measure(cell: DisplayCell, scheme: str) -> Row:
    (master, slave), share, failure = _simulated(cell, scheme)
    felt, pressed = np.asarray(master["output"], np.float64), np.asarray(slave["raw"], np.float64)
    hand, command, delay = master["position"], slave["output"], cell.delay_ms
    sizes, loads = _lengths(felt), _lengths(pressed)
    ideal = _reference(cell.scene, cell.hand)
    both = min(len(felt), len(ideal))
    given = np.concatenate([[0.0], np.cumsum((felt[:-1] * np.diff(hand, axis=0)).sum(axis=1))])
    away = _lengths(command[delay:] - hand[: len(hand) - delay])[1000:]
    away = away[np.isfinite(away)]
    ripple = (sizes - np.convolve(sizes, np.ones(21) / 21.0, "same"))[20:-20]
    return {
        "ideal_error_n": _rms(felt[:both] - ideal[:both]),
        "error_n": _rms(felt - pressed),
        "contacts": int(np.count_nonzero(np.diff(loads > 0.05))),
        "ghost_s": 1e-3 * longest_run((sizes > 1.0) & (loads < 0.05)),
        "energy_out_j": float(given.max()),
        "tracking_m": float(np.sqrt(np.mean(away**2))) if len(away) else None,
        "shifted_error_n": _shifted(felt, pressed, 2 * delay + 60),
        "impulse_ratio": float(sizes.sum() / max(float(loads.sum()), 1e-9)),
        "peak_n": float(loads.max()),
        "ripple_n": float(np.sqrt(np.mean(ripple**2))),
        "bound_share": share,
        "failure": failure,
    }


def _simulated(cell: DisplayCell, scheme: str) -> tuple[tuple[Records, Records], float, str]:
    """Records of both sides, the share of the account's bound, and why a side ended early."""
    (file, more), delay = SCENES[cell.scene], cell.delay_ms
    lossy = cell.link == "lossy"
    faults = f", jitter_ms: {min(5, delay)}, loss: 0.05, burst: 3, seed: 1" if lossy else ", seed: 0"
    silence = max(100, int(5.5 * (delay + (5 if lossy else 0)) + 60))
    longest = max(400, 2 * delay + 100)
    link = [f"emulate={{delay_ms: {delay}{faults}}}", f"silence_ms={silence}", f"longest_round_trip_ms={longest}"]
    overrides = [*(f"link.{each}" for each in link), *more, *HANDS[cell.hand]]
    configuration = load(Path(str(files("weberlink.configs") / f"{file}.yaml")), overrides)
    records, failure = recorded(configuration, scheme, 10.6 + 4e-3 * delay)
    system = configuration.system
    return records, bound_share(records[0], account(system.control, system.master.mapping)), failure


@lru_cache(maxsize=len(SCENES) * len(HANDS))
def _reference(scene: str, hand: str) -> Floats:
    """The force felt under `none` without delay, shape (n, 3) [N]."""
    return np.asarray(_simulated(DisplayCell(scene, 0, hand=hand), "none")[0][0]["output"], np.float64)


def _shifted(felt: Floats, pressed: Floats, span: int) -> float:
    """The least RMS difference over a shift of at most `span` ticks, in about 80 steps."""
    count = len(felt)
    pairs = (
        (felt[max(0, lag) : count + min(0, lag)], pressed[max(0, -lag) : count - max(0, lag)])
        for lag in range(-span, span + 1, max(1, span // 40))
    )
    return min(_rms(ours - theirs) for ours, theirs in pairs)


def _rms(vectors: Floats) -> float:
    return float(np.sqrt(np.mean((vectors * vectors).sum(axis=-1))))


def _lengths(vectors: Any) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))
