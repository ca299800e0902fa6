"""The faults that a configuration puts on the link."""

from collections.abc import Callable

from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.system.configuration.model import DirectionFaults


def build_link(settings: DirectionFaults, uniform: Callable[[], float], epoch: float) -> EmulatedLink[Address]:
    """One direction of the link, with its own source of chance."""
    return EmulatedLink(build_emulation(settings), uniform, epoch)


def build_emulation(settings: DirectionFaults) -> Emulation:
    return Emulation(
        delay_s=settings.delay_ms * 1e-3,
        jitter_s=settings.jitter_ms * 1e-3,
        loss=settings.loss,
        burst=settings.burst,
        reorder=settings.reorder,
        duplicate=settings.duplicate,
        corrupt=settings.corrupt,
        rate_bit_s=None if settings.rate_kbit_s is None else settings.rate_kbit_s * 1e3,
        blackouts=settings.blackouts_s,
    )
