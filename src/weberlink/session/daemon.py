"""One daemon: one side of a configuration, in real time, in a process of its own.

The launcher starts it and sends it a `DaemonOrder`; it answers with a summary as JSON on standard output.
"""

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from random import Random
from signal import SIG_SETMASK, SIG_UNBLOCK, SIGHUP, Signals, pthread_sigmask, signal
from socket import socket
from time import monotonic
from traceback import format_exception, print_exception
from types import FrameType
from typing import Any

from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError, System, load
from weberlink.config.errors import trace_of, validated
from weberlink.config.finders import finder_of, finding
from weberlink.config.model import DirectionFaults, split_address
from weberlink.order import COMPLETED, EMERGENCY, FAILED, MISCONFIGURED, STOP_SIGNALS
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.events import Address
from weberlink.realtime.process import die_with_parent, prepare
from weberlink.registry import fault_of, in_words
from weberlink.session import description
from weberlink.session.composition.link import live_context
from weberlink.session.composition.sides import build_side
from weberlink.session.control_socket import LINK_SETTINGS, ControlSocket
from weberlink.session.description import DaemonOrder, failure
from weberlink.session.key_watch import key_watch
from weberlink.session.side import Side
from weberlink.session.tick_loop import REASONS, AfterTick, TickLoop
from weberlink.session.waiting import received
from weberlink.telemetry.ring import RingWriter

RING_SECONDS = 10.0
STOP_SLACK_S, STOP_FADES = 1.0, 2.0
"""Longest orderly stop: a time [s], and multiples of that in which the force fades, because late ticks stretch it."""


class StartError(Exception):
    """The device or the robot could not be opened."""


class Stopped(Exception):  # noqa: N818 - an end like any other
    """A signal or a stop came while the device or the robot was being opened; the message is the outcome."""


def main(descriptor: int) -> int:
    """Run the order that comes; returns the exit status. Errors are one line on standard error."""
    # Memory is locked: numpy, where a driver needs it, and the look-up of names would hold 100 MB for threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("UV_THREADPOOL_SIZE", "1")
    came = received(descriptor)
    if came is None:
        return COMPLETED
    order, control = DaemonOrder.from_json(came[0]), came[1]
    die_with_parent(SIGHUP, order.parent)
    try:
        configuration = load(Path(order.file), order.overrides, sides=[order.side])
        summary = serve(order, configuration, control)
        status = FAILED if summary["failed"] else COMPLETED
    except Exception as error:
        status, fault, trace = FAILED, fault_of(error), format_exception(error)
        if isinstance(error, ConfigurationError):
            status, told, trace = MISCONFIGURED, str(error), trace_of(error)
        elif fault is not None:
            told = fault.text
        elif isinstance(error, StartError | OSError):  # among them a port in use, a ring in use
            # An OSError's own text begins with its number.
            told, trace = getattr(error, "strerror", None) or str(error), []
        else:
            told = f"internal error: {in_words(error)}"
        is_ours = not isinstance(error, ConfigurationError | StartError | OSError)
        if is_ours and (fault is None or not fault.is_foreign):  # whoever mends this program needs the trace
            print_exception(error)
        sys.stderr.write(f"weberlink {order.side}: {told}\n")
        summary = failure(told, trace)
    with suppress(BrokenPipeError):  # the launcher may be gone
        sys.stdout.write(json.dumps(summary))
        sys.stdout.flush()
    return status


def serve(order: DaemonOrder, configuration: Configuration, control_socket: int) -> dict[str, Any]:
    """Run one side to its end, answering at the control socket of this descriptor; returns outcome, faults, drops and
    rights, which the telemetry does not contain. Raises ConfigurationError, StartError or OSError before the first
    tick, and whatever a driver, another part or this program itself raised."""
    system = configuration.system
    realtime = system.realtime
    cpu = None if realtime.cpus is None else realtime.cpus[0 if order.side == MASTER else 1]
    epoch = monotonic()  # the first tick is that of the first deadline after opening
    finder = finder_of(configuration, order.side)
    context = live_context(configuration, order.side, finder, epoch, take_over=order.take_over)
    side = build_side(configuration, order.side, context)
    with ExitStack() as stack:
        # Before the rights are taken, so that it gets none, and has imported its libraries by the time of the session.
        paths = stack.enter_context(finding(configuration, finder, take_over=order.take_over))
        # After the imports of the side: with real-time rights they would hold up the other side.
        grants = prepare(realtime.priority, realtime.lock_memory, cpu, wakeful=realtime.wakeful)
        link = emulated_link(order.side, system, epoch)
        udp = UdpShell(
            side.endpoint,
            now=monotonic,
            listen=("", 0) if order.side == MASTER else split_address(system.link.listen),
            link=None if link is None else link.link,
            dscp=system.link.dscp,
            paths=paths,
            on_no_path=lambda why: side.give_up(monotonic(), why),
        )
        side.send_at_once = udp.flush
        told = description.describe(configuration, order.side, side.endpoint.name, side.port)
        described = description.Description(order.ring, told)
        described.publish(paths=udp.paths)
        stack.callback(described.remove)
        ring = RingWriter(
            order.ring,
            side=order.side,
            rate_hz=system.rate_hz,
            capacity=int(RING_SECONDS * system.rate_hz),
            records=side.layout,
        )
        # Launcher and recorder may be slow to start: the launcher removes the file when both have read it.
        stack.callback(lambda: ring.close(unlink=os.getppid() != order.parent))
        control = ControlSocket(socket(fileno=control_socket), side, link, order.ordered_at)
        try:
            with _interruptible(), control.opening(Stopped):
                side.open(monotonic())
        except side.port.fault as fault:
            raise StartError(str(fault)) from fault
        except Stopped as stopped:
            side.close()
            return failure(str(stopped)) | {"failed": str(stopped) == EMERGENCY, "realtime": asdict(grants)}
        stack.callback(side.close)
        stack.callback(control.close)
        watch = key_watch(configuration, finder, context.security, side.endpoint) if order.side == SLAVE else None
        ran = TickLoop(
            side,
            udp,
            system.tick_period,
            duration_s=order.duration_s,
            start_at=epoch,
            stop_limit_s=stop_limit_s(system, order.side),
            on_open=[control.open] if watch is None else [control.open, watch.open],
            on_close=[] if watch is None else [watch.close],
            after_tick=_after_tick(side, udp, ring, described),
            busy_poll=system.realtime.busy_poll,
        ).run()
    return {
        "outcome": ran.outcome,
        "failed": side.failure is not None or not ran.orderly,
        "faults": side.faults,
        "drops": side.drops,
        "peer": side.peer._asdict(),
        "paths": [path._asdict() for path in udp.paths],
        "realtime": asdict(grants),
    }


def _after_tick(side: Side, udp: UdpShell, ring: RingWriter, described: description.Description) -> AfterTick:
    """Writes the record of a tick, and what has changed of peer and paths."""
    peer, paths = side.peer, udp.paths

    def write(missed: int, deadline: float, now: float, work_us: float) -> None:
        nonlocal peer, paths
        ring.write(side.values((now - deadline) * 1e6, work_us, missed))
        if side.peer is not peer or udp.paths is not paths:
            peer, paths = side.peer, udp.paths
            with suppress(OSError):  # no space in memory; telemetry has its own already
                described.publish(peer._asdict(), paths)

    return write


class LiveLink:
    """The emulated link of one direction, and its present faults, which may change while a session runs; `fixed` says
    why nothing may be changed."""

    def __init__(self, faults: DirectionFaults, link: EmulatedLink[Address], fixed: str | None = None) -> None:
        self.link = link
        self._faults = {name: getattr(faults, name) for name in DirectionFaults.model_fields}
        self._fixed = fixed

    @property
    def in_force(self) -> dict[str, float]:
        return {name: self._faults[name] for name in LINK_SETTINGS}

    def change(self, settings: Mapping[str, object]) -> str | None:
        """Apply settings to what is sent from now on; why not, or None.

        What is under way arrives as before, and what is sent later does not overtake it."""
        if self._fixed is not None:
            return self._fixed
        if unknown := [name for name in settings if name not in LINK_SETTINGS]:
            return f"{unknown[0]} is no setting of the link; known are {', '.join(LINK_SETTINGS)}"
        try:
            faults = validated(DirectionFaults, self._faults | dict(settings), strict=True)
            self.link.change(faults.emulation())
        except ValueError as error:
            return str(error)
        self._faults = dict(faults)
        return None


def emulated_link(name: str, system: System, epoch: float) -> LiveLink | None:
    """The faults of what this side sends, with its own random numbers; None where the file asks for none."""
    emulate = system.link.emulate
    if emulate is None:
        return None
    to_slave, to_master = emulate.directions
    faults = to_slave if name == MASTER else to_master
    uniform = Random(f"{emulate.seed}/{name}").random  # noqa: S311
    fixed = None if system.control.live_changes else "the link is fixed in this session: control.live_changes is off"
    return LiveLink(faults, EmulatedLink(faults.emulation(), uniform, epoch), fixed)


def stop_limit_s(system: System, side: str) -> float:
    """Hard bound on an orderly stop [s]: the operator's end fades the force first, the robot's end leaves at once."""
    fade = system.master.limits.ramp_ms * 1e-3 if side == MASTER else 0.0
    return STOP_SLACK_S + STOP_FADES * fade


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let stop signals end what takes long before the loop runs: a device may wait for a person to home it."""

    def stop(number: int, _frame: FrameType | None) -> None:
        raise Stopped(REASONS.get(Signals(number), "terminated"))

    before = {number: signal(number, stop) for number in STOP_SIGNALS}
    held_back = pthread_sigmask(SIG_UNBLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        pthread_sigmask(SIG_SETMASK, held_back)  # from here on they wait for the loop
        for number, handler in before.items():
            signal(number, handler)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[2])))  # after the side, which is for whoever lists processes
