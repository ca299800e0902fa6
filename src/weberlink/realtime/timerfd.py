"""Linux timerfd: a kernel timer with absolute deadlines. Python has it from 3.13 on; before, libc is called."""

import os
import sys
import time

if sys.version_info >= (3, 13):

    def create() -> int:
        """A non-blocking timer on the clock of `time.monotonic`, closed on exec. The caller closes it."""
        return os.timerfd_create(time.CLOCK_MONOTONIC, flags=os.TFD_NONBLOCK | os.TFD_CLOEXEC)

    def arm(fd: int, first_ns: int, interval_ns: int) -> None:
        """Expire at `first_ns` of the monotonic clock, at once if it has passed, then every `interval_ns` or never."""
        os.timerfd_settime_ns(fd, flags=os.TFD_TIMER_ABSTIME, initial=first_ns, interval=interval_ns)

else:
    import ctypes

    from weberlink.realtime.process import LIBC, checked

    # These two flags are O_NONBLOCK and O_CLOEXEC on every Linux architecture; the third is from <sys/timerfd.h>.
    _FLAGS = os.O_NONBLOCK | os.O_CLOEXEC
    _ABSOLUTE = 1

    class _TimeSpec(ctypes.Structure):
        _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))

    class _TimerSpec(ctypes.Structure):
        _fields_ = (("it_interval", _TimeSpec), ("it_value", _TimeSpec))

    LIBC.timerfd_create.argtypes = (ctypes.c_int, ctypes.c_int)
    LIBC.timerfd_settime.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.POINTER(_TimerSpec), ctypes.c_void_p)

    def create() -> int:
        """A non-blocking timer on the clock of `time.monotonic`, closed on exec. The caller closes it."""
        return checked(LIBC.timerfd_create(time.CLOCK_MONOTONIC, _FLAGS))

    def arm(fd: int, first_ns: int, interval_ns: int) -> None:
        """Expire at `first_ns` of the monotonic clock, at once if it has passed, then every `interval_ns` or never."""
        spec = _TimerSpec(_timespec(interval_ns), _timespec(first_ns))
        checked(LIBC.timerfd_settime(fd, _ABSOLUTE, ctypes.byref(spec), None))

    def _timespec(nanoseconds: int) -> _TimeSpec:
        return _TimeSpec(*divmod(nanoseconds, 1_000_000_000))


def expirations(fd: int) -> int:
    """How often the timer has expired since the last call; 0 if it has not."""
    try:
        return int.from_bytes(os.read(fd, 8), sys.byteorder)
    except BlockingIOError:
        return 0
