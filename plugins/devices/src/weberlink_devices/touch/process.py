"""The daemon's side of the process of the servo loop."""

import json
import os
import signal
import subprocess
from dataclasses import asdict, replace
from math import inf
from mmap import mmap
from time import monotonic, sleep

from weberlink.child_process import python
from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.touch import servo
from weberlink_devices.touch.exchange import BEFORE_FIRST, MEMORY_SIZE, Phase, ServoMemory, ServoState
from weberlink_devices.touch.servo import ServoArguments

START_S = 10.0
"""Longest time for the process to start, without that for the calibration [s]; a busy host takes seconds."""
POLL_S = 0.002
END_S = 0.5
"""Longest time for the process to end [s]."""
STUCK_S = 0.15
"""The same for a process that was already silent for `SILENT_S` [s]."""
QUIET_S = 0.005
"""Time without a new state before the process itself is looked at [s]; below the limits that a session has."""
SILENT_S = 0.25
"""Time without a new state that is a fault while this process ran [s]."""
LOOKED_S = 0.05
"""A longer pause between two looks means that this process was held up [s]."""


class ServoProcess:
    """Runs `weberlink_devices.touch.servo`; a tick writes the force to its memory and reads the state.

    Args:
        arguments: for it; memory and parent are filled in here.
    """

    def __init__(self, arguments: ServoArguments) -> None:
        self._arguments = arguments
        self._child: subprocess.Popen[bytes] | None = None
        self._memory: ServoMemory | None = None
        self._state = BEFORE_FIRST
        self._changed_at = self._looked_at = 0.0

    @property
    def pid(self) -> int | None:
        """Process id; None while there is none."""
        return None if self._child is None else self._child.pid

    def start(self) -> dict[str, float]:
        """Start it, and wait for the calibrated device; gives its largest force [N] and coordinate [m].

        Raises:
            HardwareFault: it does not start, or the device cannot be used; nothing is left running.
        """
        self.stop()
        try:
            self._spawn()
            described = self._described(START_S + self._arguments.calibration_s)
        except BaseException:
            self.stop()
            raise
        self.state()
        return described

    def put(self, force: Vector, at: float) -> None:
        """The force for the next frame [N, frame of the library], commanded at `at` [s]."""
        if self._memory is not None:
            self._memory.force.write(at, *force, 0)

    def state(self) -> ServoState:
        """The newest state.

        Raises:
            HardwareFault: the process died, reports a fault, or is silent.
        """
        assert self._memory is not None
        state, now = self._memory.newest_state(), monotonic()
        if state is not None:
            self._state = state
            self._changed_at = self._looked_at = now
            return state
        if now - self._looked_at > LOOKED_S:
            self._changed_at = now
        self._looked_at = now
        if (silent := now - self._changed_at) > QUIET_S:
            self._check(silent)
        return self._state

    def stop(self) -> str | None:
        """Take the force off and end the process; may be called again.

        A process that does not end is killed. If it may have left a force, another one is started to take that off.

        Returns:
            Why the force may still be on; None if it is off.
        """
        child, self._child = self._child, None
        memory, self._memory = self._memory, None
        if child is None or memory is None:
            return None
        died = child.poll() is not None and child.returncode != 0
        memory.force.write(-inf, *ZERO, 1)
        try:
            child.wait(STUCK_S if monotonic() - self._changed_at > SILENT_S else END_S)
        except subprocess.TimeoutExpired:  # it was stopped by a signal, or the library hangs
            child.kill()
            child.wait()
            died = True
        state = memory.newest_state() or self._state
        memory.close()
        self._state = BEFORE_FIRST
        leaves_force = died and self._arguments.force and (state.force != ZERO or state.error != 0)
        return self._release() if leaves_force else None

    def _release(self) -> str | None:
        """Start the process again with the motors off, and end it.

        The library initializes the device, and a frame without force follows.
        """
        again = ServoProcess(replace(self._arguments, force=False))
        try:
            again._spawn()
            again._described(START_S)
        except HardwareFault as fault:
            return f"its servo process died with a force on the hand: switch the device off; the next one says: {fault}"
        finally:
            again.stop()
        return None

    def _spawn(self) -> None:
        memory = os.memfd_create("weberlink-touch")
        try:
            os.ftruncate(memory, MEMORY_SIZE)
            self._memory, self._state = ServoMemory(mmap(memory, MEMORY_SIZE)), BEFORE_FIRST
            self._memory.force.write(-inf, *ZERO, 0)
            arguments = replace(self._arguments, memory=memory, parent=os.getpid())
            self._child = subprocess.Popen(  # noqa: S603 - our own
                python("-m", servo.__name__, json.dumps(asdict(arguments))),
                stdin=subprocess.DEVNULL,
                stdout=2,  # where the library prints its licence; ours may be a stream of data
                pass_fds=(memory,),
                start_new_session=True,  # Ctrl-C does not reach it
            )
        except OSError as error:
            raise HardwareFault(f"its servo process does not start: {error}") from None
        finally:
            os.close(memory)

    def _described(self, patience: float) -> dict[str, float]:
        """What the library says of the device, once it is ready.

        Raises:
            HardwareFault: it cannot be used, or is not ready within this time [s].
        """
        assert self._memory is not None
        until = monotonic() + patience
        while (report := self._memory.heard()) is None:
            self._check_alive()
            if monotonic() > until:
                raise HardwareFault(f"its servo process is not ready within {patience:g} s")
            sleep(POLL_S)
        phase, content = report
        if phase is Phase.FAILED:
            raise HardwareFault(content)
        described: dict[str, float] = content
        return described

    def _check(self, silent: float) -> None:
        """Raise HardwareFault if the process died, reports a fault, or was silent for too long [s]."""
        assert self._memory is not None
        report = self._memory.heard()
        if report is not None:
            raise HardwareFault(report[1])
        self._check_alive()
        if silent > SILENT_S:
            raise HardwareFault(f"its servo process has been silent for {silent:.2f} s")

    def _check_alive(self) -> None:
        assert self._child is not None
        assert self._memory is not None
        status = self._child.poll()
        if status is None:
            return
        report = self._memory.heard()  # its last words may have come after the last look
        how = f"by {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
        raise HardwareFault(f"its servo process ended {how}" if report is None else report[1])
