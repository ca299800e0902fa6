"""Verdict on a cell from the telemetry of both sides: settled or not, force felt and pressed, energy."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weberlink.config.model import System
from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FINITE, FORCE, TORQUE
from weberlink_figures.channel import in_session
from weberlink_figures.energy import EnergyBound, PortWork, accounts_in
from weberlink_studies.frame import Row
from weberlink_studies.stability.cells import CONTACT_LIMIT_N, SENSOR_RANGE_N, CellTiming, SystemCell

Floats = NDArray[np.float64]
Phase = Literal["settled", "decaying", "lost", "oscillating", "growing", "driven", "failed", "refused"]

CALM = ("settled", "decaying", "driven")

SHARE = 0.05  # swing of a steady force, as a share of it, beside that of the deadband
DECAYING, GROWING = 0.9, 1.5
"""Ratios of the later to the earlier variance below which an oscillation decays and above which it grows."""

FAINTEST_N = 0.02  # force below which there is no contact, where the cell has no threshold of its own
AT_LIMIT = 0.999  # share of a limit from which on a force counts as limited


def verdict(
    cell: SystemCell,
    when: CellTiming,
    records: tuple[Records, Records],
    accounts: Sequence[AccountParameters],
    failure: str | None = None,
) -> Row:
    """Judge a finished run. Both sides tick at the same times, as in virtual time.

    `state` judges the force (or torque) on the operator during the hold, without its first 0.3 s and one round trip;
    the rest is halved. The swing (largest minus smallest) of a steady force is at most two deadbands and 5 %. In the
    second half:

        settled      the swing is not larger
        decaying     it is larger, but smaller than in the first half, with 10 % less variance and no limited force
        lost         either of these, but the operator felt nothing for at least one tick of the two halves
        growing      it is larger, and its variance is above 1.5 times that of the first half
        oscillating  none of these: a limit cycle, to which the force limiter turns every growing oscillation
        driven       the wall moves, so the force cannot be steady
        failed       a fault, no session during the hold, a value that is not finite, or the cell could not run
        refused      the configuration is out of range

    A cell is `bounded` if it is settled, decaying or driven. A cell at its limit may be judged either way. A heavy hand
    that still bounces off the force limiter in the second half counts as oscillating.

    Figures that do not apply are left out:

        energy_out_j      largest energy that the operator got out of the port since the press began, beyond what was
                          paid in since
        bound_share       largest share of the bound of the account that was got out; above 1 it is not kept
        link_generated_j  largest energy that came out of the two ports together beyond what went in, while both sides
                          were engaged and neither was in a ramp: of device, link and control, without the wall
        peak_force_n, peak_contact_n  largest force on the operator, and on the robot
        swing_n, steady_force_n, wall_force_n  swing and mean force on the operator, mean force on the robot, along z
        felt              `felt_share`; `impulse_ratio` of a moving wall and of torques, which have none
        felt_share, pressed_share  these means over the force on the ideal local wall
        saturated         limits met in either half: the operator's force limiter, the sensor's range, the press limit
        settle_s          time from the press until the force stays within the larger of the deadband and 5 % about its
                          mean; left out if it does so for less than the last tenth of the hold
        impulse_ratio     integral of |force on the operator| over that of |force on the robot|, from the press to the
                          end of the run. All contacts begin and end within it on both sides, so none is shifted in
                          time, whatever the delay
        tangential_ratio  the same of the horizontal components, for a plane with friction
        drift_m           distance of the robot's command from the hand in the last 0.1 s, at rest
        force_reduction   reduction of force updates relative to one per tick
    """
    master, slave = records
    axes = {"tool": TORQUE, "arm": slice(None)}.get(cell.robot, FORCE)
    output, raw = master["output"][:, axes], slave["raw"][:, axes]
    at = master["at"]
    felt, wall = (_lengths(each) if cell.by_torque else each[:, 2] for each in (output, raw))
    begin = when.hold + 0.3 + cell.round_trip_s
    middle = 0.5 * (begin + when.release)
    early, late = (at >= begin) & (at < middle), (at >= middle) & (at < when.release)
    failure = failure or _failure(master, slave, master[(at >= when.press) & (at < when.release)])
    if failure or not (early.any() and late.any()):
        return {"state": "failed", "bounded": False, "failure": failure or "the hold is shorter than two ticks"}
    holding, pressing = early | late, at >= when.press
    steady, pressed = float(felt[late].mean()), float(wall[late].mean())
    band = max(cell.weber * abs(steady), cell.floor, SHARE * abs(steady))
    out, made = _energy(master, slave, pressing)
    ideal = cell.ideal_n if cell.ideal_n is not None and cell.ideal_n >= FAINTEST_N else None
    state = _state(cell, felt[early], felt[late], steady, clipped=bool(master["clipped"][late].any()))
    impulses = _lengths(output[pressing]), _lengths(raw[pressing])
    share = bound_share(master, accounts)
    largest, last = float(_lengths(slave["raw"][holding, FORCE]).max()), at > at[-1] - 0.1
    ticks = int((slave["state"] == State.ENGAGED.value).sum())
    met = {
        "operator": bool(master["clipped"][holding].any()),
        "sensor": largest >= AT_LIMIT * SENSOR_RANGE_N,
        "contact": largest >= AT_LIMIT * CONTACT_LIMIT_N,
    }
    apart = _lengths(slave["output"][last, FORCE] - master["position"][last, FORCE])
    drift = None if cell.robot == "arm" else float(apart.mean())
    row = {
        "state": state,
        "bounded": state in CALM,
        "energy_out_j": None if cell.wall_speed_m_s or cell.by_torque else out,
        "bound_share": share,
        "bound_kept": share <= 1.0,
        "link_generated_j": None if cell.by_torque else made,
        "peak_force_n": float(_lengths(output).max()),
        "peak_contact_n": float(_lengths(raw).max()),
        "swing_n": float(np.ptp(felt[late])),
        "steady_force_n": steady,
        "wall_force_n": pressed,
        "felt": _ratio(*impulses) if ideal is None else steady / ideal,
        "felt_share": None if ideal is None else steady / ideal,
        "pressed_share": None if ideal is None else pressed / ideal,
        "saturated": [name for name, limited in met.items() if limited],
        "settle_s": settling_time(at, felt, when, steady, band),
        "impulse_ratio": _ratio(*impulses),
        "tangential_ratio": _ratio(_lengths(output[pressing, :2]), _lengths(raw[pressing, :2]))
        if cell.friction and cell.contact == "plane"
        else None,
        "drift_m": drift if drift is not None and np.isfinite(drift) else None,
        "force_reduction": 1.0 - int(slave["updates_sent"][-1]) / ticks if ticks else None,
    }
    return {name: figure for name, figure in row.items() if figure is not None}


def settling_time(at: Floats, force: Floats, when: CellTiming, steady: float, band: float) -> float | None:
    """From the press [s] until the force stays within the band for the rest of the hold; None if it hardly does."""
    span = (at >= when.press) & (at < when.release)
    outside = np.flatnonzero(np.abs(force[span] - steady) > band)
    times = at[span]
    last = float(times[outside[-1]]) if len(outside) else when.press
    return last - when.press if last < when.release - 0.1 * (when.release - when.hold) else None


def accounts(system: System) -> tuple[AccountParameters, ...]:
    """Those that `bounded` keeps for the hand of a system."""
    dump = system.model_dump()
    return accounts_in(dump | {"control": dump["control"] | {"scheme": "bounded"}})


def bound_share(master: Records, accounts: Sequence[AccountParameters]) -> float:
    """The largest share of the bound that the hand got out by any tick, as a report has it, 0 or more."""
    bound = EnergyBound(accounts)
    PortWork(rotates=len(accounts) > 1, bound=bound).add(master)
    return bound.share


def _state(cell: SystemCell, early: Floats, late: Floats, steady: float, *, clipped: bool) -> Phase:
    if cell.wall_speed_m_s:
        return "driven"
    faintest = cell.floor or FAINTEST_N  # nothing is lost where the ideal wall is fainter
    lost = min(early.min(), late.min()) < faintest and (cell.ideal_n is None or cell.ideal_n > faintest)
    if float(np.ptp(late)) <= 2.0 * max(cell.weber * abs(steady), cell.floor) + SHARE * abs(steady):
        return "lost" if lost else "settled"
    before, after = float(early.var()), float(late.var())
    if after < DECAYING * before and np.ptp(late) < np.ptp(early) and not clipped:
        return "lost" if lost else "decaying"
    return "growing" if after > GROWING * before else "oscillating"


def _energy(master: Records, slave: Records, pressing: NDArray[np.bool_]) -> tuple[float, float]:
    """Energy out since the press, and generated by the link [J]."""
    given = PortWork().add(master)
    since = given[pressing]
    # At the robot, force and position change together between two ticks, hence the trapezoid.
    force, way = slave["raw"], np.diff(slave["output"], axis=0)
    taken = np.cumsum(-(0.5 * (force[:-1] + force[1:]) * way).sum(axis=1))
    lead = in_session(master) & in_session(slave)  # before, the robot approaches on its own
    held = (np.diff(given) - np.diff(taken, prepend=0.0)) * (lead[1:] & lead[:-1])
    return max(0.0, float(since[0] - since.min())), max(0.0, -float(np.cumsum(held).min(initial=0.0)))


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))


def _ratio(felt: Floats, pressed: Floats) -> float | None:
    """Of two integrals over the same ticks; None if the robot touched next to nothing."""
    return float(felt.sum() / pressed.sum()) if pressed.max() > FAINTEST_N else None


def _failure(master: Records, slave: Records, pressing: Records) -> str:
    """Reason why press and hold did not test the loop; empty if they did."""
    if not len(pressing):
        return "ended before the hold"
    away = int((pressing["state"] != State.ENGAGED.value).sum())
    if away:
        return f"not engaged for {away} ticks of the press"
    faults = sorted({Fault(int(fault)).name.lower() for fault in np.unique(pressing["fault"]) if fault})
    if faults:
        return f"faults during the press: {', '.join(faults)}"
    wrong = sorted({name for side in (master, slave) for name in FINITE if not np.isfinite(side[name]).all()})
    return f"not finite: {', '.join(wrong)}" if wrong else ""
