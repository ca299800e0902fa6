"""Units of the columns of a trace, and which ones its values cannot be in."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.master.trace import Trace

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
FORCE_UNITS = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
FARTHEST_M = 5.0  # positions beyond this are more likely in another unit: hands and arms reach less
SLOWEST_S = 0.5  # A period of sampling beyond this is more likely in another unit: nobody feels at 2 Hz
STRONGEST_N = 2000.0


class Units(NamedTuple):
    """Units of the columns of a CSV file, by their symbols."""

    position: str = "m"
    time: str = "s"
    force: str = "N"

    @property
    def factors(self) -> NDArray[np.float64]:
        """What turns a row of `weberlink.master.trace.COLUMNS` into SI units."""
        time, position, force = TIME_UNITS[self.time], LENGTH_UNITS[self.position], FORCE_UNITS[self.force]
        return np.array([time, *[position] * 3, *[force] * 3])


SI = Units()


def unlikely_units(trace: Trace) -> tuple[str, Units] | None:
    """What in a trace cannot be in SI units, in words, and the units in which it would be plausible; None if all can.

    Where even the smallest unit would not do, that one is named.
    """
    reach, strongest = float(np.abs(trace.position_m).max()), float(np.linalg.norm(trace.force_n, axis=1).max())
    seen, units = [], SI
    if reach > FARTHEST_M:
        seen.append(f"positions reach {reach:.4g} m")
        units = units._replace(position=_fitting(reach, FARTHEST_M, ("mm", "um"), LENGTH_UNITS))
    if trace.period_s > SLOWEST_S:
        seen.append(f"samples are {trace.period_s:.4g} s apart")
        units = units._replace(time=_fitting(trace.period_s, SLOWEST_S, ("ms", "us", "ns"), TIME_UNITS))
    if strongest > STRONGEST_N:
        seen.append(f"forces reach {strongest:.4g} N")
        units = units._replace(force="mN")
    return (" and ".join(seen), units) if seen else None


def _fitting(value: float, most: float, symbols: Sequence[str], factors: Mapping[str, float]) -> str:
    return next((symbol for symbol in symbols if value * factors[symbol] <= most), symbols[-1])
