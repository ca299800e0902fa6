"""The daemon's side of the process of the servo loop."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict
from math import inf
from mmap import mmap
from select import select
from socket import socket, socketpair
from time import monotonic
from typing import Any

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.slot import Slot
from weberlink.master.devices.touch import servo
from weberlink.master.devices.touch.exchange import (
    END,
    FORCE,
    FORCE_AT,
    MEMORY_SIZE,
    STATE,
    STATE_AT,
    ServoState,
    unpacked,
)
from weberlink.master.devices.touch.servo import ServoArguments

START_S = 10.0
"""Longest time for the process to start, without that for the calibration [s]."""
END_S = 0.5
"""Longest time for the process to end [s]."""
RELEASE_S = 3.0
"""Longest time for another process to take the force off [s]."""
QUIET_S = 0.03
"""Time without a new state before the process itself is looked at [s]."""
SILENT_S = 0.25
"""Time without a new state that is a fault while this process ran [s]."""
LOOKED_S = 0.05
"""A longer pause between two looks means that this process was held up [s]."""


class ServoProcess:
    """Runs `weberlink.master.devices.touch.servo`, whose memory holds the newest force and the newest state.

    Args:
        library: path or name of libHD.so.
        name: of the device; None for the default one.
        force: whether the motors are switched on.
        stale_s: age beyond which a force no longer counts [s].
        ramp_s: how long the force takes to come up [s].
        calibration_s: longest wait for the calibration [s].
    """

    def __init__(
        self, library: str, name: str | None, *, force: bool, stale_s: float, ramp_s: float, calibration_s: float
    ) -> None:
        self._arguments = ServoArguments(library, name, force, stale_s, ramp_s, calibration_s, -1, -1)
        self._child: subprocess.Popen[bytes] | None = None
        self._socket: socket | None = None
        self._memory: mmap | None = None
        self._state = ServoState(0, 0.0, ZERO, (ZERO, ZERO, ZERO), ZERO, 0, 0, 0)
        self._changed_at = self._looked_at = 0.0

    @property
    def pid(self) -> int | None:
        """Process id; None while there is none."""
        return None if self._child is None else self._child.pid

    def start(self) -> dict[str, Any]:
        """Start it, and wait for the calibrated device; gives what the library says of it.

        Raises:
            HardwareFault: it does not start, or the device cannot be used; nothing is left running.
        """
        self.stop()
        try:
            self._spawn(self._arguments)
            described = self._answer(START_S + self._arguments.calibration_s)
        except BaseException:
            self.stop()
            raise
        self.state(monotonic())
        return described

    def put(self, force: Vector, at: float) -> None:
        """The force for the next frame [N, frame of the library], commanded at `at` [s]."""
        if self._memory is not None:
            self._force_slot.write(at, *force)

    def state(self, now: float) -> ServoState:
        """The newest state.

        Raises:
            HardwareFault: the process died, says a fault, or is silent.
        """
        values = self._state_slot.newest()
        if values is not None:
            self._state = unpacked(values)
            self._changed_at = self._looked_at = now
            return self._state
        if now - self._looked_at > LOOKED_S:
            self._changed_at = now
        self._looked_at = now
        if (silent := now - self._changed_at) > QUIET_S:
            self._check(silent)
        return self._state

    def stop(self) -> str | None:
        """Take the force off and end the process; may be called again.

        A process that does not end is killed. If it left a force, another one is started, which takes that off.

        Returns:
            Why the force may still be on; None if it is off.
        """
        child, self._child = self._child, None
        if child is None:
            return None
        assert self._socket is not None
        assert self._memory is not None
        with suppress(OSError):
            self._socket.send(END)
        died = child.poll() is not None
        try:
            child.wait(END_S)
        except subprocess.TimeoutExpired:  # it was stopped by a signal, or the library hangs
            child.send_signal(signal.SIGKILL)
            child.wait()
            died = True
        values = self._state_slot.newest()
        self._state = self._state if values is None else unpacked(values)
        self._socket.close()
        self._memory.close()
        self._socket = self._memory = None
        # With an error of the device the last force is unknown.
        return self._release() if died and (self._state.force != ZERO or self._state.error) else None

    def _release(self) -> str | None:
        """Start the process without force, which takes the force off, and end it."""
        # The library of a device that holds a force is initialized again; a frame of zero follows.
        again = ServoProcess(self._arguments.library, self._arguments.name, force=False, stale_s=1.0, ramp_s=1.0,
                             calibration_s=0.0)  # fmt: skip
        try:
            again._spawn(again._arguments)
            again._answer(RELEASE_S)
        except HardwareFault as fault:
            return f"its servo process died with a force on the hand, which could not be taken off: {fault}"
        finally:
            again.stop()
        return None

    def _spawn(self, arguments: ServoArguments) -> None:
        ours, theirs = socketpair()
        memory = os.memfd_create("weberlink-touch")
        try:
            os.ftruncate(memory, MEMORY_SIZE)
            self._memory = mmap(memory, MEMORY_SIZE)
            self._force_slot = Slot(self._memory, FORCE_AT, FORCE)
            self._state_slot = Slot(self._memory, STATE_AT, STATE)
            self._force_slot.write(-inf, *ZERO)
            handed = {**asdict(arguments), "socket": theirs.fileno(), "memory": memory}
            self._child = subprocess.Popen(  # noqa: S603 - our own
                [sys.executable, "-m", servo.__name__, json.dumps(handed)],
                stdin=subprocess.DEVNULL,
                stdout=sys.stderr.fileno(),  # where the library prints its licence
                pass_fds=(theirs.fileno(), memory),
                start_new_session=True,
            )
        except OSError as error:
            ours.close()
            raise HardwareFault(f"its servo process does not start: {error}") from None
        finally:
            theirs.close()
            os.close(memory)
        self._socket = ours

    def _answer(self, patience: float) -> dict[str, Any]:
        """What it says first, within a time [s].

        Raises:
            HardwareFault: a fault, or nothing.
        """
        line = self._line(patience)
        if line is None:
            raise HardwareFault(f"its servo process does not answer within {patience:g} s")
        if "ready" not in line:
            raise HardwareFault(line["fault"])
        described: dict[str, Any] = line["ready"]
        return described

    def _line(self, patience: float) -> dict[str, Any] | None:
        """The next line; None if there is none within a time [s].

        Raises:
            HardwareFault: the process is gone.
        """
        assert self._socket is not None
        until, text = monotonic() + patience, b""
        while not text.endswith(b"\n"):
            if not select((self._socket,), (), (), max(0.0, until - monotonic()))[0]:
                return None
            part = self._socket.recv(4096)
            if not part:
                assert self._child is not None
                raise HardwareFault(f"its servo process died{_how(self._child)}")
            text += part
        found: dict[str, Any] = json.loads(text)
        return found

    def _check(self, silent: float) -> None:
        """Raise HardwareFault if the process died, says a fault, or was silent for too long [s]."""
        assert self._child is not None
        line = self._line(0.0)
        if line is not None:
            raise HardwareFault(line["fault"])
        if self._child.poll() is not None:
            raise HardwareFault(f"its servo process died{_how(self._child)}")
        if silent > SILENT_S:
            raise HardwareFault(f"its servo process has been silent for {silent:.2f} s")


def _how(child: "subprocess.Popen[bytes]") -> str:
    """How a process ended, for a message."""
    with suppress(subprocess.TimeoutExpired):
        code = child.wait(0.1)
        return f" ({signal.Signals(-code).name})" if code < 0 else f" (exit status {code})"
    return ""
