"""Whether a bus can be read as often as it is to be."""

from collections.abc import Callable

from weberlink.hardware.fault import HardwareFault

TRIES = 40


def check_pace(
    read: Callable[[], object], rate_hz: float, clock: Callable[[], float], path: str, advice: Callable[[], str]
) -> None:
    """See that one reading fits into a period.

    Uses the best of many readings, so that a busy host does not look like a slow adapter.

    Args:
        read: reads all motors once.
        rate_hz: of the bus.
        clock: [s].
        path: of its port, for the message.
        advice: what to do about a slow one.

    Raises:
        HardwareFault: the best reading takes longer.
    """
    period, best = 1.0 / rate_hz, 1.0
    for _ in range(TRIES):
        began = clock()
        read()
        best = min(best, clock() - began)
        if best <= period:
            return
    raise HardwareFault(
        f"{path}: a reading takes {best * 1e3:.1f} ms at best, {rate_hz:g} Hz leave {period * 1e3:.1f} ms; {advice()}"
    )
