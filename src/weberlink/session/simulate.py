"""Runs a configuration in virtual time, composed as the daemons are."""

from collections.abc import Callable
from pathlib import Path
from random import Random
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError
from weberlink.config.model import EmulationSettings
from weberlink.figures.session import Records, score_of
from weberlink.figures.verdict import verdict
from weberlink.order import COMPLETED, INTERRUPTED
from weberlink.protocol.states import State
from weberlink.registry import fault_of, is_hardware
from weberlink.session.composition.channels import lookahead_ms
from weberlink.session.composition.link import build_link, build_security
from weberlink.session.composition.master import build_master
from weberlink.session.composition.slave import build_slave
from weberlink.session.interruption import Interruption
from weberlink.session.simulation import SLAVE_ADDRESS, Observer, Simulation
from weberlink.telemetry.record import DESCRIPTION

if TYPE_CHECKING:
    from weberlink.master.trace import Trace
    from weberlink.telemetry.recorders import RecordingFormat

DEFAULT_DURATION = 60.0
"""Of a device that never ends by itself [s]."""


def build_simulation(configuration: Configuration) -> Simulation:
    """Both sides and their link, not yet begun. All random numbers follow from the seed of `link.emulate`.

    Raises:
        ConfigurationError: if a part cannot be made as the file asks.
    """
    refuse_live(configuration)
    system = configuration.system
    emulation = system.link.emulate or EmulationSettings()
    to_slave, to_master = emulation.directions
    chance = {name: Random(f"{emulation.seed}/{name}") for name in ("master", "slave", "forward", "backward")}  # noqa: S311
    common: dict[str, Any] = {"security": build_security(configuration), "epoch": 0.0, "stopwatch": lambda: 0.0}
    return Simulation(
        master=build_master(configuration, entropy=chance["master"].randbytes, peer=SLAVE_ADDRESS, **common),
        slave=build_slave(configuration, entropy=chance["slave"].randbytes, **common),
        links=(
            build_link(to_slave, chance["forward"].random, 0.0),
            build_link(to_master, chance["backward"].random, 0.0),
        ),
        tick_period=system.tick_period,
    )


def refuse_live(configuration: Configuration) -> None:
    """Neither hardware nor what another program leads can run in virtual time."""
    system = configuration.system
    for where, part, name in (
        ("master.device", configuration.device, system.master.device.driver),
        ("slave.robot", configuration.robot, system.slave.robot.driver),
    ):
        if part is not None and is_hardware(part.driver):
            from weberlink.hardware.emulator import EMULATORS  # noqa: PLC0415 - for the complaint alone

            emulated = f", against `weberlink device emulate {name}` if need be" if name in EMULATORS else ""
            unsaid = "" if hasattr(part.driver, "plugged") else "; one that moves nothing real says COMPUTED = True"
            raise ConfigurationError(
                f"{configuration.path}: {where}.driver: {name} is a hardware driver and cannot run in "
                f"virtual time; run it live{emulated}{unsaid}"
            )
        if part is not None and getattr(part.driver, "LIVE", False):
            raise ConfigurationError(
                f"{configuration.path}: {where}.driver: {name} is led by another program and cannot run in virtual "
                "time; run it live"
            )


def simulate(
    configuration: Configuration,
    duration: float | None,
    record: Path | None = None,
    progress: Callable[[float, float, str], None] = lambda *_: None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], "TraceRecorder"]:
    """Run to the end of the duration [s] or of the device's motion, or to Ctrl-C, which gives the figures so far.

    Args:
        configuration: both sides.
        duration: [s]; None for `DEFAULT_DURATION`.
        record: where to record the session, as MCAP; None to record nothing.
        progress: receives the simulated time and the longest one [s], and the unit.
        tell: receives one line as soon as the recording fails; the run goes on.

    Returns:
        The figures of the session, and what the robot was commanded and felt.

    Raises:
        ConfigurationError: if a part cannot be made as the file asks.
    """
    system = configuration.system
    form = None
    if record is not None:
        from weberlink.session.recorder import format_for  # noqa: PLC0415 - where a session is recorded

        form = format_for(record)
    simulation = build_simulation(configuration)
    score = score_of(system)
    recorder = TraceRecorder()
    recording = None if record is None or form is None else VirtualRecording(form, configuration, record, tell)
    length = DEFAULT_DURATION if duration is None else duration
    observers: list[Observer] = [score, recorder, *([] if recording is None else [recording])]
    observers.append(SimulatedTime(system.tick_period, length, progress))
    interruption = Interruption()
    began = perf_counter()
    fault = None
    try:
        simulation.run(length, observers, interruption)
    except Exception as error:
        fault = fault_of(error)
        if fault is None or not fault.is_foreign:
            raise
    finally:
        simulation.close()
    run_time = perf_counter() - began
    master, slave = simulation.master, simulation.slave
    failures = [why for why in (fault and fault.text, master.failure, slave.failure) if why is not None]
    ended = "interrupted" if interruption.noted else "completed"
    summary = score.summary() | {
        "lookahead_ms": lookahead_ms(system),
        "playout_ms": system.link.playout_ms,
        "faults": {"master": master.faults, "slave": slave.faults},
        "drops": {"master": master.drops, "slave": slave.drops},
        "peers": {"master": master.peer._asdict(), "slave": slave.peer._asdict()},
        "outcome": f"failed: {'; '.join(failures)}" if failures else ended,
        "run_time_s": run_time,
        "seed": (system.link.emulate or EmulationSettings()).seed,
    }
    if interruption.noted:
        summary["interrupted"] = True
    if recording is not None:
        summary["recording"] = recording.finish()
    judged = verdict(summary)
    status = INTERRUPTED if interruption.noted and judged.status == COMPLETED else judged.status
    return summary | {"verdict": judged.document(), "status": status}, recorder


class TraceRecorder:
    """Collects the commanded position and the measured force of the robot while it is engaged, as a trace."""

    def __init__(self) -> None:
        self._pieces: list[Records] = []

    def add(self, master: Records, slave: Records) -> None:  # noqa: ARG002 - an observer gets both
        """Take the next records of both sides."""
        self._pieces.append(slave[slave["state"] == State.ENGAGED.value])

    @property
    def trace(self) -> "Trace":
        """The unrounded trace; needs at least one engaged tick."""
        from weberlink.master.trace import as_trace  # noqa: PLC0415 - where one is asked for

        records = np.concatenate(self._pieces)
        return as_trace(np.column_stack((records["at"] - records["at"][0], records["output"], records["raw"])))

    def save(self, path: Path) -> int:
        """Write the trace with all digits, so that the same numbers are read back; returns the number of rows.

        Raises:
            OSError: the file cannot be written.
        """
        from weberlink.master.trace import COLUMNS  # noqa: PLC0415 - where one is asked for

        records = np.concatenate([np.empty(0, np.dtype(DESCRIPTION)), *self._pieces])
        time = records["at"] - (records["at"][0] if len(records) else 0.0)
        rows = np.column_stack((time, records["output"], records["raw"])).tolist()
        lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return len(records)


class SimulatedTime:
    """Reports the simulated time of a run.

    Args:
        tick_period: [s].
        length: of the run [s].
        progress: receives the simulated time and the length [s], and the unit.
    """

    def __init__(self, tick_period: float, length: float, progress: Callable[[float, float, str], None]) -> None:
        self._tick_period = tick_period
        self._length = length
        self._progress = progress
        self._ticks = 0

    def add(self, master: Records, slave: Records) -> None:  # noqa: ARG002 - an observer gets both
        self._ticks += len(master)
        self._progress(round(min(self._ticks * self._tick_period, self._length), 1), self._length, "s")


class VirtualRecording:
    """Writes the recording of a live session, on a clock that begins at 0. A full disk ends the recording alone.

    Raises:
        ConfigurationError: from the constructor, if the file cannot be made.
    """

    def __init__(
        self, form: "RecordingFormat", configuration: Configuration, path: Path, tell: Callable[[str], None]
    ) -> None:
        from weberlink.session.recorder import facts, recording_ended  # noqa: PLC0415 - where a session is recorded

        self._outcome = "complete"
        self._path = path
        self._tell: Callable[[str], None] = lambda outcome: tell(recording_ended(path, outcome))
        try:
            self._writer = form.create(path, facts(configuration, virtual=True), configuration.system.rate_hz)
        except OSError as error:
            raise ConfigurationError(f"--record: {path}: {error.strerror or error}") from None

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides."""
        if self._outcome == "complete":
            try:
                self._writer.write(MASTER, master)
                self._writer.write(SLAVE, slave)
                self._writer.flush()
            except OSError as error:
                self._outcome = error.strerror or str(error)
                self._tell(self._outcome)

    def finish(self) -> dict[str, Any]:
        """End the file; returns the summary that the recorder of a live session gives."""
        try:
            self._writer.close()
        except OSError as error:
            self._outcome = error.strerror or str(error)
        writer = self._writer
        return {
            "path": str(self._path),
            "bytes": writer.size,
            "records": writer.records,
            "lost": writer.lost,
            "outcome": self._outcome,
        }
