"""What a stretch of time cost the two daemons, and what the operator felt in it. Watches a rig; does nothing to it."""

import subprocess
from dataclasses import dataclass, field
from time import monotonic, sleep

import numpy as np

from tests.soak.laws import longest_gap
from tests.soak.processes import cpu_seconds, socket_queue
from tests.soak.rig import SIDES, Rig, RigError
from weberlink.protocol.states import State
from weberlink.system.composition.channels import channels
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import Records, SessionScore

_LOOK = 0.05


@dataclass
class Phase:
    """What was seen in one stretch of time; one value for each side where it says so.

    Attributes:
        core: share of a core that the daemon took.
        missed: deadlines without a tick, of all.
        lateness_p99_us: of the ticks.
        engaged: share of ticks in a session.
        violations: share of ticks whose felt error is outside the deadband; None if none counts.
        dropped: datagrams refused.
        kernel_drops: datagrams that the kernel dropped before the daemon's socket.
        sent_bytes: of datagrams sent.
        stall_s: longest time without a tick on either side, or that the relay stood still.
    """

    seconds: float = 0.0
    core: dict[str, float] = field(default_factory=dict)
    missed: dict[str, float] = field(default_factory=dict)
    lateness_p99_us: dict[str, float] = field(default_factory=dict)
    engaged: dict[str, float] = field(default_factory=dict)
    violations: float | None = None
    error_rms_n: float | None = None
    dropped: dict[str, int] = field(default_factory=dict)
    stall_s: float = 0.0
    kernel_drops: dict[str, int] = field(default_factory=dict)
    sent_bytes: dict[str, int] = field(default_factory=dict)


class Observer:
    """Watches a rig through one phase after another."""

    def __init__(self, rig: Rig, ports: dict[str, int]) -> None:
        self._rig = rig
        self._ports = ports

    def watch(self, seconds: float, until: subprocess.Popen[bytes] | None = None) -> Phase:
        """The figures of the next `seconds`, or of what a process lasts if it ends earlier."""
        rig = self._rig
        score = SessionScore(rig.rate_hz, channels(rig.configuration.system)[1].bank)
        seen: dict[str, list[Records]] = {side: [] for side in SIDES}
        for life in rig.lives.values():
            life.read()
        rig.wire.books()  # what the relay was late before is of no interest
        began = monotonic()
        cpu = {side: cpu_seconds(rig.lives[side].pid) for side in SIDES}
        drops = {side: socket_queue(self._ports[side]).drops for side in SIDES}
        while monotonic() < began + seconds and (until is None or until.poll() is None):
            sleep(_LOOK)
            new = {side: self._read(side) for side in SIDES}
            score.add(new[MASTER], new[SLAVE])
            for side in SIDES:
                seen[side].append(new[side])
        lasted = monotonic() - began
        felt = score.summary()["force"]
        phase = Phase(
            lasted,
            violations=felt["violation_fraction"],
            error_rms_n=felt["error_rms"],
            stall_s=max(0.0, rig.wire.books().late),
        )
        for side in SIDES:
            phase.core[side] = (cpu_seconds(rig.lives[side].pid) - cpu[side]) / lasted
            phase.kernel_drops[side] = socket_queue(self._ports[side]).drops - drops[side]
            records = np.concatenate(seen[side])
            phase.stall_s = max(phase.stall_s, longest_gap(records, 1.0 / rig.rate_hz))
            _summarise(phase, side, records, rig.rate_hz * lasted)
        return phase

    def _read(self, side: str) -> Records:
        life = self._rig.lives[side]
        records = life.read()
        if records is None or not life.daemon.running:
            raise RigError(f"the {side} has ended")
        return records


def _summarise(phase: Phase, side: str, records: Records, due: float) -> None:
    if not len(records):
        phase.missed[side], phase.engaged[side] = 1.0, 0.0
        return
    phase.missed[side] = float(records["ticks_missed"][-1] - records["ticks_missed"][0]) / due
    phase.lateness_p99_us[side] = float(np.percentile(records["lateness_us"], 99))
    phase.engaged[side] = float((records["state"] == State.ENGAGED.value).mean())
    phase.dropped[side] = int(records["datagrams_dropped"][-1] - records["datagrams_dropped"][0])
    phase.sent_bytes[side] = int(records["bytes_sent"][-1] - records["bytes_sent"][0])
