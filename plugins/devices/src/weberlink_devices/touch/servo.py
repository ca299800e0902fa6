"""The process of the servo loop: the only one that loads libHD.so, whose own thread calls `ServoLoop.frame` at 1 kHz.

    python -m weberlink_devices.touch.servo ORDER

The process reports when it is ready or why it has failed. It ends, without force, when it is told to or when its parent
is gone. The library prints its licence on the standard output.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from mmap import mmap
from time import monotonic, sleep
from typing import Any

from weberlink.child_process import Order
from weberlink.hardware.fault import HardwareFault
from weberlink.realtime.garbage import freeze_garbage
from weberlink_devices.touch import hdapi
from weberlink_devices.touch.exchange import MEMORY_SIZE, Phase, ServoMemory
from weberlink_devices.touch.hdapi import Hdapi, HdError

LOOK_S = 0.01
"""Pause between two looks at the servo loop and at the parent [s]."""
LONGEST_S = 0.002
"""Time for which the force comes up in one frame at most, however long the pause before it was [s]."""
FIRST_FRAME_S = 1.0
"""Longest wait for the first call of the library [s]."""
SILENT_LOOKS = 50
"""The library counts as stuck after so many looks without a call; counted, since a stopped process does not look."""
ERRORS_MOST = 50
"""Frames with an error of force in a row that are a fault; there is no force from the first one on."""
RESTING_S = 0.02
"""How long the loop goes on without force before it ends [s]."""


@dataclass(frozen=True)
class ServoOrder(Order):
    """Order of the process."""

    library: str  # path or name of libHD.so
    name: str | None  # of the device, as the maker's set-up program calls it; None for the default one
    force: bool  # whether the motors are switched on
    stale_s: float  # age beyond which a commanded force no longer counts
    ramp_s: float  # how long the force takes to come up after an interruption
    calibration_s: float  # longest wait for the calibration
    memory: int = -1  # descriptor of the shared memory


class ServoLoop:
    """Swaps the newest force in the memory for the state of an initialized device, once a frame.

    A force counts while it is not older than `stale_s`. After an older one, a loop that stood still, an error or the
    start, the force comes up from zero over `ramp_s`.
    """

    def __init__(self, library: Hdapi, handle: int, memory: ServoMemory, stale_s: float, ramp_s: float) -> None:
        self._library = library
        self._handle = handle
        self._commands = memory.force
        self._states = memory.state
        self._stale = stale_s
        self._ramp = ramp_s
        self._last = inf
        self._commanded: tuple[Any, ...] = (-inf, 0.0, 0.0, 0.0, 0)
        self._share = 0.0
        self._position = (ctypes.c_double * 3)()
        self._transform = (ctypes.c_double * 16)()
        self._force = (ctypes.c_double * 3)()
        self._buttons = ctypes.c_int()
        self.frames = 0
        self.calibration = 0
        """What the library says of it while `calibrates`."""
        self.calibrates = True
        self.rests = True
        """Whether there is no force, whatever is commanded."""
        self.bad_frames = 0
        """Frames with an error of force in a row."""
        self.fault: str | None = None
        """Why there is no force any more; the loop goes on without one."""

    def frame(self, _: object = None) -> int:
        """Called by the library; never raises, since a callback that raises would end the loop with the force on."""
        try:
            self._frame()
        except BaseException as error:
            self.fault = self.fault or f"internal error: {error!r}"
            with suppress(Exception):
                self._force[:] = [0.0, 0.0, 0.0]
                self._library.hdSetDoublev(hdapi.FORCE, self._force)
                self._library.hdEndFrame(self._handle)
        return hdapi.CONTINUE

    def _frame(self) -> None:
        library, handle = self._library, self._handle
        library.hdBeginFrame(handle)
        now = monotonic()
        library.hdGetDoublev(hdapi.POSITION, self._position)
        library.hdGetDoublev(hdapi.TRANSFORM, self._transform)
        library.hdGetIntegerv(hdapi.BUTTONS, self._buttons)
        if self.calibrates:
            self.calibration = library.hdCheckCalibration()
        faulty = self.fault is not None
        x, y, z = self._due(now)
        self._force[:] = [x, y, z]
        library.hdSetDoublev(hdapi.FORCE, self._force)
        library.hdEndFrame(handle)
        error = library.hdGetError()
        if error.code:
            self._note([HdError(error.code, error.internal), *library.errors()])
        else:
            self.bad_frames = 0
        self.frames += 1
        if faulty:  # the last state stays that of the frame with the fault
            return
        t = self._transform
        self._states.write(
            self.frames, now, *self._position, *t[0:3], *t[4:7], *t[8:11], x, y, z,
            self._buttons.value, error.code, error.internal,
        )  # fmt: skip

    def _due(self, now: float) -> tuple[float, float, float]:
        """The force of this frame [N]."""
        commanded = self._commanded = self._commands.newest() or self._commanded
        at, x, y, z, _ = commanded
        stood_still = now - self._last > self._stale  # with the daemon perhaps, whose command is then a new one
        if now - at > self._stale or stood_still or self.rests or self.fault is not None:
            self._share, self._last = 0.0, now
            return (0.0, 0.0, 0.0)
        elapsed = min(now - self._last, LONGEST_S)
        self._last = now
        share = self._share = min(1.0, self._share + max(0.0, elapsed) / self._ramp)
        return (share * x, share * y, share * z)

    def _note(self, errors: list[HdError]) -> None:
        self._share = 0.0
        self.bad_frames += 1
        lasting = [error for error in errors if error.code not in hdapi.FORCE_ERRORS]
        if lasting or self.bad_frames >= ERRORS_MOST:
            self.fault = self.fault or (lasting or errors)[0].in_words


class TouchServo:
    """A device from its initialization until it is released."""

    def __init__(self, order: ServoOrder, library: Hdapi, memory: ServoMemory) -> None:
        self._order = order
        self._library = library
        self._name = order.name or "the default device"
        library.errors()
        self._handle = library.hdInitDevice(None if order.name is None else order.name.encode())
        self._raise_errors("cannot be initialized")
        if self._handle == hdapi.INVALID_HANDLE:
            raise HardwareFault(f"{self._name} cannot be initialized: no reason given")
        self.loop = ServoLoop(library, self._handle, memory, order.stale_s, order.ramp_s)
        self._callback = hdapi.ServoCallback(self.loop.frame)  # kept alive as long as the library may call it
        self._task: int | None = None
        self._seen = (0, 0)
        """Number of the last frame that `look` saw, and its looks since then."""

    def start(self) -> dict[str, float]:
        """Run the loop without force until the device is calibrated; gives its largest force [N] and coordinate [m].

        Raises:
            HardwareFault: the library does not call, the device is not calibrated, or is in error.
        """
        library = self._library
        library.hdMakeCurrentDevice(self._handle)
        library.hdEnable(hdapi.FORCE_CLAMPING)
        library.hdEnable(hdapi.FORCE_LIMIT)
        if self._order.force:
            library.hdEnable(hdapi.FORCE_OUTPUT)
        described = self._described()
        self._raise_errors("cannot be set up")
        self._task = library.hdScheduleAsynchronous(self._callback, None, hdapi.DEFAULT_PRIORITY)
        library.hdStartScheduler()
        # The driver for Linux is known to report an error here and to run all the same: the frames tell.
        complaint = next((f" ({error.in_words})" for error in library.errors()), "")
        if not _holds(lambda: self.loop.frames > 0 or self.loop.fault is not None, FIRST_FRAME_S):
            raise HardwareFault(f"{self._name}: the library does not call within {FIRST_FRAME_S:g} s{complaint}")
        self._calibrate()
        self.loop.calibrates = False
        self.loop.rests = False
        return described

    def stop(self) -> None:
        """Take the force off, end the loop, and release the device."""
        library = self._library
        self.loop.rests = True
        if self._task is not None:
            sleep(RESTING_S)
            library.hdUnschedule(self._task)
        library.hdDisable(hdapi.FORCE_OUTPUT)
        if self._task is not None:
            library.hdStopScheduler()
        library.hdDisableDevice(self._handle)

    def look(self) -> str | None:
        """Why the loop cannot go on; None while it can. To be called every `LOOK_S`."""
        frames, looks = self.loop.frames, self._seen[1] + 1
        self._seen = (frames, looks if frames == self._seen[0] else 0)
        if self.loop.fault is None and self._seen[1] > SILENT_LOOKS:
            return f"{self._name}: the library has stopped calling"
        return self.loop.fault and f"{self._name}: {self.loop.fault}"

    def _described(self) -> dict[str, float]:
        library = self._library
        return {
            "force_n": library.doubles(hdapi.MAX_FORCE, 1)[0],
            "reach_m": 1e-3 * max(map(abs, library.doubles(hdapi.MAX_WORKSPACE, 6))),
        }

    def _calibrate(self) -> None:
        """Wait until the device is calibrated; where it offers an update, take it."""
        until = monotonic() + self._order.calibration_s
        style = self._library.integer(hdapi.CALIBRATION_STYLE)
        while (state := self.loop.calibration) != hdapi.CALIBRATED:
            if self.loop.fault is not None:
                raise HardwareFault(f"{self._name}: {self.loop.fault}")
            if state == hdapi.CALIBRATION_NEEDS_UPDATE:
                self._library.hdUpdateCalibration(style)
            if monotonic() > until:
                inkwell = "put the stylus into its inkwell" if style & hdapi.INKWELL_STYLE else "move the handle about"
                raise HardwareFault(
                    f"{self._name} is not calibrated (0x{state:04x}): {inkwell} and start again, or calibrate it with "
                    "the maker's set-up program"
                )
            sleep(LOOK_S)

    def _raise_errors(self, what: str) -> None:
        if found := self._library.errors():
            raise HardwareFault(f"{self._name} {what}: {found[0].in_words}")


def _holds(condition: Callable[[], bool], patience: float) -> bool:
    until = monotonic() + patience
    while not condition():
        if monotonic() > until:
            return False
        sleep(0.001)
    return True


def run(order: ServoOrder, memory: ServoMemory) -> None:
    """Serve the device until the parent ends this or is gone."""

    def ended() -> bool:
        return os.getppid() != order.parent

    servo = None
    try:
        servo = TouchServo(order, Hdapi(order.library), memory)
        described = servo.start()
        freeze_garbage()
        memory.say(Phase.READY, described)
        fault = None
        while fault is None and not ended() and not memory.told_to_end():
            sleep(LOOK_S)
            fault = servo.look()
        if fault is not None:
            memory.say(Phase.FAILED, fault)
    except HardwareFault as fault:
        memory.say(Phase.FAILED, str(fault))
    except Exception as error:
        memory.say(Phase.FAILED, f"internal error: {error!r}")
    finally:
        if servo is not None:
            servo.stop()


def main(text: str) -> int:
    order = ServoOrder.from_json(text)
    # Whoever stops the parent may send the same to its children; this one ends with the parent, not before.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))  # not beside the parent's tick
    run(order, ServoMemory(mmap(order.memory, MEMORY_SIZE)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
