"""Check of the host of a virtual machine: what it takes, and whether it takes more of processors kept awake."""

from collections.abc import Iterator, Sequence

from weberlink.apps.doctor.findings import Finding, advice, ok, unknown
from weberlink.apps.doctor.host_trial import HostRequest, HostTrial
from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.realtime.process import HIGHEST_PRIORITY

Stretches = Sequence[dict[str, float | None]]

TOLERATED = 0.01
"""Share of ticks, or of processor time, that the host may take."""
LATENESS_MARGIN = 0.05
"""Difference of the 99th percentiles of lateness that counts, as a share of a tick."""
STEAL_MARGIN = 0.02
"""Difference of steal that counts; the kernel counts in steps of 10 ms, about this share of a stretch."""


def host(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """What the host takes, and what keeping processors awake changes, from one trial."""
    processors = sorted(set(needs.pinned.values()) & machine.affinity() or machine.affinity())
    trial = machine.host_trial(HostRequest(min(needs.priority + 1, HIGHEST_PRIORITY), processors, needs.rate_hz))
    if trial.failure is not None:
        yield unknown(f"the host's share of missed ticks: {trial.failure}", check="host")
        return
    yield _host(trial.awake if needs.wakeful and trial.awake else trial.asleep, needs)
    yield _wakeful(trial, needs)


def _host(stretches: Stretches, needs: Needs) -> Finding:
    missed, steal = mean(stretches, "missed") or 0.0, mean(stretches, "steal")
    counted = "not counted here" if steal is None else f"{100 * steal:.1f} %"
    found = f"the host makes {100 * missed:.2f} % of ticks at {needs.rate_hz:g} Hz be missed; steal {counted}"
    if max(missed, steal or 0.0) <= TOLERATED:
        return ok(found, "host")
    return advice(
        found, "give this machine processors of its own (pinned, not shared), and stop other load on its host", "host"
    )


def _wakeful(trial: HostTrial, needs: Needs) -> Finding:
    check = "wakeful"
    if trial.not_awake is not None:
        return unknown(f"processors awake or not, which is better: {trial.not_awake}", check=check)
    asleep, awake = trial.asleep, trial.awake
    late = f"{mean(awake, 'p99_us') or 0.0:.0f}/{mean(asleep, 'p99_us') or 0.0:.0f} us"
    found = f"processors awake/not: late p99 {late}"
    steal = mean(awake, "steal"), mean(asleep, "steal")
    if steal[0] is not None and steal[1] is not None:
        found += f", steal {100 * steal[0]:.1f}/{100 * steal[1]:.1f} %"
    better = awake_is_better(trial, needs.period_us)
    if better is None:
        return ok(f"{found}: no clear difference", check)
    found += f": {'awake' if better else 'not awake'} is better"
    if better == needs.wakeful:
        return ok(found, check)
    return advice(found, f"in the file: realtime: {{wakeful: {str(better).lower()}}}", check)


def awake_is_better(trial: HostTrial, period_us: float) -> bool | None:
    """Whether processors should be kept awake; None if there is no clear difference.

    Lateness decides; where it makes no difference, steal. A difference is clear if its mean exceeds the margin and no
    pair of neighbouring stretches has it the other way round: the load of a host changes from second to second.
    """
    for name, margin in (("p99_us", LATENESS_MARGIN * period_us), ("steal", STEAL_MARGIN)):
        pairs = [(asleep[name], awake[name]) for asleep, awake in zip(trial.asleep, trial.awake, strict=True)]
        gains = [asleep - awake for asleep, awake in pairs if asleep is not None and awake is not None]
        if gains and abs(sum(gains)) > margin * len(gains) and (min(gains) >= 0.0 or max(gains) <= 0.0):
            return sum(gains) > 0.0
    return None


def mean(stretches: Stretches, name: str) -> float | None:
    """Mean of a figure of the stretches; None if it was not measured."""
    values = [value for each in stretches if (value := each[name]) is not None]
    return sum(values) / len(values) if values else None
