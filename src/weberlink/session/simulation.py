"""The whole system in virtual time, composed as the daemons are: both sides and an emulated link.

The same seed gives the same run, bit for bit.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random
from signal import SIGINT, SIGTERM, default_int_handler, getsignal, signal
from threading import current_thread, main_thread
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError
from weberlink.config.model import EmulationSettings
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.states import State
from weberlink.registry import fault_of, is_hardware
from weberlink.session.composition.link import Context, build_security
from weberlink.session.composition.sides import build_side
from weberlink.session.report import Facts
from weberlink.session.side import Side
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import DESCRIPTION, FORCE, RECORD

if TYPE_CHECKING:
    from weberlink.master.trace import Trace

MASTER_ADDRESS = ("master", 1)
SLAVE_ADDRESS = ("slave", 2)
CHUNK = 1000  # ticks after which the observers get the records
DEFAULT_DURATION = 60.0  # of a device that never ends by itself [s]

Link = EmulatedLink[tuple[str, int]]
Values = tuple[float, ...]
Observer = Callable[[Records, Records], object]
"""Takes the next records of master and slave, such as `weberlink.session.report.Report.add`."""


class Simulation:
    """Two sides and a link, stepped tick by tick.

    A datagram arrives at its own time, also between ticks. In a tick the master goes first: over a link without delay a
    position is acted on in the tick in which it was sent, and the force is felt one tick later.

    Args:
        links: the faults from master to slave, and those from slave to master.
    """

    def __init__(self, *, master: Side, slave: Side, links: tuple[Link, Link], tick_period: float) -> None:
        self.master, self.slave = master, slave
        self._forward, self._backward = links
        self._tick_period = tick_period
        self._index = 0

    def run(self, duration: float, observers: Sequence[Observer], signals: Sequence[int] = ()) -> None:
        """Run to the end of the duration [s], or of the device's motion where that comes first, or until there are
        signals."""
        last, error = self._index + round(duration / self._tick_period), None
        while not (error or self.master.stopped or signals):
            chunk = list[tuple[Values, Values]]()
            try:
                while len(chunk) < CHUNK and not (self.master.stopped or signals):
                    if self._index == last:
                        self.master.stop(self._index * self._tick_period, "completed")
                    chunk.append(self.step())
            except Exception as raised:
                error = raised  # the ticks before it count
            if chunk:
                records = [as_array(of_side) for of_side in zip(*chunk, strict=True)]
                for observer in observers:
                    observer(*records)
        if error is not None:
            raise error

    def advance(self, ticks: int) -> tuple[Records, Records]:
        """The records of both sides of so many ticks, 1 or more."""
        masters, slaves = zip(*(self.step() for _ in range(ticks)), strict=True)
        return as_array(masters), as_array(slaves)

    def close(self) -> None:
        """Close device and robot; may be repeated."""
        self.master.close()
        self.slave.close()

    def step(self) -> tuple[Values, Values]:
        """One tick of both sides; returns what they would write to telemetry: the values of a record each."""
        now = self._index * self._tick_period
        if self._index == 0:
            self.slave.open(now)
            self.master.open(now)
        for side, link in ((self.master, self._forward), (self.slave, self._backward)):
            self._carry(now)
            side.endpoint.handle_timer(now)
            side.tick(self._index, now, now)
            for data, address in side.endpoint.datagrams_to_send():
                link.send(data, address, now)
        self._index += 1
        return self.master.record(), self.slave.record()

    def _carry(self, now: float) -> None:
        """Deliver all that arrives by now, each datagram at its own time."""
        forward, backward = self._forward, self._backward
        master, slave = self.master.endpoint, self.slave.endpoint
        while True:
            at, other = forward.next_due(), backward.next_due()
            at = other if at is None or (other is not None and other < at) else at
            if at is None or at > now:
                return
            for data, _ in forward.receive(at):
                slave.receive_datagram(data, MASTER_ADDRESS, at)
            for data, _ in backward.receive(at):
                master.receive_datagram(data, SLAVE_ADDRESS, at)
            for endpoint, link in ((master, forward), (slave, backward)):
                for data, address in endpoint.datagrams_to_send():
                    link.send(data, address, at)


def as_array(records: Sequence[Values]) -> Records:
    """Records as the structured array that a telemetry reader would return."""
    return np.frombuffer(b"".join(RECORD.pack(*record) for record in records), dtype=np.dtype(DESCRIPTION))


def build_simulation(configuration: Configuration) -> Simulation:
    """Both sides and their link, not yet begun. All random numbers follow from the seed of `link.emulate`. Raises
    ConfigurationError if a part cannot be made as the file asks."""
    refuse_live(configuration)
    system = configuration.system
    emulation = system.link.emulate or EmulationSettings()
    to_slave, to_master = emulation.directions
    chance = {name: Random(f"{emulation.seed}/{name}") for name in ("master", "slave", "forward", "backward")}  # noqa: S311
    security = build_security(configuration)
    caller = Context(security, chance["master"].randbytes, 0.0, peer=SLAVE_ADDRESS)
    return Simulation(
        master=build_side(configuration, MASTER, caller),
        slave=build_side(configuration, SLAVE, Context(security, chance["slave"].randbytes, 0.0)),
        links=(
            Link(to_slave.emulation(), chance["forward"].random, 0.0),
            Link(to_master.emulation(), chance["backward"].random, 0.0),
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


@contextmanager
def _noted() -> Iterator[list[int]]:
    """The signals that have come of those that would raise KeyboardInterrupt, and do not: what is done is kept."""
    signals: list[int] = []
    if current_thread() is not main_thread():  # which alone handles signals
        yield signals
        return
    taken = [number for number in (SIGINT, SIGTERM) if getsignal(number) is default_int_handler]
    try:
        for number in taken:
            signal(number, lambda number, _: signals.append(number))
        yield signals
    finally:
        for number in taken:
            signal(number, default_int_handler)


def simulate(
    configuration: Configuration,
    duration: float | None = None,
    observers: Sequence[Observer] = (),
) -> Facts:
    """Run to the end of the duration [s] or of the device's motion, or to Ctrl-C.

    Args:
        duration: [s]; None for `DEFAULT_DURATION`.
        observers: each takes the records of both sides, in pieces.

    Returns:
        What is known of the session beside its records.

    Raises:
        ConfigurationError: if a part cannot be made as the file asks.
    """
    simulation = build_simulation(configuration)
    began = perf_counter()
    fault = None
    try:
        with _noted() as signals:
            simulation.run(DEFAULT_DURATION if duration is None else duration, observers, signals)
    except Exception as error:
        fault = fault_of(error)
        if fault is None or not fault.is_foreign:
            raise
    finally:
        simulation.close()
    run_time = perf_counter() - began
    master, slave = simulation.master, simulation.slave
    failures = [why for why in (fault and fault.text, master.failure, slave.failure) if why is not None]
    ended = "interrupted" if signals else "completed"
    facts = Facts(
        faults={"master": master.faults, "slave": slave.faults},
        drops={"master": master.drops, "slave": slave.drops},
        peers={"master": master.peer._asdict(), "slave": slave.peer._asdict()},
        outcome=f"failed: {'; '.join(failures)}" if failures else ended,
        run_time_s=run_time,
        seed=(configuration.system.link.emulate or EmulationSettings()).seed,
    )
    if signals:
        facts["interrupted"] = True
    return facts


class TraceRecorder:
    """Collects the commanded position and the measured force of the robot while it is engaged, as a trace."""

    def __init__(self) -> None:
        self._pieces: list[Records] = []

    def add(self, master: Records, slave: Records) -> None:  # noqa: ARG002 - an observer gets both
        self._pieces.append(slave[slave["state"] == State.ENGAGED.value])

    def _rows(self) -> NDArray[np.float64]:
        records = np.concatenate([np.empty(0, np.dtype(DESCRIPTION)), *self._pieces])
        time = records["at"] - (records["at"][0] if len(records) else 0.0)
        return np.column_stack((time, records["output"][:, FORCE], records["raw"][:, FORCE]))

    @property
    def trace(self) -> "Trace":
        """The unrounded trace; needs at least one engaged tick."""
        from weberlink.master.trace import as_trace  # noqa: PLC0415 - where one is asked for

        return as_trace(self._rows())

    def save(self, path: Path) -> int:
        """Write the trace with all digits, so that the same numbers are read back; returns the number of rows. Raises
        OSError if the file cannot be written."""
        from weberlink.master.trace import COLUMNS  # noqa: PLC0415 - where one is asked for

        rows = self._rows().tolist()
        lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return len(rows)
