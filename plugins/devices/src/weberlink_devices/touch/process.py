"""The daemon's side of the process of the servo loop."""

from dataclasses import replace
from math import inf
from os import getpid
from time import monotonic, sleep

from weberlink.child_process import Child, python, shared_memory
from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.touch import servo
from weberlink_devices.touch.exchange import BEFORE_FIRST, MEMORY_SIZE, Phase, ServoMemory, ServoState
from weberlink_devices.touch.servo import ServoOrder

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
        order: for it; memory and parent are filled in here.
    """

    def __init__(self, order: ServoOrder) -> None:
        self._order = order
        self._child: Child | None = None
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
            described = self._described(START_S + self._order.calibration_s)
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

        A process that does not end is killed. If it may have left a force, another one is started to take that off:
        the library initializes the device, and a frame without force follows.

        Returns:
            Why the force may still be on; None if it is off.
        """
        child, self._child = self._child, None
        memory, self._memory = self._memory, None
        if child is None or memory is None:
            return None
        memory.force.write(-inf, *ZERO, 1)
        child.end(STUCK_S if monotonic() - self._changed_at > SILENT_S else END_S)
        state = memory.newest_state() or self._state
        memory.close()
        self._state = BEFORE_FIRST
        if child.status == 0 or not self._order.force or (state.force == ZERO and state.error == 0):
            return None
        again = ServoProcess(replace(self._order, force=False))
        try:
            again._spawn()
            again._described(START_S)
        except HardwareFault as fault:
            return f"its servo process died with a force on the hand: switch the device off; the next one says: {fault}"
        finally:
            again.stop()
        return None

    def _spawn(self) -> None:
        try:
            with shared_memory("weberlink-touch", MEMORY_SIZE) as (memory, descriptor):
                self._memory, self._state = ServoMemory(memory), BEFORE_FIRST
                self._memory.force.write(-inf, *ZERO, 0)
                order = replace(self._order, memory=descriptor, parent=getpid())
                command = python("-m", servo.__name__, order.to_json())
                # The library prints its licence to standard output; ours may be a stream of data.
                self._child = Child(command, stdout=2, pass_fds=(descriptor,))
        except OSError as error:
            raise HardwareFault(f"its servo process does not start: {error}") from None

    def _described(self, patience: float) -> dict[str, float]:
        """What the library says of the device, once it is ready; raises HardwareFault after this time [s]."""
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
        if not self._child.running:
            report = self._memory.heard()  # its last words may have come after the last look
            raise HardwareFault(f"its servo process {self._child.how_it_ended}" if report is None else report[1])
